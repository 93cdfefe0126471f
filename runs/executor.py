"""Tasks side by side: in processes of this machine, or on the workers of a Dask cluster.

The processes are not a pool of concurrent.futures or loky: those pools need the semaphores of
/dev/shm, end every task when one process dies, and hang when a process is killed while it writes.
Here every process has a pipe of its own and nothing is shared (tests/runs/test_processes.py).
"""

from __future__ import annotations

import functools
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import connection
from typing import Any

import cloudpickle
import psutil
from threadpoolctl import threadpool_limits

from ..errors import BubblefitError
from ..files import process_context
from ..inference.methods import FitOptions
from ..inference.problem import FitProblem
from ..project.project import Project
from ..solvers.base import Announcement, announce, hearing, pass_on
from ..solvers.process import check as check_scheduler
from ..solvers.scratch import remove_interrupted, sweep_left
from . import cluster
from .cluster import Task
from .starts import EvaluationRecord, MeshName, StartRecord, run_start

Record = EvaluationRecord | StartRecord
#: Returns the record of a lost task from its number and the reason.
Lost = Callable[[int, str], Any]
#: s between two looks for events, and at the parent.
WAIT_S, LOOK_S = 0.5, 0.3
#: s for a worker to kill its solver and remove its scratch folder.
GRACE_S = 20.0
#: Tries of a task if its process dies.
TRIES = 2


@functools.cache
def cores() -> int:
    """Return the number of cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True)
class Executor:
    """Do tasks here or on a cluster, with the same results.

    jobs : at once; by default all cores of machine or cluster. scheduler : address of a Dask
    scheduler; by default processes of this machine.
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
        what: str = "starts",
        lost: Lost | None = None,
    ) -> Iterator[Any]:
        """Do the task of every number; yield records as they come, None now and then.

        prepare : makes the task, once a process. what : name of the tasks. lost : for a task at
        which worker after worker died; by default an error.

        Raises
        ------
        BubblefitError : of a task; of processes that died (exit code 4: only current tasks are
            lost).
        """
        if self.scheduler is None:
            return run_tasks(prepare, numbers, self.jobs or cores(), what)
        return cluster.run_tasks(prepare, numbers, self.scheduler, self.jobs, what, lost)

    def run_starts(
        self,
        build: Callable[[], FitProblem],
        options: FitOptions,
        seed: int,
        numbers: Sequence[int],
        mesh: MeshName = "full",
    ) -> Iterator[Record | None]:
        """Fit every start; yield records as they come, None now and then.

        build : makes the problem, once a process. mesh : of it, for the records.
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
    """Return the executor of a project's tasks."""
    return Executor(project.fit.jobs, project.scheduler)


def run_tasks(
    prepare: Callable[[], Task], numbers: Sequence[int], jobs: int, what: str = "starts"
) -> Iterator[Any]:
    """Do the task of every number here; yield records as they come, None now and then.

    A task whose process dies is done again, once: its earlier reports come twice. A second death,
    or an error of a task, ends all. jobs : processes beside this one, which only listens.
    """
    context = process_context()
    waiting, left, died = deque(numbers), len(numbers), Counter[int]()
    workers: list[_Worker] = []

    def begin() -> None:
        workers.append(worker := _Worker(context, prepare))
        worker.give(waiting.popleft() if waiting else None)

    try:
        for _ in range(max(min(jobs, left), 1)):
            begin()
        while left:
            ready = connection.wait([worker.connection for worker in workers], WAIT_S)
            if not ready:
                yield None
            for worker in [worker for worker in workers if worker.connection in ready]:
                try:
                    record = worker.connection.recv()
                except (EOFError, OSError):
                    workers.remove(worker)
                    _again(worker, what, waiting, died)
                    if waiting:
                        begin()
                    continue
                if isinstance(record, BaseException):
                    raise record
                if isinstance(record, Announcement):
                    pass_on(record)
                    record = None
                if isinstance(record, _Ended):
                    left -= 1
                    record = record.record
                    worker.give(waiting.popleft() if waiting else None)
                yield record
        for worker in workers:  # nothing is left to do: they end by themselves
            worker.process.join(GRACE_S)
    finally:
        # Twice: where Python ignores exceptions (a finaliser), the first one is lost.
        for _ in range(2):
            for worker in workers:
                worker.process.terminate()
            for worker in workers:
                worker.process.join(GRACE_S / 2)
        for worker in workers:
            if worker.process.is_alive():  # it could not even end: do not wait for it for ever
                worker.process.kill()
                worker.process.join()


@dataclass(frozen=True)
class _Ended:
    """The last record of a task, on its way between processes."""

    record: Any


class _Worker:
    """A process that does tasks one by one, and the pipe to it."""

    def __init__(self, context: Any, prepare: Callable[[], Task]) -> None:
        self.connection, there = context.Pipe()
        self.task: int | None = None
        given: Any = prepare
        if context.get_start_method() != "fork":
            given = cloudpickle.dumps(prepare)
        arguments = (given, there, os.getpid())
        self.process = context.Process(target=_work, args=arguments, daemon=True)
        self.process.start()
        there.close()  # the only other one is the worker's: where that dies, reading ends

    def give(self, number: int | None) -> None:
        """Send the number of the next task; None ends the worker."""
        self.task = number
        with suppress(OSError):  # it is dead, which shows when it is listened to
            self.connection.send(number)


def _again(worker: _Worker, what: str, waiting: deque[int], died: Counter[int]) -> None:
    """Queue the task of a dead worker again, or raise at the last try."""
    worker.process.join(GRACE_S)
    code, number = worker.process.exitcode, worker.task
    if number is None:  # it had done all it was given
        return
    sweep_left()  # the folder of a run that it had under way
    died[number] += 1
    words = f"a worker process died (exit code {code}; out of memory?)"
    if died[number] < TRIES:
        announce(f"{words}; what it did is done again")
        waiting.appendleft(number)
        return
    again = f"{words}, as did the one before it at the same task"
    error = BubblefitError(
        f"{again}; finished {what} are kept: go on with --resume, perhaps with fewer --jobs"
    )
    error.exit_code = 4
    raise error


def _work(prepare: Any, listener: connection.Connection, parent: int) -> None:
    """Do tasks until there are no more, in a worker process."""
    # Ctrl-C reaches the whole group; the parent decides and terminates us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end(*_: object) -> None:
        # By an exception, so that a solver that runs is killed and its scratch folder removed.
        raise SystemExit(1)

    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()
    try:
        try:
            with threadpool_limits(1), hearing(listener.send):
                if isinstance(prepare, bytes):
                    prepare = cloudpickle.loads(prepare)
                task = prepare()
                while (number := listener.recv()) is not None:
                    listener.send(_Ended(task(number, listener.send)))
        except (EOFError, ConnectionError):  # nobody listens any more
            raise SystemExit(1) from None
        except Exception as error:
            _send_error(listener, error)
    except SystemExit:
        # Nothing else of a copy of the parent is run: the end is an end at once.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        remove_interrupted()
        os._exit(1)
    # Nothing is left to remove, and an exception raised after this function would pass through
    # the code of the parent, where this process is its copy: the end is an end at once.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _send_error(listener: connection.Connection, error: Exception) -> None:
    try:
        listener.send(error)
    except ConnectionError:
        raise SystemExit(1) from None
    except Exception:  # it cannot cross: its words can
        listener.send(BubblefitError(f"{type(error).__name__}: {error}"))


def _end_with_parent(number: int) -> None:
    """Interrupt this process when its parent is gone, and kill it GRACE_S later.

    The kernel's signal is of Linux only, and comes when the starting thread ends.
    """
    me = psutil.Process()
    with suppress(psutil.NoSuchProcess):
        parent = psutil.Process(number)
        while me.ppid() == number and parent.is_running():
            time.sleep(LOOK_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE_S)
    me.kill()
