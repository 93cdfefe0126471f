"""Solvers by name: the one place where a name becomes a solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import InputError
from .base import Solver
from .membrane.solver import MembraneSolver


def _calculix(**options: Any) -> Solver:
    from .calculix.solver import CalculixSolver

    return CalculixSolver(**options)


def _marc(**options: Any) -> Solver:
    from .marc.solver import MarcSolver

    return MarcSolver(**options)


SOLVERS: dict[str, Callable[..., Solver]] = {
    "calculix": _calculix,
    "marc": _marc,
    "membrane": MembraneSolver,
}


def solver_named(name: str, **options: Any) -> Solver:
    """A new solver with its constructor's `options`; InputError names the ones there are."""
    if name not in SOLVERS:
        raise InputError(None, "solver", f"{name!r} is not one of: {', '.join(sorted(SOLVERS))}")
    return SOLVERS[name](**options)
