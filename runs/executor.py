"""Who does tasks side by side: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..inference.methods.base import FitOptions
from ..inference.problem import FitProblem
from ..project.project import Project
from . import processes
from .starts import EvaluationRecord, MeshName, StartRecord, run_start
from .workers import Task

Record = EvaluationRecord | StartRecord
#: Makes the record of a task that nobody could do, of its number and why.
Lost = Callable[[int, str], Any]


@functools.cache
def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True)
class Executor:
    """Where tasks are done; what comes of them is the same everywhere.

    jobs : at once, at most; all cores of this machine, or of the cluster, unless given. scheduler :
    address of a Dask scheduler; processes of this machine unless given.
    """

    jobs: int | None = None
    scheduler: str | None = None

    def check(self) -> None:
        """That the cluster is there, now rather than after the data are read.

        Raises
        ------
        InputError : no scheduler answers, or Dask is not installed.
        """
        if self.scheduler is not None:
            from ..solvers.scheduler import check

            check(self.scheduler)

    def run_tasks(
        self,
        prepare: Callable[[], Task],
        numbers: Sequence[int],
        what: str = "starts",
        lost: Lost | None = None,
    ) -> Iterator[Any]:
        """Do the task of every number; yield records as they come, None now and then.

        Parameters
        ----------
        prepare : makes what does a task; called once in every process.
        what : the tasks are called, for complaints.
        lost : of a task at which worker after worker died; an error unless given.

        Raises
        ------
        BubblefitError : an error of a task; processes that died (exit code 4: nothing is lost but
            the current tasks).
        """
        if self.scheduler is None:
            return processes.run_tasks(prepare, numbers, self.jobs or cores(), what)
        from .cluster import run_tasks

        return run_tasks(prepare, numbers, self.scheduler, self.jobs, what, lost)

    def run_starts(
        self,
        build: Callable[[], FitProblem],
        options: FitOptions,
        seed: int,
        numbers: Sequence[int],
        mesh: MeshName = "full",
    ) -> Iterator[Record | None]:
        """Fit every start; yield records as they come, None now and then while nothing does.

        build : makes the problem; called once in every process. mesh : of it, for the records.
        """

        def lost(number: int, why: str) -> StartRecord:
            return StartRecord(
                number, (seed, number), None, why, 0, (), (), 0.0, failure=why, mesh=mesh
            )

        prepare = functools.partial(_starting, build, options, seed, mesh)
        return self.run_tasks(prepare, numbers, lost=lost)


def _starting(
    build: Callable[[], FitProblem], options: FitOptions, seed: int, mesh: MeshName
) -> Task:
    problem = build()
    return lambda number, tell: run_start(problem, options, seed, number, tell, mesh)


def executor_of(project: Project) -> Executor:
    """Return what runs the starts and other tasks of a project side by side."""
    return Executor(project.fit.jobs, project.scheduler)
