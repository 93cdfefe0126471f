"""Scratch folders of external solvers: fresh for every run, in memory where there is room."""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import OutputError, SolverFailure
from .process import log_tail

log = logging.getLogger(__name__)

MEMORY = Path("/dev/shm")
#: Free space (bytes) below which runs go to the disk instead; a bubble takes about 2 MB.
ROOM = 256 * 1024**2
_INTERRUPTIONS = (signal.SIGINT, signal.SIGTERM)
#: Folders of runs under way. An interruption can fall between any two lines, also within the
#: removal of a folder: what it leaves is removed at the end of the process.
_under_way: set[Path] = set()
os.register_at_fork(after_in_child=_under_way.clear)  # those are the parent's


def fresh_folder(name: str, parent: Path | None = None) -> Path:
    """A new, empty folder `bubblefit-NAME-...` below `parent` (default: memory, else disk).

    Raises
    ------
    OutputError : it cannot be made.
    """
    place = default_parent() if parent is None else parent
    try:
        place.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"bubblefit-{name}-", dir=place))
    except OSError as error:
        problem = f"no scratch folder can be made: {error.strerror}; choose another"
        raise OutputError(f"{place}: {problem}") from None


@contextmanager
def run_folder(
    name: str, parent: Path | None, keep: bool, solver: str, logs: str
) -> Iterator[Path]:
    """The fresh folder of one run: removed after a good end unless `keep`, kept after a failure.

    Parameters
    ----------
    logs : name of the log in the folder whose tail a failure carries, where it has none yet.

    Raises
    ------
    SolverFailure : the one that the run raised, with the folder and the log. OutputError : as
        `fresh_folder`.
    """
    with _undisturbed():
        folder = fresh_folder(name, parent)
        _under_way.add(folder)
    log.info("%s runs in %s", solver, folder)
    try:
        yield folder
    except SolverFailure as failure:
        kept = put_aside(folder)
        _under_way.discard(folder)
        log.info("failed run kept in %s", kept)
        tail = failure.log_tail or log_tail(kept / logs)
        kind = type(failure)
        raise kind(failure.reason, solver, failure.exit_number, tail, kept) from None
    except BaseException:
        remove(folder)  # interrupted, or never begun: there is nothing to look into
        raise
    if keep:
        _under_way.discard(folder)
        log.info("run kept in %s", folder)
    else:
        remove(folder)


def default_parent() -> Path:
    """Memory when it has room, else the system's temporary folder."""
    try:
        if os.access(MEMORY, os.W_OK | os.X_OK) and shutil.disk_usage(MEMORY).free > ROOM:
            return MEMORY
    except OSError:
        pass
    return Path(tempfile.gettempdir())


def put_aside(folder: Path) -> Path:
    """Where a failed run is kept: out of memory, onto the disk (where it is, if that is full)."""
    if folder.parent != MEMORY:
        return folder
    target = Path(tempfile.gettempdir()) / folder.name
    try:
        shutil.copytree(folder, target)
    except (OSError, shutil.Error):
        shutil.rmtree(target, ignore_errors=True)
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    return target


def remove(folder: Path) -> None:
    """Remove a scratch folder with what is in it."""
    shutil.rmtree(folder, ignore_errors=True)
    _under_way.discard(folder)


@atexit.register
def remove_interrupted() -> None:
    """Remove the folders of runs that were under way; for a process that ends without its exit."""
    for folder in tuple(_under_way):
        remove(folder)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Holds interruptions off by handlers that wait; only the main thread is interrupted.

    A mask of signals would not do: another thread of the process then takes them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {n: signal.signal(n, lambda number, _: came.append(number)) for n in _INTERRUPTIONS}
    try:
        yield
    finally:
        for number, handler in before.items():
            # None: whoever set it was no Python, and cannot be set again.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if came:
            signal.raise_signal(came[0])
