"""Parallel execution of tasks, by processes of this machine or by workers of a Dask cluster.

Each worker thread of a cluster has one task at a time, so the task of a dead worker is known and
done again, nothing waits behind a long task, and later workers are used. Reports of a task come
with its result, once.
"""

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
from dataclasses import dataclass
from typing import Any

import cloudpickle

from ..errors import BubblefitError, InputError
from ..inference.methods import FitOptions
from ..inference.problem import FitProblem
from ..processes import cores, limit_blas
from ..project.project import Project
from ..solvers.base import Announcement, announce, hearing, pass_on
from ..solvers.decks import CODE, file_mark
from ..solvers.process import ANSWER_S, Unwanted, connected, unless
from ..solvers.process import check as check_scheduler
from ..storage.writing import ROOT
from ..version import __version__
from .process_pool import WAIT_S, ProcessPool, Task, WorkersLost
from .starts import Event, MeshName, StartRecord, run_start

log = logging.getLogger(__name__)

#: Returns the record of a lost task from its number and the reason.
OnLost = Callable[[int, str], Any]


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


#: Versions of Python and of bubblefit, and a digest of the code of bubblefit.
Version = tuple[str, str, str]

#: Seconds between two checks of the workers of a cluster, and the time limit of fetching a result.
ASK_S = 1.0
FETCH_S = 30.0
#: Number of workers that may die while running one task before it is given up.
MAX_DEATHS = 3
#: Number of series of tasks that a worker keeps prepared; a run has one or two at a time.
MAX_SERIES = 4


@dataclass(frozen=True)
class Submission:
    """A task on a worker, with its future and number; None as the number lets the worker join."""

    future: Any
    worker: str
    number: int | None


class ClusterTasks:
    """Tasks of one kind on the workers that a scheduler has.

    Parameters
    ----------
    client : distributed.Client
    prepare : callable
        Makes the task; it is called once in each thread of a worker.
    numbers : sequence of int
        Numbers of the tasks.
    jobs : int or None
        Number of tasks at a time; None for one in each thread.
    name : str
        Name of the tasks, in the plural.
    on_lost : callable or None
        Returns the record of a task that repeatedly killed its worker; with None that is an error.
    """

    def __init__(
        self,
        client: Any,
        prepare: Callable[[], Task],
        numbers: Sequence[int],
        jobs: int | None,
        name: str,
        on_lost: OnLost | None,
    ) -> None:
        self.client = client
        self.jobs = jobs
        self.name = name
        self.on_lost = on_lost
        self.series = f"bubblefit-{uuid.uuid4().hex}"
        self.prepare: bytes = cloudpickle.dumps(prepare)
        self.waiting = deque(numbers)
        self.deaths = Counter[int]()
        #: Submitted tasks by the key of their future.
        self.submissions: dict[str, Submission] = {}
        #: Number of threads by worker, of all workers that are present and of those that are used.
        self.present: dict[str, int] = {}
        self.used: dict[str, int] = {}
        #: Reasons why workers are not used, by worker.
        self.refused: dict[str, str] = {}
        self.events: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._missing_answers = 0
        self._is_waiting = False
        self._was_used = False
        self._look_time = -ASK_S
        client.subscribe_topic(self.series, self._hear)

    def _hear(self, event: Any) -> None:
        self.events.put(Announcement(*event[1]))

    def run(self) -> Iterator[Any]:
        """Yield records as they come, None now and then."""
        while self.waiting or any(s.number is not None for s in self.submissions.values()):
            if time.monotonic() - self._look_time >= ASK_S:
                yield from self._look()
                self._look_time = time.monotonic()
            self._hand_out()
            try:
                event = self.events.get(timeout=WAIT_S)
            except queue.Empty:
                yield None
                continue
            if isinstance(event, Announcement):
                pass_on(event)
                yield None
            elif event.key in self.submissions:
                yield from self._ended(self.submissions.pop(event.key))

    def cancel(self) -> None:
        """Cancel all tasks: workers look now and then if their task is still wanted."""
        futures = [submission.future for submission in self.submissions.values()]
        if futures and self.client.status == "running":
            self.client.cancel(futures, force=True)
        self.submissions.clear()

    def _look(self) -> Iterator[Any]:
        """Register workers that have gone or come."""
        present = self._ask_for_workers()
        if present is None:
            return
        self.present = present
        busy = {submission.worker for submission in self.submissions.values()}
        for worker in busy - set(present):
            yield from self._died(worker)
        self.used = {w: threads for w, threads in self.used.items() if w in present}
        self.refused = {w: reason for w, reason in self.refused.items() if w in present}
        self._let_join()
        self._announce_waiting()

    def _announce_waiting(self) -> None:
        """Announce whether there is a worker to use; raises InputError if all are refused."""
        if self.present and set(self.present) == set(self.refused) and not self._was_used:
            raise InputError(None, "--scheduler", "; ".join(self.refused.values()))
        is_waiting = set(self.present) <= set(self.refused)
        if self._is_waiting != is_waiting:
            self._is_waiting = is_waiting
            announce("waiting for a worker of the cluster" if is_waiting else "", self.series)

    def _ask_for_workers(self) -> dict[str, int] | None:
        """Return the threads of each worker; None where the scheduler is silent, once."""
        try:
            ask = self.client.scheduler.ncores
            threads = self.client.sync(ask, workers=None, callback_timeout=ANSWER_S)
        except Exception as error:  # of the network, of its time limits, of a closed client
            self._missing_answers += 1
            if self._missing_answers > 1 or self.client.status != "running":
                raise self._gone(error) from None
            return None
        self._missing_answers = 0
        return dict(threads)

    def _let_join(self) -> None:
        """Let workers join that are neither used nor refused, nor are joining."""
        joining = {s.worker for s in self.submissions.values() if s.number is None}
        for worker in set(self.present) - set(self.used) - set(self.refused) - joining:
            self._submit(worker, None)

    def _hand_out(self) -> None:
        """Give a task to each thread that has none."""
        busy = Counter(s.worker for s in self.submissions.values() if s.number is not None)
        for worker, threads in self.used.items():
            while self.waiting and busy[worker] < threads:
                if self.jobs is not None and busy.total() >= self.jobs:
                    return
                self._submit(worker, self.waiting.popleft())
                busy[worker] += 1

    def _submit(self, worker: str, number: int | None) -> None:
        """Submit a task to a worker, or let it join."""
        # A "pure" call would be answered by an earlier one with the same arguments.
        options = {"workers": [worker], "allow_other_workers": False, "pure": False}
        if number is None:
            future = self.client.submit(join, self.series, self.prepare, version(), **options)
        else:
            future = self.client.submit(work_of, self.series, number, **options)
        self.submissions[future.key] = Submission(future, worker, number)
        future.add_done_callback(self.events.put)

    def _ended(self, submission: Submission) -> Iterator[Any]:
        """Handle the end of a task, or of a worker's joining, however it ended."""
        error: BaseException | None = None
        result: Any = None
        try:
            result = submission.future.result(timeout=FETCH_S)
        except Exception as failure:
            error = failure
        if submission.number is None:
            self._joined(submission.worker, result if error is None else error)
        elif error is None:
            yield from result
        else:
            yield from self._failed(submission, submission.number, error)

    def _joined(self, worker: str, answer: Version | BaseException) -> None:
        """Use a worker of this version, and refuse any other."""
        if answer == version():
            self.used[worker] = self.present.get(worker, 1)
            self._was_used = True
        elif worker in self.present:
            reason = f"worker {worker} is not used: it has {differences(answer, version())}"
            self.refused[worker] = reason
            announce(reason)

    def _failed(self, submission: Submission, number: int, error: BaseException) -> Iterator[Any]:
        """Do a task again that went with its worker; raises an error that it raised."""
        if isinstance(error, NotJoined):
            self.used.pop(submission.worker, None)
            self.waiting.appendleft(number)
        elif submission.future.status != "error" or type(error).__name__ == "KilledWorker":
            # Its result went with the worker, or there is no scheduler any more.
            if self.client.status != "running":
                raise self._gone(error)
            yield from self._repeat(submission.worker, [number])
        else:
            raise error

    def _died(self, worker: str) -> Iterator[Any]:
        """Give the tasks of a worker that is gone to others."""
        self.used.pop(worker, None)
        numbers = []
        for key, submission in [*self.submissions.items()]:
            if submission.worker == worker:
                del self.submissions[key]
                submission.future.cancel(force=True)
                if submission.number is not None:
                    numbers.append(submission.number)
        yield from self._repeat(worker, numbers)

    def _repeat(self, worker: str, numbers: Sequence[int]) -> Iterator[Any]:
        """Queue tasks again; yield the records of those of which too many workers died."""
        for number in numbers:
            self.deaths[number] += 1
            task = f"task {number} of the {self.name}"
            if self.deaths[number] < MAX_DEATHS:
                announce(f"worker {worker} died; {task} is done again elsewhere")
                self.waiting.appendleft(number)
                continue
            reason = f"{MAX_DEATHS} workers died of it, the last was {worker}"
            announce(f"{task} is given up: {reason}")
            if self.on_lost is None:
                raise WorkersLost(f"{task}: {reason}; the others are kept: go on with --resume")
            yield self.on_lost(number, reason)

    def _gone(self, error: BaseException) -> BubblefitError:
        """Return the error of a scheduler that is gone."""
        log.info("%r", error)
        return WorkersLost(
            f"the Dask scheduler does not answer any more; finished {self.name} are kept: go on "
            "with --resume"
        )


def differences(answer: Version | BaseException, expected: Version) -> str:
    """Return in words how the versions of a worker differ from those expected."""
    if isinstance(answer, BaseException):
        return f"no bubblefit of this version ({type(answer).__name__}: {answer})".splitlines()[0]
    words = []
    if answer[0] != expected[0]:
        words.append(f"Python {answer[0]}, here it is {expected[0]}")
    if answer[1] != expected[1]:
        words.append(f"bubblefit {answer[1]}, here it is {expected[1]}")
    if answer[2] != expected[2]:
        words.append("another code of bubblefit")
    return ", ".join(words)


@functools.cache
def version() -> Version:
    """Return the versions of Python, of bubblefit, and of its code by content."""
    files = [*ROOT.glob("*.py")]
    for folder in ROOT.iterdir():
        if folder.name == "templates" or (folder / "__init__.py").exists():
            files += [path for path in folder.rglob("*") if path.suffix in CODE]
    by_name = {path.relative_to(ROOT).as_posix(): path for path in files}
    marks = [
        (name, file_mark(by_name[name]))
        for name in sorted(by_name)
        if name.split("/")[0] not in ("tests", "setup.py")
    ]
    return platform.python_version(), __version__, hashlib.sha256(repr(marks).encode()).hexdigest()


# On the workers ----------------------------------------------------------------------------------

#: Pickled functions that prepare the tasks of a series, by the name of the series.
_prepared: OrderedDict[str, bytes] = OrderedDict()


class _ThreadState(threading.local):
    """The task that a thread of a worker has ready, and the series that it is of."""

    series = ""
    task: Task | None = None
    limits: Any = None


_thread_state = _ThreadState()


class NotJoined(Exception):
    """A worker that came back under its address without the series."""


def join(series: str, prepare: bytes, expected: Version) -> Version:
    """Return this version; keep what prepares a series of tasks if it is the expected one."""
    if version() == expected:
        _prepared[series] = prepare
        while len(_prepared) > MAX_SERIES:
            _prepared.popitem(last=False)
    return version()


class TaskReports:
    """Collect what a task on a worker reports, until the task is cancelled."""

    def __init__(self, worker: Any, topic: str) -> None:
        self.worker = worker
        self.topic = topic
        self.key = worker.get_current_task()
        self.records: list[Any] = []

    def is_unwanted(self) -> bool:
        """Return whether the task was cancelled."""
        state = self.worker.state.tasks.get(self.key)
        return state is None or state.state == "cancelled"

    def announce(self, announcement: Announcement) -> None:
        """Pass an announcement on to whoever runs the series."""
        self.worker.log_event(self.topic, [announcement.words, announcement.of])

    def add(self, record: Any) -> None:
        """Add a record; raises Unwanted."""
        if self.is_unwanted():
            raise Unwanted
        self.records.append(record)


def work_of(series: str, number: int) -> list[Any]:
    """Return the reports of a task and last its result; raises NotJoined, Unwanted.

    Announcements go to whoever runs the series, under its name.
    """
    from distributed import get_worker

    reports = TaskReports(get_worker(), series)
    with hearing(reports.announce), unless(reports.is_unwanted):
        task = _task_of(series)
        result = task(number, reports.add)
    return [*reports.records, result]


def _task_of(series: str) -> Task:
    """Return the task of a series, prepared in this thread if it is not; raises NotJoined."""
    state = _thread_state
    if state.task is None or state.series != series:
        if series not in _prepared:
            raise NotJoined(series)
        state.limits = limit_blas(1)  # the worker's threads are what runs side by side
        state.task = cloudpickle.loads(_prepared[series])()
        state.series = series
    task: Task = state.task
    return task
