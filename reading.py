"""Files read with suspicion: regular ones only, and no larger than is meant."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

from .errors import InputError

#: Bytes of a file at most: of one that is read whole into memory, and of one that people write.
LARGEST, LARGEST_WRITTEN = 2**30, 2**24
PIECE = 2**22
#: Parts of a dotted key.
MOST_PARTS = 100


def content_of(path: Path | str, most: int = LARGEST) -> bytes:
    """The whole of a regular file; links to one are followed.

    most : bytes; what is larger is not read at all.

    Raises
    ------
    InputError : a device, a pipe, a name with a NUL in it, a file that is too large.
    OSError : no such file, no permission, a folder.
    """
    check_regular(path)
    # Should a pipe have taken its place by now: opening it does not wait for who writes into it.
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
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
    """What a TOML file says.

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
    """Whether there is a regular file of this name, however long or odd a name it is."""
    return os.path.isfile(path)  # Path.is_file raises an OSError where the name is too long


def check_regular(path: Path | str) -> None:
    """That a path does not lead to a device or a pipe, which may never end.

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
