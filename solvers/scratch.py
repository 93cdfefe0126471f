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
from .scratch_owner import OWNER, claim, clear, release, sweep

log = logging.getLogger(__name__)

MEMORY = Path("/dev/shm")
#: Free space (bytes) below which runs go to the disk instead; a bubble takes about 2 MB.
ROOM = 256 * 1024**2
_INTERRUPTIONS = (signal.SIGINT, signal.SIGTERM)
#: Folders of runs under way. An interruption can fall between any two lines, also within the
#: removal of a folder: what it leaves is removed at the end of the process.
#: Each with the lock that says whose it is; a process that is killed outright leaves both, and the
#: next one sweeps.
_under_way: dict[Path, int | None] = {}


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
        _under_way[folder] = claim(folder)
    log.info("%s runs in %s", solver, folder)
    try:
        yield folder
    except SolverFailure as failure:
        kept = put_aside(folder)
        log.info("failed run kept in %s", kept)
        tail = failure.log_tail or log_tail(kept / logs)
        kind = type(failure)
        raise kind(failure.reason, solver, failure.exit_number, tail, kept) from None
    except BaseException:
        remove(folder)  # interrupted, or never begun: there is nothing to look into
        raise
    if keep:
        release(folder, _under_way.pop(folder, None))
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
    lock = _under_way.pop(folder, None)
    if folder.parent != MEMORY:
        release(folder, lock)
        return folder
    target = Path(tempfile.gettempdir()) / folder.name
    own = None
    try:
        target.mkdir(mode=0o700)
        own = claim(target)  # a copy that is cut off is somebody's to sweep
        shutil.copytree(folder, target, ignore=shutil.ignore_patterns(OWNER), dirs_exist_ok=True)
    except (OSError, shutil.Error):
        clear(target)
        release(target, own)
        release(folder, lock)
        return folder
    release(target, own)
    clear(folder)
    release(folder, lock)
    return target


def remove(folder: Path) -> None:
    """Remove a scratch folder with what is in it."""
    clear(folder)
    release(folder, _under_way.pop(folder, None))


def sweep_left(place: Path | None = None) -> None:
    """Remove the folders of runs whose process was killed, in the usual places and in `place`."""
    usual = [MEMORY, Path(tempfile.gettempdir())]
    sweep(usual if place is None else [*usual, place])


@atexit.register
def remove_interrupted() -> None:
    """Remove the folders of runs that were under way; for a process that ends without its exit."""
    for folder in tuple(_under_way):
        remove(folder)


def _those_of_the_parent() -> None:
    # A copy of its lock would hold it where the parent is killed.
    for lock in _under_way.values():
        if lock is not None:
            os.close(lock)
    _under_way.clear()


os.register_at_fork(after_in_child=_those_of_the_parent)


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
