"""Solvers by name: the one place where a name becomes a solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import BubblefitError, InputError
from .base import Solver, SolverCheck
from .membrane.solver import MembraneSolver
from .plugins import plug_in_named, plug_ins


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


def solver_names() -> list[str]:
    """Every solver that can be asked for, ours and those of plug-ins."""
    return sorted({*SOLVERS, *(plug_in.name for plug_in in plug_ins())})


def solver_named(name: str, **options: Any) -> Solver:
    """A new solver with its constructor's `options`: ours, else that of a plug-in.

    Raises
    ------
    InputError : there is none of that name (says which there are), or an option is wrong.
    SolverFailure : a plug-in that does not work; names its distribution.
    """
    # A plug-in cannot take the place of one of ours.
    if name in SOLVERS:
        return SOLVERS[name](**options)
    plug_in = plug_in_named(name)
    if plug_in is None:
        raise InputError(None, "solver", f"{name!r} is not one of: {', '.join(solver_names())}")
    return plug_in.make(**options)


def checked(name: str, solver: Solver) -> SolverCheck:
    """What `check` finds of the solver `name`.

    Raises
    ------
    SolverFailure : the check of a plug-in fails; names its distribution.
    InputError : an option that the check does not like.
    """
    try:
        return solver.check()
    except BubblefitError:
        raise
    except Exception as error:
        plug_in = None if name in SOLVERS else plug_in_named(name)
        if plug_in is None:
            raise
        raise plug_in.failure("fails its check", error) from error
