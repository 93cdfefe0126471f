"""Safe reading of files of unknown origin: regular files only, up to a size, without waiting."""

from __future__ import annotations

import hashlib
import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import InputError

#: Largest size in bytes of data files, which are read into memory, and of files written by hand.
MAX_DATA_SIZE = 2**30
MAX_TEXT_SIZE = 2**24
_IS_FOLDER = "is a folder; name a file in it"


def read_bytes(path: Path | str, max_size: int = MAX_DATA_SIZE) -> bytes:
    """Read a regular file to its end.

    Parameters
    ----------
    path : path
        The file.
    max_size : int, bytes
        Size beyond which it is refused.

    Returns
    -------
    bytes
        Its content.

    Raises
    ------
    InputError
        A folder, a device, a pipe, or a file that is too large.
    OSError
        The file cannot be read.
    """
    mebibytes = max_size // 2**20
    too_large = InputError(path, "", f"has more than {mebibytes} MiB; is it the right file?")
    check_regular(path)
    if os.path.isdir(path):
        raise InputError(path, "", _IS_FOLDER)
    with open(path, "rb", opener=_open_without_waiting) as file:
        if os.fstat(file.fileno()).st_size > max_size:
            raise too_large
        # It is read in pieces, as files of /proc report a size of 0 and may be too large.
        pieces = []
        size = 0
        while piece := file.read(2**22):
            pieces.append(piece)
            size += len(piece)
            if size > max_size:
                raise too_large
    return b"".join(pieces)


def _open_without_waiting(name: str, flags: int) -> int:
    """Open a file, or a pipe that took its place without waiting for the pipe's writer."""
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))


@contextmanager
def input_errors(path: Path | str, field: str = "") -> Iterator[None]:
    """Turn an OSError within the block into an InputError about `path` and `field`."""
    try:
        yield
    except OSError as error:
        raise InputError(path, field, f"cannot be read: {error.strerror}") from None


def read_toml(path: Path, field: str = "", *, max_key_parts: int = 100) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : path
        The file.
    field : str
        Key of the project file that names this file; an error of reading states it.
    max_key_parts : int
        Largest number of parts of a dotted key (or of a text with points) that is parsed.

    Returns
    -------
    dict
        Its tables.

    Raises
    ------
    InputError
        The file cannot be read, or is no TOML.
    """
    try:
        with input_errors(path, field):
            text = read_bytes(path, MAX_TEXT_SIZE).decode("utf-8-sig")
        # A key of n parts costs tomllib n squared, in time and memory.
        without_blanks = text.replace(" ", "").replace("\t", "")
        words = re.split(r"[^\w.\"'-]", without_blanks)
        if any(word.count(".") > max_key_parts for word in words):
            problem = f"a key, or a text, of more than {max_key_parts} parts with points between"
            raise ValueError(problem)
        return tomllib.loads(text)
    except UnicodeDecodeError:
        raise InputError(path, field, "is not a text file in UTF-8") from None
    except (ValueError, RecursionError) as error:  # beside its own, tomllib lets these through
        repeated = re.match(r"Cannot declare \('(\w+)',", str(error))
        advice = f"; several tables of one name are written [[{repeated[1]}]]" if repeated else ""
        raise InputError(path, "TOML syntax", f"{error}{advice}") from None


def is_file(path: Path) -> bool:
    """Return whether there is a regular file of this name, however odd or long the name is."""
    return os.path.isfile(path)  # Path.is_file raises an OSError where the name is too long


def missing_file_reason(path: Path | str) -> str:
    """Return why a name is not that of a file: nothing is there, or a folder."""
    if os.path.isdir(path):
        return f"{path} {_IS_FOLDER}"
    return f"there is no file {path}"


def check_regular(path: Path | str) -> None:
    """Raise InputError for a device, a pipe, or a name that no file can have; or OSError."""
    try:
        mode = os.stat(path).st_mode
    except ValueError:
        escaped = str(path).replace("\0", "\\0")
        raise InputError(escaped, "", "no file can have such a name") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(path, "", "is no regular file but a device or a pipe; copy it into a file")


def checksum(path: Path | str) -> str:
    """Return the SHA-256 of a file's content in hexadecimal digits; InputError if unreadable."""
    with input_errors(path), open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
