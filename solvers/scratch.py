"""Scratch folders of external solvers: fresh for every run, in memory where there is room.

One under way holds a file locked by its process, whose number it names: the folders of killed
processes are found and removed. A folder without that file is kept for inspection.
"""

import atexit
import functools
import logging
import os
import platform
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import OutputError, SolverFailure
from ..lazy_modules import filelock, psutil
from .process import log_tail

log = logging.getLogger(__name__)

#: A file system in memory, on Linux; elsewhere runs go to the disk.
MEMORY = Path("/dev/shm")
#: Free space (bytes) below which runs go to the disk instead; a bubble takes about 2 MB.
ROOM = 256 * 1024**2
OWNER = ".owner"
PATTERN = "bubblefit-*-*"
#: s; a folder that is younger may be about to get its owner.
YOUNG = 60.0
_BOOT = Path("/proc/sys/kernel/random/boot_id")
_INTERRUPTIONS = (signal.SIGINT, signal.SIGTERM)
#: Folders of runs under way with their locks. An interruption can fall between any two lines, also
#: within the removal of a folder: the rest is removed at the end of the process, and after a kill
#: by the next one's sweep.
_under_way: dict[Path, int | None] = {}


def fresh_folder(name: str, parent: Path | None = None) -> Path:
    """Make an empty folder `bubblefit-NAME-...` below `parent` (default: memory, else disk)."""
    place = default_parent() if parent is None else parent
    try:
        place.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"bubblefit-{name}-", dir=place))
    except OSError as error:
        problem = f"no scratch folder can be made: {error.strerror}; choose another"
        raise OutputError(f"{place}: {problem}") from None


@contextmanager
def run_folder(
    name: str,
    parent: Path | None,
    keep: bool,
    solver: str,
    logs: str,
) -> Iterator[Path]:
    """Make the folder of one run: removed after a good end unless `keep`, kept after a failure.

    Parameters
    ----------
    name : str
        Part of the folder's name.
    parent : Path or None
        Where it is made; in memory, else on disk, if it is None.
    keep : bool
    solver : str
        Name of the solver, for messages.
    logs : str
        Name, in the folder, of the log whose tail a failure carries.

    Raises
    ------
    SolverFailure
        That of the run.
    OutputError
        The folder cannot be made.
    """
    with _undisturbed():
        folder = fresh_folder(name, parent)
        _under_way[folder] = claim(folder)
    log.info("%s runs in %s", solver, folder)
    try:
        yield folder
    except SolverFailure as failure:
        kept_folder = put_aside(folder)
        log.info("failed run kept in %s", kept_folder)
        tail = failure.log_tail or log_tail(kept_folder / logs)
        kind = type(failure)
        raise kind(failure.reason, solver, failure.exit_number, tail, kept_folder) from None
    except BaseException:
        remove(folder)  # interrupted, or never begun: there is nothing to inspect
        raise
    if keep:
        release(folder, _under_way.pop(folder, None))
        log.info("run kept in %s", folder)
    else:
        remove(folder)


def write_deck(folder: Path, files: Mapping[str, str | bytes | None]) -> None:
    """Write a run's input files, those that there are; SolverFailure where that cannot be."""
    try:
        for name, text in files.items():
            if isinstance(text, str):
                text = text.encode("ascii", errors="replace")
            if text is not None:
                (folder / name).write_bytes(text)
    except OSError as error:
        raise SolverFailure(f"the deck cannot be written: {error.strerror}") from None


def default_parent() -> Path:
    """Return memory when it has room, else the system's temporary folder."""
    with suppress(OSError):
        if os.access(MEMORY, os.W_OK | os.X_OK) and shutil.disk_usage(MEMORY).free > ROOM:
            return MEMORY
    return Path(tempfile.gettempdir())


def put_aside(folder: Path) -> Path:
    """Move a failed run out of memory onto the disk, unless that is full; return its place."""
    lock = _under_way.pop(folder, None)
    claim_file = None
    kept_folder = folder
    if folder.parent == MEMORY:
        target = Path(tempfile.gettempdir()) / folder.name
        try:
            target.mkdir(mode=0o700)
            claim_file = claim(target)  # a copy that is cut off can be swept
            leave = shutil.ignore_patterns(OWNER)
            shutil.copytree(folder, target, ignore=leave, dirs_exist_ok=True)
            kept_folder = target
        except (OSError, shutil.Error):
            clear(target)
        release(target, claim_file)
        if kept_folder is target:
            clear(folder)
    release(folder, lock)
    return kept_folder


def remove(folder: Path) -> None:
    """Remove a scratch folder with its content."""
    clear(folder)
    release(folder, _under_way.pop(folder, None))


def sweep_left(place: Path | None = None) -> None:
    """Remove the folders of runs whose process was killed, in the usual places and in `place`."""
    usual = [MEMORY, Path(tempfile.gettempdir())]
    sweep(usual if place is None else [*usual, place])


@atexit.register
def remove_interrupted() -> None:
    """Remove the folders of runs under way; for a process that ends without its exit."""
    for folder in tuple(_under_way):
        remove(folder)


def _forget_parent() -> None:
    # A copy of the parent's lock would hold it where the parent is killed.
    for lock in _under_way.values():
        if lock is not None:
            os.close(lock)
    _under_way.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_parent)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Delay interruptions of the main thread; a mask would give them to another thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handlers = {n: signal.signal(n, lambda number, _: came.append(number)) for n in _INTERRUPTIONS}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            # None: whoever set it was no Python, and cannot be set again.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if came:
            signal.raise_signal(came[0])


def claim(folder: Path) -> int | None:
    """Lock a folder for this process; return the lock, to be closed later. None: no room."""
    number = None
    try:
        number = os.open(folder / OWNER, os.O_RDWR | os.O_CREAT, 0o600)
        with suppress(OSError):  # a file system without locks: the process's number will do
            filelock.lock_descriptor(number, blocking=False)
        os.write(number, "\n".join(owner_marks()).encode())
    except OSError as error:
        log.info("%s: its owner cannot be written: %s", folder, error.strerror)
    return number


def release(folder: Path, lock: int | None) -> None:
    """Remove the owner of a folder that is kept."""
    with suppress(OSError):
        (folder / OWNER).unlink(missing_ok=True)
    if lock is not None:
        os.close(lock)


def clear(folder: Path) -> None:
    """Remove a folder with its content, the owner last: a removal that is cut off can be swept."""
    with suppress(OSError):
        for path in folder.iterdir():
            if path.name == OWNER:
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
    shutil.rmtree(folder, ignore_errors=True)


def sweep(places: Iterable[Path]) -> list[Path]:
    """Remove and return the folders that dead processes of this user and machine left there."""
    abandoned = []
    for place in dict.fromkeys(places):
        with suppress(OSError):
            for folder in place.glob(PATTERN):
                if _left(folder):
                    clear(folder)
                    abandoned.append(folder)
    for folder in abandoned:
        log.info("%s was left by a process that is gone, and is removed", folder)
    return abandoned


def _left(folder: Path) -> bool:
    """Return whether the process of a folder is gone."""
    try:
        about = folder.lstat()
        ours = not hasattr(os, "getuid") or about.st_uid == os.getuid()
        if folder.is_symlink() or not folder.is_dir() or not ours:
            return False
        old = time.time() - about.st_mtime > YOUNG
        number = os.open(folder / OWNER, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    except FileNotFoundError:
        # Killed before it had an owner, or at the very end of its removal.
        return old and folder.is_dir() and not any(folder.iterdir())
    except OSError:
        return False
    try:
        with suppress(OSError):  # no locks here
            if not filelock.lock_descriptor(number, blocking=False):
                return False
        owner = os.read(number, 1000).decode(errors="replace").split("\n")
    finally:
        os.close(number)
    if len(owner) != len(owner_marks()):
        return old  # cut off as it was written
    return owner_is_gone(owner)


def owner_is_gone(marks: Sequence[str]) -> bool:
    """Return whether the process of which these are the `owner_marks` has ended."""
    if len(marks) != len(owner_marks()):
        return True
    (machine, boot, process, started), this_process = marks, owner_marks()
    if boot != this_process[1]:
        return machine == this_process[0]  # before a restart; or of another machine
    return not (process.isdigit() and started == _started(int(process)))


def owner_marks() -> tuple[str, str, str, str]:
    """Return the machine, its boot, the process, and when that started."""
    return platform.node(), _boot(), str(os.getpid()), _started(os.getpid())


@functools.cache
def _boot() -> str:
    try:
        return _BOOT.read_text().strip()
    except OSError:
        return str(psutil.boot_time())


def _started(process: int) -> str:
    """Return a mark of a process, not of a later one of the same number; "gone" without one."""
    with suppress(OSError, IndexError):
        # Ticks since the boot, after the program's name, which may hold anything.
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[19]
    try:
        return str(psutil.Process(process).create_time())
    except psutil.NoSuchProcess:
        return "gone"
    except psutil.Error:  # of somebody else
        return "there"
