"""What a solver does with each kind of model: a table instead of questions about types."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from ..errors import SolverFailure

T = TypeVar("T")


def analysis_of(analyses: Mapping[type, T], model: object, solver: str) -> T:
    """The entry for a model's class, or for the nearest class that it is made from.

    Raises
    ------
    SolverFailure : there is none; says what the solver runs.
    """
    for kind in type(model).__mro__:
        if kind in analyses:
            return analyses[kind]
    known = ", ".join(kind.__name__ for kind in analyses)
    raise SolverFailure(f"cannot run a {type(model).__name__}, only: {known}", solver)
