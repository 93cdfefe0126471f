"""Read untrusted files: regular ones only, no larger than is meant, and within a time limit."""

from __future__ import annotations

import multiprocessing
import os
import re
import stat
import sys
import tomllib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from .errors import InputError

#: Bytes of a file at most: of one that is read whole into memory, and of one that people write.
LARGEST, LARGEST_WRITTEN = 2**30, 2**24
PIECE = 2**22
#: Opening a pipe does not wait for whoever writes into it; nothing where there is no such flag.
NO_WAIT = getattr(os, "O_NONBLOCK", 0)
#: Parts of a dotted key.
MOST_PARTS = 100


def content_of(path: Path | str, most: int = LARGEST) -> bytes:
    """Read the whole of a regular file; links to one are followed.

    most : bytes; what is larger is not read at all.

    Raises
    ------
    InputError : a device, a pipe, a name with a NUL in it, a file that is too large.
    OSError : no such file, no permission, a folder.
    """
    check_regular(path)
    # A pipe may have taken its place by now.
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | NO_WAIT)) as file:
        if os.fstat(file.fileno()).st_size > most:
            raise _too_large(path, most)
        # In pieces: a file of /proc does not say how long it is, and a buffer of the most that it
        # may be would be memory for nothing.
        pieces, size = [], 0
        while piece := file.read(PIECE):
            pieces.append(piece)
            size += len(piece)
            if size > most:
                raise _too_large(path, most)
    return b"".join(pieces)


def toml_of(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    InputError : as `content_of`. OSError : it cannot be read. UnicodeDecodeError : it is not in
        UTF-8. ValueError, RecursionError : it is not TOML.
    """
    text = content_of(path, LARGEST_WRITTEN).decode("utf-8")
    # A key of n parts costs tomllib n squared, in time and memory.
    plain = text.replace(" ", "").replace("\t", "")
    if any(part.count(".") > MOST_PARTS for part in re.split(r"[^\w.\"'-]", plain)):
        raise ValueError(f"a key, or a text, of more than {MOST_PARTS} parts with points between")
    return tomllib.loads(text)


def is_file(path: Path) -> bool:
    """Return whether there is a regular file of this name, however odd a name it is."""
    return os.path.isfile(path)  # Path.is_file raises an OSError where the name is too long


def check_regular(path: Path | str) -> None:
    """Check that a path does not lead to a device or a pipe, which may never end.

    Raises
    ------
    InputError : it does, or no file can have such a name. OSError : there is no such file.
    """
    try:
        mode = os.stat(path).st_mode
    except ValueError:
        shown = str(path).replace("\0", "\\0")
        raise InputError(shown, "", "no file can have such a name") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(path, "", "is no regular file but a device or a pipe; copy it into a file")


def _too_large(path: Path | str, most: int) -> InputError:
    return InputError(path, "", f"has more than {most // 2**20} MiB; is it the right file?")


def process_context() -> Any:
    """Return the context of multiprocessing that processes are started in.

    It is the one that the program has chosen (`multiprocessing.set_start_method`). Otherwise fork
    on Linux, where compiled kernels and data are there already and no script needs a guard around
    its main part, and spawn elsewhere.
    """
    chosen = multiprocessing.get_start_method(allow_none=True)
    forks = sys.platform == "linux" and hasattr(os, "fork")
    return multiprocessing.get_context(chosen or ("fork" if forks else "spawn"))


def ends(call: Callable[[], object], seconds: float) -> bool:
    """Return whether a call ends within `seconds`, in whatever way but by a crash of its process.

    It is tried in a process of its own; what it raises is left to the caller's own call. A daemonic
    process (a worker of a cluster) may not start another, and there nothing is tried.

    call : picklable where processes are spawned.
    """
    if multiprocessing.current_process().daemon:
        return True
    process = process_context().Process(target=_quietly, args=(call,), daemon=True)
    process.start()
    process.join(seconds)
    if process.is_alive():
        process.kill()
    process.join()
    ended: bool = process.exitcode == 0
    return ended


def _quietly(call: Callable[[], object]) -> None:
    with suppress(Exception, KeyboardInterrupt):
        call()
