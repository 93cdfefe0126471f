"""Starts, and other tasks, side by side on this machine's cores."""

from __future__ import annotations

import functools
import logging
import multiprocessing
import os
import queue
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from threadpoolctl import threadpool_limits

from ..errors import BubblefitError
from ..identification.methods import FitOptions
from ..identification.problem import FitProblem
from ..solvers.announcements import Announcement, hearing, pass_on
from ..solvers.scratch import remove_interrupted
from .start import EvaluationRecord, MeshName, StartRecord, run_start

log = logging.getLogger(__name__)
Record = EvaluationRecord | StartRecord
#: Does the task of a number; what it tells on the way and what it gives in the end are records.
Task = Callable[[int, Callable[[Any], None]], Any]
WAIT_S = 0.5
#: For a worker to kill its solver and remove its scratch folder once it is told to end.
GRACE_S = 20.0


@dataclass(frozen=True)
class _Ended:
    """The last record of a task, on its way between processes."""

    record: Any


def run_starts(
    build: Callable[[], FitProblem],
    options: FitOptions,
    seed: int,
    numbers: Sequence[int],
    jobs: int,
    mesh: MeshName = "full",
) -> Iterator[Record | None]:
    """Fit every start; yield records as they come, None now and then while nothing does.

    Parameters
    ----------
    build : makes the problem; called once in every process.
    jobs : processes beside this one, which only listens.
    mesh : of the problem, for the records.

    Raises
    ------
    BubblefitError : a process died (exit code 4: nothing is lost but its current start).
    """
    return run_tasks(functools.partial(_starting, build, options, seed, mesh), numbers, jobs)


def _starting(
    build: Callable[[], FitProblem], options: FitOptions, seed: int, mesh: MeshName
) -> Task:
    problem = build()
    return lambda number, tell: run_start(problem, options, seed, number, tell, mesh)


def run_tasks(
    prepare: Callable[[], Task], numbers: Sequence[int], jobs: int, what: str = "starts"
) -> Iterator[Any]:
    """Do the task of every number; yield records as they come, None now and then.

    Parameters
    ----------
    prepare : makes what does a task; called once in every process.
    jobs : processes beside this one, which only listens.
    what : the tasks are called, for complaints.

    Raises
    ------
    BubblefitError : a process died (exit code 4: nothing is lost but its current task); an error
        of a task ends them all.
    """
    # fork: the compiled kernels and the project are there already; elsewhere spawn works too.
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("fork" if "fork" in methods else "spawn")
    try:
        tasks: Any = context.Queue()
        records: Any = context.Queue()
    except OSError as error:  # no semaphores: /dev/shm missing or not writable
        log.warning("one process only: this machine has no shared memory (%s)", error)
        yield from _here(prepare, numbers)
        return
    count = max(min(jobs, len(numbers)), 1)
    for task in [*numbers, *([None] * count)]:
        tasks.put(task)
    workers = [
        context.Process(target=_work, args=(prepare, tasks, records, os.getpid()), daemon=True)
        for _ in range(count)
    ]
    for worker in workers:
        worker.start()
    try:
        left = len(numbers)
        while left:
            try:
                record = records.get(timeout=WAIT_S)
            except queue.Empty:
                _check(workers, what)
                yield None
                continue
            if isinstance(record, BaseException):
                raise record
            if isinstance(record, Announcement):
                pass_on(record)
                yield None
                continue
            if isinstance(record, _Ended):
                left -= 1
                record = record.record
            yield record
        for worker in workers:  # nothing is left to do: they end by themselves
            worker.join(GRACE_S)
    finally:
        # Twice: where Python ignores exceptions (a finaliser), the first one is lost.
        for _ in range(2):
            for worker in workers:
                worker.terminate()
            for worker in workers:
                worker.join(GRACE_S / 2)
        for worker in workers:
            if worker.is_alive():  # it could not even end: do not wait for it for ever
                worker.kill()
                worker.join()


def _here(prepare: Callable[[], Task], numbers: Sequence[int]) -> Iterator[Any]:
    """Without other processes: the records of a task come when it has ended."""
    with threadpool_limits(1):
        task = prepare()
        for number in numbers:
            told: list[Any] = []
            told.append(task(number, told.append))
            yield from told


def _check(workers: Sequence[Any], what: str) -> None:
    for worker in workers:
        if worker.exitcode not in (None, 0):
            error = BubblefitError(
                f"a worker process died (exit code {worker.exitcode}; out of memory?); "
                f"finished {what} are kept: go on with --resume, perhaps with fewer --jobs"
            )
            error.exit_code = 4
            raise error


def _work(prepare: Callable[[], Task], tasks: Any, records: Any, parent: int) -> None:
    # Ctrl-C reaches the whole group; the parent decides and terminates us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end(*_: object) -> None:
        # By an exception, so that a solver that runs is killed and its scratch folder removed.
        # Nobody reads the queue any more: do not wait for that.
        records.cancel_join_thread()
        raise SystemExit(1)

    signal.signal(signal.SIGTERM, end)

    def tell(record: Any) -> None:
        if os.getppid() != parent:  # killed without a chance to end us
            os._exit(1)
        records.put(record)

    try:
        with threadpool_limits(1), hearing(tell):
            task = prepare()
            while (number := tasks.get()) is not None:
                tell(_Ended(task(number, tell)))
    except SystemExit:
        # Told to end, perhaps within a lock of the queue: what multiprocessing does at the end of
        # a process would wait for that lock.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        remove_interrupted()
        os._exit(1)
    except Exception as error:
        tell(error)
    # Nothing is left to remove, and an exception raised after this function would pass through
    # the code of the parent, whose copy this process is: the end is an end at once.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
