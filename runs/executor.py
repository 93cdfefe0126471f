"""Parallel execution of tasks, by processes of this machine or by workers of a Dask cluster."""

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..inference.methods import FitOptions
from ..inference.problem import FitProblem
from ..processes import cores
from ..project.project import Project
from ..solvers.process import check as check_scheduler
from ..solvers.process import connected
from .cluster import ClusterTasks, OnLost
from .process_pool import ProcessPool, Task
from .starts import Event, MeshName, StartRecord, run_start


@dataclass(frozen=True)
class Executor:
    """Run tasks in parallel on this machine or on a cluster; the results do not depend on which.

    Attributes
    ----------
    jobs : int or None
        Number of tasks at a time; by default one for each core of the machine or cluster.
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
        """Run the task with every one of the numbers, in parallel.

        Parameters
        ----------
        prepare : callable
            Makes the task; it is called once in each process.
        numbers : sequence of int
            Numbers that identify the tasks, such as those of starts.
        name : str
            Name of the tasks, in the plural.
        on_lost : callable, optional
            Returns the record of a task that repeatedly killed its worker, from the number of the
            task and the reason; by default that is an error.

        Yields
        ------
        object
            Records as they come, None now and then.

        Raises
        ------
        BubblefitError
            The error of a task, or that processes died (exit code 4; only the tasks that were under
            way are lost).
        """
        if self.scheduler is None:
            yield from ProcessPool(prepare, numbers, self.jobs or cores(), name).run()
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
        """Fit from every start in parallel, with the yields and errors of `run_tasks`.

        Parameters
        ----------
        build : callable
            Returns the problem; it is called once in each process.
        options : FitOptions
        seed : int
            Seed of the fit.
        numbers : sequence of int
            Numbers of the starts.
        mesh : str
            Mesh of the problem.
        """
        prepare = functools.partial(start_task, build, options, seed, mesh)
        on_lost = functools.partial(lost_start, seed, mesh)
        return self.run_tasks(prepare, numbers, on_lost=on_lost)


def start_task(
    build: Callable[[], FitProblem], options: FitOptions, seed: int, mesh: MeshName
) -> Task:
    """Return the task that fits from the start of a given number."""
    problem = build()
    return lambda number, on_event: run_start(problem, options, seed, number, on_event, mesh)


def lost_start(seed: int, mesh: MeshName, number: int, reason: str) -> StartRecord:
    """Return the record of a start that repeatedly killed its worker."""
    return StartRecord(number, (seed, number), None, reason, failure=reason, mesh=mesh)


def executor_of(project: Project) -> Executor:
    """Return the executor of a project's tasks."""
    return Executor(project.fit.jobs, project.scheduler)
