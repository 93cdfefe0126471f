"""Tasks side by side: `Executor`, by processes of this machine or by workers of a Dask cluster.

`run_tasks`, processes: no pool of concurrent.futures or loky, as those need the semaphores of
/dev/shm, end every task when one process dies, and hang when a process is killed while it writes.
Every process has a pipe of its own and nothing is shared (tests/runs/test_processes.py).

`ClusterTasks`: each worker thread has one task at a time, so the task of a dead worker is
known and done again, nothing waits behind a long task, and later workers are used. Reports of a
task come with its result, once."""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import platform
import queue
import signal
import threading
import time
import uuid
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import connection
from typing import Any

import cloudpickle
import psutil
from threadpoolctl import threadpool_limits

from ..errors import BubblefitError, InputError
from ..inference.methods import FitOptions
from ..inference.problem import FitProblem
from ..processes import process_context
from ..project.project import Project
from ..solvers.base import Announcement, announce, hearing, pass_on
from ..solvers.decks import CODE, file_mark
from ..solvers.process import ANSWER_S, Unwanted, connected, unless
from ..solvers.process import check as check_scheduler
from ..solvers.scratch import remove_interrupted, sweep_left
from ..storage.folders import ROOT
from ..version import __version__
from .starts import Event, MeshName, StartRecord, run_start

log = logging.getLogger(__name__)
#: Does the task of a number; what it reports on the way and what it returns are records.
Task = Callable[[int, Callable[[Any], None]], Any]
#: Returns the record of a lost task from its number and the reason.
Lost = Callable[[int, str], Any]
#: s between two looks for events, at the parent, and at the workers of a cluster.
WAIT_S, LOOK_S, ASK_S = 0.5, 0.3, 1.0
#: s for a worker to kill its solver and remove its scratch folder; for a result to come here.
GRACE_S, FETCH_S = 20.0, 30.0
#: Tries of a task if its process dies; workers of a cluster that may die of one.
TRIES, DEATHS = 2, 3
#: Series of tasks that a worker of a cluster keeps ready; who runs one has one or two at a time.
MOST = 4
_prepared: OrderedDict[str, bytes] = OrderedDict()
_ready = threading.local()


class WorkersLost(BubblefitError):
    """Processes, workers or a scheduler that ended before their tasks."""

    exit_code = 4


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
    scheduler; by default processes of this machine."""

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
        which worker after worker died; by default an error. BubblefitError : of a task; of
        processes that died (exit code 4: only current tasks are lost)."""
        if self.scheduler is None:
            yield from run_tasks(prepare, numbers, self.jobs or cores(), what)
            return
        with connected(self.scheduler) as client:
            series = ClusterTasks(client, prepare, numbers, self.jobs, what, lost)
            try:
                yield from series.run()
            finally:
                series.cancel()

    def run_starts(
        self,
        build: Callable[[], FitProblem],
        options: FitOptions,
        seed: int,
        numbers: Sequence[int],
        mesh: MeshName = "full",
    ) -> Iterator[Event | None]:
        """Fit every start, as `run_tasks`; build : the problem, once a process. mesh : of it."""

        def lost(number: int, why: str) -> StartRecord:
            at = number, (seed, number)
            return StartRecord(*at, None, why, 0, (), (), 0.0, failure=why, mesh=mesh)

        def prepare() -> Task:
            problem = build()
            return lambda number, tell: run_start(problem, options, seed, number, tell, mesh)

        return self.run_tasks(prepare, numbers, lost=lost)


def executor_of(project: Project) -> Executor:
    """Return the executor of a project's tasks."""
    return Executor(project.fit.jobs, project.scheduler)


def run_tasks(
    prepare: Callable[[], Task], numbers: Sequence[int], jobs: int, what: str = "starts"
) -> Iterator[Any]:
    """Do tasks as `Executor.run_tasks` in `jobs` processes beside this one, which only listens.
    A task whose process dies is done again, once: its earlier reports come twice. A second death,
    or an error of a task, ends all."""
    context = process_context()
    if context.get_start_method() == "fork":
        import numba  # noqa: F401 - here once, not in every process
    waiting = deque(numbers)
    left = len(numbers)
    died = Counter[int]()
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
    code = worker.process.exitcode
    number = worker.task
    if number is None:  # it had done all it was given
        return
    sweep_left()  # the folder of a run that it had under way
    died[number] += 1
    words = f"a worker process died (exit code {code}; out of memory?)"
    if died[number] < TRIES:
        announce(f"{words}; what it did is done again")
        waiting.appendleft(number)
        return
    raise WorkersLost(
        f"{words}, as did the one before it at the same task; finished {what} are kept: go on with "
        "--resume, perhaps with fewer --jobs"
    )


def _work(prepare: Any, listener: connection.Connection, parent: int) -> None:
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
            try:
                listener.send(error)
            except ConnectionError:
                raise SystemExit(1) from None
            except Exception:  # it cannot cross: its words can
                listener.send(BubblefitError(f"{type(error).__name__}: {error}"))
    except SystemExit:
        # Nothing else of a copy of the parent is run: the end is an end at once.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        remove_interrupted()
        os._exit(1)
    # Nothing is left to remove, and an exception raised after this function would pass through
    # the code of the parent, where this process is its copy: the end is an end at once.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _end_with_parent(number: int) -> None:
    """Interrupt this process when its parent is gone, and kill it GRACE_S later.
    The kernel's signal is of Linux only, and comes when the starting thread ends."""
    me = psutil.Process()
    with suppress(psutil.NoSuchProcess):
        parent = psutil.Process(number)
        while me.ppid() == number and parent.is_running():
            time.sleep(LOOK_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE_S)
    me.kill()


class ClusterTasks:
    """Tasks of one kind on the workers that a scheduler has."""

    def __init__(
        self,
        client: Any,
        prepare: Callable[[], Task],
        numbers: Sequence[int],
        jobs: int | None,
        what: str,
        lost: Callable[[int, str], Any] | None,
    ) -> None:
        self.client = client
        self.jobs = jobs
        self.what = what
        self.lost = lost
        self.name = f"bubblefit-{uuid.uuid4().hex}"
        self.prepare: bytes = cloudpickle.dumps(prepare)
        self.waiting, self.deaths = deque(numbers), Counter[int]()
        #: By key of the future: it, the worker, and the number of its task (None: it joins).
        self.running: dict[str, tuple[Any, str, int | None]] = {}
        #: Threads of the workers that are used, of those that are there.
        self.threads: dict[str, int] = {}
        self.there: dict[str, int] = {}
        self.refused: dict[str, str] = {}
        self.events: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._silent = 0
        self._waits = False
        self._used = False
        self._looked = -ASK_S
        client.subscribe_topic(self.name, lambda event: self.events.put(Announcement(*event[1])))

    def run(self) -> Iterator[Any]:
        """Yield records as they come, None now and then."""
        while self.waiting or any(number is not None for _, _, number in self.running.values()):
            if time.monotonic() - self._looked >= ASK_S:
                yield from self._look()
                self._looked = time.monotonic()
            self._hand_out()
            try:
                event = self.events.get(timeout=WAIT_S)
            except queue.Empty:
                yield None
                continue
            if isinstance(event, Announcement):
                pass_on(event)
                yield None
            elif event.key in self.running:
                yield from self._ended(*self.running.pop(event.key))

    def cancel(self) -> None:
        """Cancel all tasks: workers look now and then if their task is still wanted."""
        futures = [future for future, _, _ in self.running.values()]
        if futures and self.client.status == "running":
            self.client.cancel(futures, force=True)
        self.running.clear()

    def _look(self) -> Iterator[Any]:
        """Register workers that have gone or come."""
        try:
            ask = self.client.scheduler.ncores
            there = self.client.sync(ask, workers=None, callback_timeout=ANSWER_S)
            self._silent = 0
        except Exception as error:  # of the network, of its time limits, of a closed client
            self._silent += 1
            if self._silent > 1 or self.client.status != "running":
                raise self._gone(error) from None
            return
        self.there = dict(there)
        for worker in {worker for _, worker, _ in self.running.values()} - set(there):
            yield from self._died(worker)
        self.threads = {worker: n for worker, n in self.threads.items() if worker in there}
        self.refused = {worker: why for worker, why in self.refused.items() if worker in there}
        joining = {worker for _, worker, number in self.running.values() if number is None}
        for worker in set(there) - set(self.threads) - set(self.refused) - joining:
            self._submit(worker, None)
        if there and set(there) == set(self.refused) and not self._used:
            raise InputError(None, "--scheduler", "; ".join(self.refused.values()))
        if self._waits != (waits := set(there) <= set(self.refused)):
            self._waits = waits
            announce("waiting for a worker of the cluster" if waits else "", self.name)

    def _hand_out(self) -> None:
        busy = Counter(worker for _, worker, number in self.running.values() if number is not None)
        for worker, threads in self.threads.items():
            while self.waiting and busy[worker] < threads:
                if self.jobs is not None and busy.total() >= self.jobs:
                    return
                self._submit(worker, self.waiting.popleft())
                busy[worker] += 1

    def _submit(self, worker: str, number: int | None) -> None:
        options = {"workers": [worker], "allow_other_workers": False, "pure": False}
        if number is None:
            future = self.client.submit(join, self.name, self.prepare, version(), **options)
        else:
            future = self.client.submit(work_of, self.name, number, self.name, **options)
        self.running[future.key] = (future, worker, number)
        future.add_done_callback(self.events.put)

    def _ended(self, future: Any, worker: str, number: int | None) -> Iterator[Any]:
        """Handle the end of a task, or of a worker's joining, however it ended."""
        error: BaseException | None = None
        try:
            result = future.result(timeout=FETCH_S)
        except Exception as caught:
            error = caught
        if number is None:
            said = result if error is None else error
            wanted = version()
            if said == wanted:
                self.threads[worker] = self.there.get(worker, 1)
                self._used = True
            elif worker in self.there:
                self.refused[worker] = f"worker {worker} is not used: it has {_other(said, wanted)}"
                announce(self.refused[worker])
        elif error is None:
            yield from result
        elif isinstance(error, NotJoined):
            self.threads.pop(worker, None)
            self.waiting.appendleft(number)
        elif future.status != "error" or type(error).__name__ == "KilledWorker":
            # Its result went with the worker, or there is no scheduler any more.
            if self.client.status != "running":
                raise self._gone(error)
            yield from self._again(worker, [number])
        else:
            raise error

    def _died(self, worker: str) -> Iterator[Any]:
        """Give the tasks of a worker that is gone to others."""
        self.threads.pop(worker, None)
        own = {k: v for k, v in self.running.items() if v[1] == worker}
        for key, (future, _, _) in own.items():
            del self.running[key]
            future.cancel(force=True)
        yield from self._again(worker, [n for _, _, n in own.values() if n is not None])

    def _again(self, worker: str, numbers: Sequence[int]) -> Iterator[Any]:
        for number in numbers:
            self.deaths[number] += 1
            task = f"task {number} of the {self.what}"
            if self.deaths[number] < DEATHS:
                announce(f"worker {worker} died; {task} is done again elsewhere")
                self.waiting.appendleft(number)
                continue
            why = f"{DEATHS} workers died of it, the last was {worker}"
            announce(f"{task} is given up: {why}")
            if self.lost is None:
                raise WorkersLost(f"{task}: {why}; the others are kept: go on with --resume")
            yield self.lost(number, why)

    def _gone(self, error: BaseException) -> BubblefitError:
        log.info("%r", error)
        kept = f"finished {self.what} are kept: go on with --resume"
        return WorkersLost(f"the Dask scheduler does not answer any more; {kept}")


def _other(said: Any, wanted: tuple[str, str, str]) -> str:
    """Return the differences of a worker."""
    if isinstance(said, BaseException):
        return f"no bubblefit of this version ({type(said).__name__}: {said})".splitlines()[0]
    names = ("Python", "bubblefit", "code of bubblefit")
    return ", ".join(
        f"{name} {own}, here it is {ours}" if name != names[2] else f"another {name}"
        for name, own, ours in zip(names, said, wanted, strict=True)
        if own != ours
    )


@functools.cache
def version() -> tuple[str, str, str]:
    """Return the versions of Python, of bubblefit, and of its code by content."""
    files = [*ROOT.glob("*.py")]
    for folder in ROOT.iterdir():
        if folder.name == "templates" or (folder / "__init__.py").exists():
            files += [path for path in folder.rglob("*") if path.suffix in CODE]
    named = {path.relative_to(ROOT).as_posix(): path for path in files}
    marks = [
        (name, file_mark(named[name]))
        for name in sorted(named)
        if name.split("/")[0] not in ("tests", "setup.py")
    ]
    return platform.python_version(), __version__, hashlib.sha256(repr(marks).encode()).hexdigest()


def join(series: str, prepare: bytes, wanted: tuple[str, str, str]) -> tuple[str, str, str]:
    """Return this version; keep what prepares a series of tasks if it is the wanted one."""
    if version() == wanted:
        _prepared[series] = prepare
        while len(_prepared) > MOST:
            _prepared.popitem(last=False)
    return version()


class NotJoined(Exception):
    """A worker that came back under its address without the series."""


def work_of(series: str, number: int, topic: str) -> list[Any]:
    """Return the reports of a task and last its result; raises NotJoined, Unwanted."""
    from distributed import get_worker

    worker: Any = get_worker()
    key = worker.get_current_task()

    def unwanted() -> bool:
        state = worker.state.tasks.get(key)
        return state is None or state.state == "cancelled"

    def said(announcement: Announcement) -> None:
        worker.log_event(topic, [announcement.words, announcement.of])

    told: list[Any] = []

    def tell(record: Any) -> None:
        if unwanted():
            raise Unwanted
        told.append(record)

    with hearing(said), unless(unwanted):
        ready: dict[str, Any] | None = getattr(_ready, "tasks", None)
        if ready is None or series not in ready:
            if series not in _prepared:
                raise NotJoined(series)
            _ready.limits = threadpool_limits(1)  # the worker's threads are what runs side by side
            _ready.tasks = ready = {series: cloudpickle.loads(_prepared[series])()}
        told.append(ready[series](number, tell))
    return told
