"""Starts, and other tasks, side by side on this machine's cores."""

from __future__ import annotations

import multiprocessing
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import connection
from typing import Any

from ..errors import BubblefitError
from ..solvers.base import Announcement, announce, pass_on
from ..solvers.scratch import sweep_left
from .workers import GRACE_S, Ended, Task, Worker

WAIT_S = 0.5
#: How often a task is tried in all where the process that does it dies.
TRIES = 2


def run_tasks(
    prepare: Callable[[], Task], numbers: Sequence[int], jobs: int, what: str = "starts"
) -> Iterator[Any]:
    """Do the task of every number; yield records as they come, None now and then.

    A task whose process dies is done again, once, from its beginning: what it told before comes
    twice.

    Parameters
    ----------
    prepare : makes what does a task; called once in every process.
    jobs : processes beside this one, which only listens.
    what : the tasks are called, for complaints.

    Raises
    ------
    BubblefitError : processes died of one task (exit code 4: nothing else is lost); an error of a
        task ends them all.
    """
    # fork: the compiled kernels and the project are there already; elsewhere spawn works too.
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("fork" if "fork" in methods else "spawn")
    waiting, left, died = deque(numbers), len(numbers), Counter[int]()
    workers: list[Worker] = []

    def begin() -> None:
        workers.append(worker := Worker(context, prepare))
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
                    record = worker.hear()
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
                if isinstance(record, Ended):
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


def _again(worker: Worker, what: str, waiting: deque[int], died: Counter[int]) -> None:
    """A worker is dead: its task waits again, or is given up."""
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
