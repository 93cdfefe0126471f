"""Records of a study under a mark of all that they depend on, so that no fit is made twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from ..fits.store import Store

T = TypeVar("T")


def begin_study(
    folder: Path,
    parts: Mapping[str, str],
    resume: bool,
    overwrite: bool,
    fits: Iterable[str],
    records: Sequence[str] = (),
) -> None:
    """Make the folder of a study ready, of whose fits each has a folder of its own in it.

    Where all is replaced, nothing of earlier fits is left that an interrupted study would go on
    with.

    Raises
    ------
    OutputError, InputError : as `Store.begin`.
    """
    for name in fits if overwrite else ():
        Store(folder / name).forget()
    Store(folder).begin(parts, resume, overwrite, records)


def mark_of(parts: Mapping[str, Any]) -> str:
    """Of everything that a record depends on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read_marked(path: Path, mark: str, read: Callable[[dict[str, Any]], T]) -> T | None:
    """What `read` makes of a record; None where it is of something else, or no record at all."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return read(content) if content["of"] == mark else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_marked(folder: Path, file: str, mark: str, content: Mapping[str, Any]) -> None:
    """Write a record into a folder that is there; raises OutputError."""
    Store(folder).write(file, json.dumps({"of": mark, **content}, indent=1) + "\n")
