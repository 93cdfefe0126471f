"""Tasks on a Dask cluster: handed to workers one by one, again elsewhere where a worker dies.

Every worker thread has one task at a time, which is meant for it alone: so it is known which task a
worker had when it died, nothing waits behind a long task while another worker is idle, and workers
that come later are used. What a task told comes with what it gives, once.
"""

from __future__ import annotations

import logging
import queue
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ..errors import BubblefitError, InputError
from ..solvers.base import Announcement, announce, pass_on
from ..solvers.scheduler import ANSWER_S, connected
from . import cluster_worker
from .cluster_worker import NotJoined
from .workers import Task

log = logging.getLogger(__name__)
#: s between two looks at who is there, and to an event.
LOOK_S, WAIT_S = 1.0, 0.5
#: s for the result of a task that has ended to come here.
FETCH_S = 30.0
#: Workers that may die of a task before it is given up.
DEATHS = 3


def run_tasks(
    prepare: Callable[[], Task],
    numbers: Sequence[int],
    address: str,
    jobs: int | None,
    what: str,
    lost: Callable[[int, str], Any] | None,
) -> Iterator[Any]:
    """As `Executor.run_tasks`, on the workers of the scheduler at `address`."""
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
        import cloudpickle

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
        """Records as they come, None now and then."""
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
        """Let nothing run on: workers look now and then whether their task is still wanted."""
        futures = [future for future, _, _ in self.running.values()]
        if futures and self.client.status == "running":
            self.client.cancel(futures, force=True)
        self.running.clear()

    def _look(self) -> Iterator[Any]:
        """Who has gone, and who has come."""
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
            wanted = cluster_worker.version()
            give = self.client.submit
            future = give(cluster_worker.join, self.name, self.prepare, wanted, **options)
        else:
            future = self.client.submit(
                cluster_worker.work, self.name, number, self.name, **options
            )
        self.running[future.key] = (future, worker, number)
        future.add_done_callback(self.events.put)

    def _ended(self, future: Any, worker: str, number: int | None) -> Iterator[Any]:
        """A task, or what a worker does first, has ended in one way or another."""
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
        """A worker is used if its bubblefit is ours."""
        wanted = cluster_worker.version()
        if said == wanted:
            self.threads[worker], self._used = self.there.get(worker, 1), True
        elif worker in self.there:
            self.refused[worker] = f"worker {worker} is not used: it has {_other(said, wanted)}"
            announce(self.refused[worker])

    def _died(self, worker: str) -> Iterator[Any]:
        """A worker is gone: what it had is done by others."""
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
    """In what a worker is another."""
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
