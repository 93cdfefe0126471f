"""Solvers by name: the one place where a name becomes a solver."""

from __future__ import annotations

from collections.abc import Callable

from ..errors import InputError
from .base import Solver
from .membrane.solver import MembraneSolver

SOLVERS: dict[str, Callable[[], Solver]] = {"membrane": MembraneSolver}


def solver_named(name: str) -> Solver:
    """A new solver; InputError names the ones there are."""
    if name not in SOLVERS:
        raise InputError(None, "solver", f"{name!r} is not one of: {', '.join(sorted(SOLVERS))}")
    return SOLVERS[name]()
