"""Whose a scratch folder is: of a process that lives, or of one that was killed and left it.

A folder of a run under way holds a file that names the machine, its boot and the process, and that
this process has locked for as long as it lives. A folder without that file is nobody's: a run that
is kept to be looked into.
"""

from __future__ import annotations

import fcntl
import functools
import logging
import os
import platform
import shutil
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

log = logging.getLogger(__name__)

OWNER, PATTERN = ".owner", "bubblefit-*-*"
#: s; a folder that is younger may be about to get its owner.
YOUNG = 60.0
_BOOT = Path("/proc/sys/kernel/random/boot_id")


def claim(folder: Path) -> int | None:
    """Make the folder this process's; the lock, to be closed when it is no more. None: no room."""
    number = None
    try:
        number = os.open(folder / OWNER, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        with suppress(OSError):  # a file system without locks: the process's number will do
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.write(number, "\n".join(_self()).encode())
    except OSError as error:
        log.info("%s: its owner cannot be written: %s", folder, error.strerror)
    return number


def release(folder: Path, lock: int | None) -> None:
    """Make the folder nobody's, and stay."""
    with suppress(OSError):
        (folder / OWNER).unlink(missing_ok=True)
    if lock is not None:
        os.close(lock)


def clear(folder: Path) -> None:
    """Remove a folder with what is in it, its owner last: what is cut off is still somebody's."""
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
    """Remove what processes that are gone have left in these places; which folders.

    Never a folder whose process lives, or that another machine may use, or of another user; nor
    one that is kept.
    """
    gone = []
    for place in dict.fromkeys(places):
        with suppress(OSError):
            for folder in place.glob(PATTERN):
                if _left(folder):
                    clear(folder)
                    gone.append(folder)
    for folder in gone:
        log.info("%s was left by a process that is gone, and is removed", folder)
    return gone


def _left(folder: Path) -> bool:
    """Whether nobody has a folder any more."""
    try:
        about = folder.lstat()
        if folder.is_symlink() or not folder.is_dir() or about.st_uid != os.getuid():
            return False
        old = time.time() - about.st_mtime > YOUNG
        number = os.open(folder / OWNER, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
    except FileNotFoundError:
        # Killed before it was anybody's, or at the very end of its removal.
        return old and folder.is_dir() and not any(folder.iterdir())
    except OSError:
        return False
    try:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            pass  # no locks here
        said = os.read(number, 1000).decode(errors="replace").split("\n")
    finally:
        os.close(number)
    if len(said) != len(_self()):
        return old  # cut off as it was written
    (machine, boot, process, started), own = said, _self()
    if boot != own[1]:
        return machine == own[0]  # before a restart; or of another machine
    return not (process.isdigit() and started == _started(int(process)))


def _self() -> tuple[str, str, str, str]:
    """Machine, its boot, process, when that started."""
    return platform.node(), _boot(), str(os.getpid()), _started(os.getpid())


@functools.cache
def _boot() -> str:
    with suppress(OSError):
        return _BOOT.read_text().strip()
    return ""


def _started(process: int) -> str:
    """What tells a process from a later one of the same number; "gone" where there is none."""
    try:
        # After the program's name, which may hold anything; the 20th is ticks since the boot.
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        pass
    if Path("/proc/self/stat").exists():
        return "gone"
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return "gone"
    except OSError:
        pass
    return "there"
