"""Pool of processes of this machine that run tasks, each with a pipe of its own.

No pool of concurrent.futures or loky, as those need the semaphores of /dev/shm, end every task when
one process dies, and hang when a process is killed while it writes. Every process has a pipe to
itself and nothing is shared (tests/runs/test_process_pool.py).

A local Dask cluster in its place needs the same semaphores and a package more, and two starts of
the example with a known solution on two cores take 19 to 23 s of processor time by it, not 7 to
10 s, begin after 6 to 18 s, not 2 to 3 s, and are silent for 30 s, not 5 s, as the reports of a
task come with its result: a killed start would leave no row in history.csv.
"""

from __future__ import annotations

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
from threadpoolctl import threadpool_limits

from ..errors import BubblefitError
from ..lazy_modules import psutil
from ..processes import may_run_at_once, process_context, share_cores
from ..solvers.base import Announcement, announce, hearing, pass_on
from ..solvers.scratch import remove_interrupted, sweep_left

#: A task: a function of its number and of a callable for reports. Each report, and last what it
#: returns, is a record.
Task = Callable[[int, Callable[[Any], None]], Any]

#: Seconds that this process waits for messages, and between a worker's checks for its parent.
WAIT_S = 0.5
LOOK_S = 0.3
#: Seconds that a worker has to kill its solver and remove its scratch folder.
GRACE_S = 20.0
#: Number of times that a task is tried if its process dies.
MAX_TRIES = 2


class WorkersLost(BubblefitError):
    """The loss of processes, workers or a scheduler before their tasks ended."""

    exit_code = 4


class ProcessPool:
    """Processes of this machine that do tasks one by one, as `Executor.run_tasks`.

    A task whose process dies is done again, once: its earlier reports come twice. A second death,
    or an error of a task, ends all.

    Parameters
    ----------
    prepare : callable
        Makes the task; it is called once in each process.
    numbers : sequence of int
        Numbers of the tasks.
    jobs : int
        Number of processes at a time.
    name : str
        Name of the tasks, in the plural.
    """

    def __init__(
        self, prepare: Callable[[], Task], numbers: Sequence[int], jobs: int, name: str
    ) -> None:
        self.prepare = prepare
        self.waiting = deque(numbers)
        self.unfinished = len(numbers)
        self.jobs = jobs
        self.name = name
        self.deaths = Counter[int]()
        self.workers: list[Worker] = []
        self.context = process_context()

    def run(self) -> Iterator[Any]:
        """Yield records as they come, None now and then."""
        if self.context.get_start_method() == "fork":
            import numba  # noqa: F401 - once in this process, not in every worker
        try:
            for _ in range(max(min(self.jobs, self.unfinished), 1)):
                self.start_worker()
            while self.unfinished:
                yield from self.receive()
            for worker in self.workers:  # without a task they end by themselves
                worker.process.join(GRACE_S)
        finally:
            self.end()

    def start_worker(self) -> None:
        """Start a process, and give it a task."""
        processes = min(self.jobs, max(self.unfinished, 1))
        worker = Worker(self.context, self.prepare, processes, self.jobs // processes)
        self.workers.append(worker)
        self.give_task(worker)

    def give_task(self, worker: Worker) -> None:
        """Give a worker the next task that waits, or let the worker end."""
        worker.give(self.waiting.popleft() if self.waiting else None)

    def receive(self) -> Iterator[Any]:
        """Yield the records that workers have sent; None if nothing comes within `WAIT_S`."""
        ready = connection.wait([worker.connection for worker in self.workers], WAIT_S)
        if not ready:
            yield None
        for worker in [worker for worker in self.workers if worker.connection in ready]:
            try:
                message = worker.connection.recv()
            except (EOFError, OSError):
                self.replace(worker)
            else:
                yield self.record_of(worker, message)

    def record_of(self, worker: Worker, message: Any) -> Any:
        """Return the record in a worker's message, None if it has none; raise an error in it."""
        if isinstance(message, BaseException):
            raise message
        if isinstance(message, Announcement):
            pass_on(message)
            return None
        if isinstance(message, TaskEnd):
            self.unfinished -= 1
            self.give_task(worker)
            return message.record
        return message

    def replace(self, worker: Worker) -> None:
        """Start another worker for one that died; raises WorkersLost at the last try."""
        self.workers.remove(worker)
        worker.process.join(GRACE_S)
        if worker.task is not None:
            sweep_left()  # the folder of a run that it had under way
            self.repeat(worker.task, worker.process.exitcode)
        if self.waiting:
            self.start_worker()

    def repeat(self, number: int, exit_code: int | None) -> None:
        """Queue the task of a dead worker again; raises WorkersLost at the last try."""
        self.deaths[number] += 1
        words = f"a worker process died (exit code {exit_code}; out of memory?)"
        words += f" at task {number} of the {self.name}"
        if self.deaths[number] < MAX_TRIES:
            announce(f"{words}, which is done again")
            self.waiting.appendleft(number)
            return
        raise WorkersLost(
            f"{words}, as did the one before it; finished {self.name} are kept: go on with "
            "--resume, perhaps with fewer --jobs"
        )

    def end(self) -> None:
        """End all processes, also those that do not react."""
        # Twice: where Python ignores exceptions (a finaliser), the first one is lost.
        for _ in range(2):
            for worker in self.workers:
                worker.process.terminate()
            for worker in self.workers:
                worker.process.join(GRACE_S / 2)
        for worker in self.workers:
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()


@dataclass(frozen=True)
class TaskEnd:
    """The last record of a task, on its way between processes."""

    record: Any


class Worker:
    """A process that does tasks one by one, and the pipe to it."""

    def __init__(
        self, context: Any, prepare: Callable[[], Task], processes: int, at_once: int
    ) -> None:
        self.connection, worker_end = context.Pipe()
        self.task: int | None = None
        content: Any = prepare
        if context.get_start_method() != "fork":
            content = cloudpickle.dumps(prepare)
        arguments = (content, worker_end, os.getpid(), processes, at_once)
        self.process = context.Process(target=_work, args=arguments, daemon=True)
        self.process.start()
        worker_end.close()  # the worker alone has it: where that dies, reading ends

    def give(self, number: int | None) -> None:
        """Send the number of the next task; None ends the worker."""
        self.task = number
        with suppress(OSError):  # it is dead, which shows when it is listened to
            self.connection.send(number)


# In the processes --------------------------------------------------------------------------------


def _work(
    prepare: Any, listener: connection.Connection, parent: int, processes: int, at_once: int
) -> None:
    """Do tasks until there is none; the function of one of so many processes.

    `at_once` : number of processes in which it may do a task, itself counted.
    """
    share_cores(processes)
    # Ctrl-C reaches the whole group; the parent decides and terminates us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end_by_exception)
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()
    try:
        with may_run_at_once(at_once):
            _do_tasks(prepare, listener)
    except SystemExit:
        # Nothing else of a copy of the parent is run: the end is an end at once.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        remove_interrupted()
        os._exit(1)
    # Nothing is left to remove, and an exception raised after this function would pass through
    # the code of the parent, where this process is its copy: the end is an end at once.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _end_by_exception(*_: object) -> None:
    """End so that a solver that runs is killed and its scratch folder removed."""
    raise SystemExit(1)


def _do_tasks(prepare: Any, listener: connection.Connection) -> None:
    """Do the tasks that come; send an error, which ends them."""
    try:
        with threadpool_limits(1), hearing(listener.send):
            if isinstance(prepare, bytes):
                prepare = cloudpickle.loads(prepare)
            task = prepare()
            while (number := listener.recv()) is not None:
                listener.send(TaskEnd(task(number, listener.send)))
    except (EOFError, ConnectionError):  # nobody listens any more
        raise SystemExit(1) from None
    except Exception as error:
        _send_error(error, listener)


def _send_error(error: Exception, listener: connection.Connection) -> None:
    """Send an error, or its words if it cannot be pickled."""
    try:
        listener.send(error)
    except ConnectionError:
        raise SystemExit(1) from None
    except Exception:
        listener.send(BubblefitError(f"{type(error).__name__}: {error}"))


def _end_with_parent(number: int) -> None:
    """Interrupt this process when its parent is gone, and kill it GRACE_S later.

    The kernel's signal is of Linux only, and comes when the starting thread ends.
    """
    process = psutil.Process()
    with suppress(psutil.NoSuchProcess):
        parent = psutil.Process(number)
        while process.ppid() == number and parent.is_running():
            time.sleep(LOOK_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE_S)
    process.kill()
