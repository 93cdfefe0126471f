"""Tasks on a Dask cluster: handed to workers one by one, again elsewhere if a worker dies.

Each worker thread has one task of its own at a time: so the task of a dead worker is known, nothing
waits behind a long task, and later workers are used. Reports of a task come with its result, once.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import platform
import queue
import threading
import time
import uuid
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import cloudpickle
from threadpoolctl import threadpool_limits

from ..errors import BubblefitError, InputError
from ..files import __version__
from ..solvers.base import Announcement, announce, hearing, pass_on
from ..solvers.decks import CODE, file_mark
from ..solvers.process import ANSWER_S, Unwanted, connected, unless

log = logging.getLogger(__name__)
#: Does the task of a number; what it reports on the way and what it returns are records.
Task = Callable[[int, Callable[[Any], None]], Any]
#: s between two looks at who is there, and to an event.
LOOK_S, WAIT_S = 1.0, 0.5
#: s for the result of a task that has ended to come here.
FETCH_S = 30.0
#: Workers that may die of a task before it is given up.
DEATHS = 3

ROOT = Path(__file__).resolve().parents[1]
#: Series of tasks that a worker keeps ready; who runs one has one or two at a time.
MOST = 4
_prepared: OrderedDict[str, bytes] = OrderedDict()
_ready = threading.local()


def run_tasks(
    prepare: Callable[[], Task],
    numbers: Sequence[int],
    address: str,
    jobs: int | None,
    what: str,
    lost: Callable[[int, str], Any] | None,
) -> Iterator[Any]:
    """Do tasks as `Executor.run_tasks`, on the workers of the scheduler at `address`."""
    with connected(address) as client:
        series = Series(client, prepare, numbers, jobs, what, lost)
        try:
            yield from series.run()
        finally:
            series.cancel()


class Series:
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
        self.client, self.jobs, self.what, self.lost = client, jobs, what, lost
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
        self._silent, self._waits, self._used = 0, False, False
        self._looked = -LOOK_S
        client.subscribe_topic(self.name, lambda event: self.events.put(Announcement(*event[1])))

    def run(self) -> Iterator[Any]:
        """Yield records as they come, None now and then."""
        while self.waiting or any(number is not None for _, _, number in self.running.values()):
            if time.monotonic() - self._looked >= LOOK_S:
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
            future = self.client.submit(work, self.name, number, self.name, **options)
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
            self._joined(worker, result if error is None else error)
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

    def _joined(self, worker: str, said: Any) -> None:
        """Use a worker if its bubblefit is ours."""
        wanted = version()
        if said == wanted:
            self.threads[worker], self._used = self.there.get(worker, 1), True
        elif worker in self.there:
            self.refused[worker] = f"worker {worker} is not used: it has {_other(said, wanted)}"
            announce(self.refused[worker])

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
                raise _error(f"{task}: {why}; the others are kept: go on with --resume")
            yield self.lost(number, why)

    def _gone(self, error: BaseException) -> BubblefitError:
        log.info("%r", error)
        return _error(
            "the Dask scheduler does not answer any more; "
            f"finished {self.what} are kept: go on with --resume"
        )


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


def _error(words: str) -> BubblefitError:
    error = BubblefitError(words)
    error.exit_code = 4
    return error


# On a worker: it prepares a series of tasks once, and does them by number.


@functools.cache
def version() -> tuple[str, str, str]:
    """Return the versions of Python, of bubblefit, and of its code by content."""
    return platform.python_version(), __version__, _code()


def _code() -> str:
    """Return the SHA-256 of all modules and templates of the package."""
    files = [*ROOT.glob("*.py")]
    for folder in ROOT.iterdir():
        if folder.name == "templates" or (folder / "__init__.py").exists():
            files += [path for path in folder.rglob("*") if path.suffix in CODE]
    named = {path.relative_to(ROOT).as_posix(): path for path in files}
    marks = [(name, file_mark(named[name])) for name in sorted(named)
             if name.split("/")[0] not in ("tests", "setup.py")]  # fmt: skip
    return hashlib.sha256(repr(marks).encode()).hexdigest()


def join(series: str, prepare: bytes, wanted: tuple[str, str, str]) -> tuple[str, str, str]:
    """Return this version; keep what prepares a series of tasks if it is the wanted one."""
    if version() == wanted:
        _prepared[series] = prepare
        while len(_prepared) > MOST:
            _prepared.popitem(last=False)
    return version()


class NotJoined(Exception):
    """A worker that came back under its address without the series."""


def work(series: str, number: int, topic: str) -> list[Any]:
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
        told.append(_task(series)(number, tell))
    return told


def _task(series: str) -> Any:
    """Return the task of a series, made once a thread, as solvers keep things."""
    ready: dict[str, Any] | None = getattr(_ready, "tasks", None)
    if ready is None or series not in ready:
        if series not in _prepared:
            raise NotJoined(series)
        _ready.limits = threadpool_limits(1)  # the worker's threads are what runs side by side
        _ready.tasks = ready = {series: cloudpickle.loads(_prepared[series])()}
    return ready[series]
