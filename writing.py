"""Write files that are there whole or not at all."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from .errors import InputError, OutputError


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside `path` that takes its place when the block ends well.

    The parent folder is made. A reader sees the old file or the new one, never half of one.

    Raises
    ------
    OutputError : the folder cannot be written or the disk is full.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    with telling(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            yield temporary
            os.replace(temporary, path)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def write_text(path: Path | str, text: str) -> None:
    """Write a file whole, in UTF-8, and see that it has reached the disk.

    Raises
    ------
    OutputError : as `replacing`.
    """
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())


def remove_cut(folder: Path | str) -> None:
    """Remove what processes that are gone have begun to write by `replacing` in a folder."""
    for path in Path(folder).glob(".*"):
        found = re.fullmatch(r"\..*\.(\d+)(\.[^.]*)?", path.name)
        if found is not None and path.is_file() and not _lives(int(found[1])):
            with suppress(OSError):
                path.unlink()


def _lives(process: int) -> bool:
    with suppress(OverflowError):
        return psutil.pid_exists(process)
    return False


def checksum(path: Path | str) -> str:
    """SHA-256 of a file's content, in hexadecimal digits.

    Raises
    ------
    InputError : it cannot be read.
    """
    try:
        with open(path, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None


@contextmanager
def telling(path: Path | str) -> Iterator[None]:
    """Turn an OSError within the block into one line about `path`.

    Raises
    ------
    OutputError : instead of the OSError.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        problem = f"cannot be written: {reason}; free space or choose another --out"
        raise OutputError(f"{path}: {problem}") from error
