"""Analyses one after the other on the solver of a project: counted, and told of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..materials.law import HypoelasticLaw
from ..solvers.base import History, Solver, check_carries
from ..solvers.once import Once
from ..solvers.registry import counted, usable_solver
from ..solvers.run_cache import RunCache
from .logged import timed
from .project import Project


@dataclass(frozen=True)
class Step:
    """How far a series of analyses is.

    part : what is run. analysis : which of how many, from 1. done : increments of it so far.
    """

    part: str
    analysis: int
    analyses: int
    done: float
    increments: int


Progress = Callable[[Step], None]


class Analyses:
    """A series of analyses.

    Parameters
    ----------
    project : whose solver runs them. progress : is told how far they are; `total` is what it is
        told of how many there will be. kept : where each is kept as it ends, and taken from where
        it is there; None: nowhere but in the cache of runs.

    Raises
    ------
    InputError, SolverFailure : the solver cannot be used.
    """

    def __init__(
        self, project: Project, progress: Progress | None = None, kept: RunCache | None = None
    ) -> None:
        name = project.fit.solver
        options = project.options_of(name)
        self.solver: Solver = usable_solver(name, options, project.path, cache=project.run_cache)
        own = counted(name, options)
        self._runs = self.solver if kept is None else Once(self.solver, kept, own)
        self.total = self.count = 0
        self._progress = progress

    def run(self, part: str, model: Any, law: HypoelasticLaw, increments: int) -> History:
        """The next analysis; `part` and `increments` (0: not known) are for the progress.

        Raises
        ------
        SolverFailure : it does not end well.
        """
        check_carries(self.solver, law)
        self.count += 1
        with timed(f"analysis {self.count}, {part}, by {self.solver.name}"):
            return self._run(part, model, law, increments)

    def _run(self, part: str, model: Any, law: HypoelasticLaw, increments: int) -> History:
        tell, count = self._progress, self.count
        if tell is None:
            return self._runs.run(model, law)

        def say(done: float) -> None:
            tell(Step(part, count, self.total, done, increments))

        say(0.0)
        self.solver.progress = lambda increment: say(increment.time)
        try:
            return self._runs.run(model, law)
        finally:
            self.solver.progress = None
