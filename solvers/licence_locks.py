"""Licences of one machine: as many files as there are licences, each locked by who has one.

The locks are the kernel's (flock): whoever ends, in whatever way, has given its lock back. The
program that runs inherits the open file, so that a licence is not free before it has ended too.
Users share the files: these hold nothing, and are never removed.
"""

from __future__ import annotations

import fcntl
import os
import random
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import InputError

#: One place for every user of the machine, whatever TMPDIR says.
FOLDER = Path("/tmp/bubblefit-licences")  # noqa: S108 (its files hold nothing)
#: s between two looks at the locks: at first, and at most.
SOON_S, LATER_S = 0.02, 1.0


@contextmanager
def locked(
    name: str, count: int, folder: Path | None, waiting: Callable[[], None]
) -> Iterator[int]:
    """Hold one of `count` licences of the program `name`; the number of the open file.

    Parameters
    ----------
    folder : of the files, made where it is not there; one for the machine unless given.
    waiting : called while there is none, now and then.

    Raises
    ------
    InputError : the files cannot be made or locked.
    """
    place = FOLDER if folder is None else folder
    pause = SOON_S
    while True:
        try:
            _make(place)
            file = _any(place, name, count)
        except OSError as error:
            problem = f"no licence can be counted here: {error.strerror}; name another folder"
            raise InputError(place, f"solver.{name}.licence_folder", problem) from None
        if file is not None:
            break
        waiting()
        time.sleep(pause * random.uniform(0.5, 1.5))  # noqa: S311 (no secret)
        pause = min(LATER_S, 1.5 * pause)
    try:
        yield file
    finally:
        os.close(file)


def _make(place: Path) -> None:
    """The folder; everybody's where it is the machine's own."""
    if not place.is_dir():
        with suppress(FileExistsError):
            place.mkdir(parents=True)
            if place == FOLDER:
                place.chmod(0o1777)


def _any(place: Path, name: str, count: int) -> int | None:
    """A lock on one of the files, None where all are locked."""
    for number in random.sample(range(1, count + 1), count):
        path = place / f"{name}-{number}.lock"
        file = _opened(path)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # A file that was tidied away meanwhile is another than the one of that name now.
            if os.path.samestat(os.fstat(file), os.lstat(path)):
                with suppress(OSError):
                    os.utime(file)  # files of old date are what is tidied away
                return file
        except (BlockingIOError, FileNotFoundError):
            pass
        except BaseException:
            os.close(file)
            raise
        os.close(file)
    return None


def _opened(path: Path) -> int:
    """The open file, made where it is not there.

    Not made and opened at once: of a file of another user in a folder of everybody's the kernel
    refuses that.
    """
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC
    while True:
        try:
            file = os.open(path, flags)
        except FileNotFoundError:
            with suppress(FileExistsError):
                file = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o666)
                with suppress(OSError):
                    os.fchmod(file, 0o666)  # whatever the umask
                return file
            continue
        if not stat.S_ISREG(os.fstat(file).st_mode):
            os.close(file)
            raise OSError(0, f"{path.name} is no file")
        return file
