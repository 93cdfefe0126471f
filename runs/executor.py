"""Tasks side by side, with the same results, by processes of this machine or a Dask cluster."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..inference.methods import FitOptions
from ..inference.problem import FitProblem
from ..project.project import Project
from ..solvers.process import check as check_scheduler
from ..solvers.process import connected
from .cluster import ClusterTasks, OnLost
from .process_pool import Task, cores, run_tasks
from .starts import Event, MeshName, StartRecord, run_start


@dataclass(frozen=True)
class Executor:
    """Do tasks on this machine or on a cluster, with the same results.

    Attributes
    ----------
    jobs : int or None
        Tasks at once; by default all cores of machine or cluster.
    scheduler : str or None
        Address of a Dask scheduler; by default processes of this machine.
    """

    jobs: int | None = None
    scheduler: str | None = None

    def check(self) -> None:
        """Raise InputError if no scheduler answers, or Dask is not installed."""
        if self.scheduler is not None:
            check_scheduler(self.scheduler)

    def run_tasks(
        self,
        prepare: Callable[[], Task],
        numbers: Sequence[int],
        name: str = "starts",
        on_lost: OnLost | None = None,
    ) -> Iterator[Any]:
        """Do the task of every number.

        Parameters
        ----------
        prepare : callable
            Makes the task, once a process.
        numbers : sequence of int
        name : str
            Name of the tasks, in the plural.
        on_lost : callable, optional
            Returns the record of a task at which worker after worker died, from its number and the
            reason; by default that is an error.

        Yields
        ------
        object
            Records as they come, None now and then.

        Raises
        ------
        BubblefitError
            Of a task; of processes that died (exit code 4: only current tasks are lost).
        """
        if self.scheduler is None:
            yield from run_tasks(prepare, numbers, self.jobs or cores(), name)
            return
        with connected(self.scheduler) as client:
            tasks = ClusterTasks(client, prepare, numbers, self.jobs, name, on_lost)
            try:
                yield from tasks.run()
            finally:
                tasks.cancel()

    def run_starts(
        self,
        build: Callable[[], FitProblem],
        options: FitOptions,
        seed: int,
        numbers: Sequence[int],
        mesh: MeshName = "full",
    ) -> Iterator[Event | None]:
        """Fit from every start, as `run_tasks`.

        Parameters
        ----------
        build : callable
            Returns the problem, once a process.
        options : FitOptions
        seed : int
            Of the fit.
        numbers : sequence of int
            Of the starts.
        mesh : str
            Mesh of the problem.
        """
        prepare = functools.partial(start_task, build, options, seed, mesh)
        on_lost = functools.partial(lost_start, seed, mesh)
        return self.run_tasks(prepare, numbers, on_lost=on_lost)


def start_task(
    build: Callable[[], FitProblem], options: FitOptions, seed: int, mesh: MeshName
) -> Task:
    """Return the task that fits from a start."""
    problem = build()
    return lambda number, on_event: run_start(problem, options, seed, number, on_event, mesh)


def lost_start(seed: int, mesh: MeshName, number: int, reason: str) -> StartRecord:
    """Return the record of a start at which worker after worker died."""
    return StartRecord(
        number=number,
        seed=(seed, number),
        objective=None,
        status=reason,
        analyses=0,
        unknowns=(),
        coefficients=(),
        wall_s=0.0,
        failure=reason,
        mesh=mesh,
    )


def executor_of(project: Project) -> Executor:
    """Return the executor of a project's tasks."""
    return Executor(project.fit.jobs, project.scheduler)
