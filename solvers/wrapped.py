"""A solver around another one: what it is asked beside a run is asked of the other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .base import BandEnd, SolverCheck, carries_load_ratios


class WrappedSolver:
    """All of the protocol `Solver` but `run`, as the solver within it has it.

    Parameters
    ----------
    solver : the one within, of the protocol `Solver`.
    """

    def __init__(self, solver: Any) -> None:
        self.solver = solver
        self.name: str = solver.name
        self.external: bool = solver.external

    @property
    def progress(self) -> Callable[[Any], None] | None:
        """Who is told of a run on its way."""
        told: Callable[[Any], None] | None = self.solver.progress
        return told

    @progress.setter
    def progress(self, tell: Callable[[Any], None] | None) -> None:
        self.solver.progress = tell

    @property
    def identity(self) -> str:
        """Whose results are the same."""
        return str(self.solver.identity)

    @property
    def keep(self) -> bool:
        """Whether folders of runs are kept."""
        return bool(getattr(self.solver, "keep", False))

    @property
    def load_ratios(self) -> bool:
        """Whether it can run laws that depend on the load ratio."""
        return carries_load_ratios(self.solver)

    def check(self) -> SolverCheck:
        """Whether it is there and sound."""
        found: SolverCheck = self.solver.check()
        return found


class WrappedBand:
    """Beside it, where the answer of the solver within to some models is a band."""

    solver: Any

    def band(self, model: Any) -> list[BandEnd]:
        """The ends of the band; nothing is run."""
        return list(self.solver.band(model))
