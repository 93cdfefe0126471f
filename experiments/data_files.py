"""Measured files of a test, for the record of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..notes import Note, NoteKind
from ..readers.frames import FrameSource

READING = NoteKind("how a file was read")


@dataclass(frozen=True, eq=False)
class DataFile:
    """A measured file and the number of its rows that are used.
    source : its format, columns and units, and choices where it leaves any. used : number of rows,
    None where that means nothing. dropped : number of other rows, by why."""

    path: Path
    source: FrameSource
    used: int | None
    dropped: Mapping[str, int] = field(default_factory=dict)


def data_notes(test: object) -> tuple[Note, ...]:
    """Return what a test with its data, read or prepared, says of these data; most say nothing."""
    return tuple(getattr(test, "data_notes", ()))


def files_of(test: object) -> tuple[DataFile, ...]:
    """Return the measured files of a prepared or predicted test, its `data_files()` if it has any.
    These are in their order; none where data are computed."""
    return tuple(getattr(test, "data_files", tuple)())


def joined(parts: Iterable[DataFile]) -> list[DataFile]:
    """Return one entry a file, in the order of their first part: rows are added up."""
    files: dict[Path, DataFile] = {}
    for part in parts:
        one = files.get(part.path, DataFile(part.path, part.source, None))
        dropped = Counter(one.dropped) + Counter(part.dropped)
        used = (one.used or 0) + (part.used or 0)
        files[part.path] = DataFile(part.path, one.source, used, dict(dropped))
    return list(files.values())
