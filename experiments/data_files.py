"""Measured files of a test, for the record of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..notes import NoteKind
from ..readers.frames import FrameSource

READING = NoteKind("how a file was read")


@dataclass(frozen=True, eq=False)
class DataFile:
    """A measured file and the number of its rows that are used.

    Parameters
    ----------
    path : Path
    source : FrameSource
        Its format, columns and units, and choices where it leaves any.
    used : int, optional
        Number of rows that are used; None where that means nothing.
    dropped : mapping of str to int
        Number of other rows by the reason.
    """

    path: Path
    source: FrameSource
    used: int | None
    dropped: Mapping[str, int] = field(default_factory=dict)


def joined(parts: Iterable[DataFile]) -> list[DataFile]:
    """Return one entry a file, in the order of their first part: rows are added up."""
    files: dict[Path, DataFile] = {}
    for part in parts:
        file = files.get(part.path, DataFile(part.path, part.source, None))
        dropped = Counter(file.dropped) + Counter(part.dropped)
        used = (file.used or 0) + (part.used or 0)
        files[part.path] = DataFile(part.path, file.source, used, dict(dropped))
    return list(files.values())
