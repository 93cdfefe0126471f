"""What a worker of a Dask cluster does: it gets tasks ready once, and does them by number."""

from __future__ import annotations

import functools
import hashlib
import platform
import threading
from collections import OrderedDict
from pathlib import Path
from typing import Any

from ..files import __version__
from ..solvers.base import Announcement, hearing
from ..solvers.decks import CODE, file_mark
from ..solvers.process import Unwanted, unless

ROOT = Path(__file__).resolve().parents[1]
#: Series of tasks that a worker keeps ready; who runs one has one or two at a time.
MOST = 4
_prepared: OrderedDict[str, bytes] = OrderedDict()
_ready = threading.local()


@functools.cache
def version() -> tuple[str, str, str]:
    """Of Python, of bubblefit, and of its code by content: results of others may be others."""
    return platform.python_version(), __version__, _code()


def _code() -> str:
    """SHA-256 of every module and template of the package, not of tests and documents beside it."""
    files = [*ROOT.glob("*.py")]
    for room in ROOT.iterdir():
        if room.name == "templates" or (room / "__init__.py").exists():
            files += [path for path in room.rglob("*") if path.suffix in CODE]
    named = {path.relative_to(ROOT).as_posix(): path for path in files}
    marks = [(name, file_mark(named[name])) for name in sorted(named)
             if name.split("/")[0] not in ("tests", "setup.py")]  # fmt: skip
    return hashlib.sha256(repr(marks).encode()).hexdigest()


def join(series: str, prepare: bytes, wanted: tuple[str, str, str]) -> tuple[str, str, str]:
    """Take what prepares a series of tasks, if this is the version that is wanted; which it is."""
    if version() == wanted:
        _prepared[series] = prepare
        while len(_prepared) > MOST:
            _prepared.popitem(last=False)
    return version()


class NotJoined(Exception):
    """A worker that came again under its address, without what it was given before."""


def work(series: str, number: int, topic: str) -> list[Any]:
    """Do the task of a number: everything that it told, and last what it gives.

    Raises
    ------
    NotJoined : the worker knows nothing of the series. Unwanted : the task was cancelled.
    """
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
    """What does the tasks of a series; made once in every thread, as solvers keep things."""
    ready: dict[str, Any] | None = getattr(_ready, "tasks", None)
    if ready is None or series not in ready:
        import cloudpickle
        from threadpoolctl import threadpool_limits

        if series not in _prepared:
            raise NotJoined(series)
        _ready.limits = threadpool_limits(1)  # the worker's threads are what runs side by side
        _ready.tasks = ready = {series: cloudpickle.loads(_prepared[series])()}
    return ready[series]
