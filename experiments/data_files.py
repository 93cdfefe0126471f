"""Measured files of a test, for the record of a run."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..notes import NoteKind
from ..readers.frames import Array, FrameSource
from ..storage.reading import checksum

READING = NoteKind("how a file was read")


def arrays_checksum(arrays: Iterable[Array]) -> str:
    """Return the SHA-256 of the numbers of arrays (64 bit, little-endian) in hexadecimal digits."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class DataFile:
    """A measured file, or arrays, and the number of rows that are used.

    Attributes
    ----------
    path : Path
        Of arrays the name that their file has once it is written.
    source : FrameSource
        Format, columns and units, and choices where there are any.
    used : int or None
        Number of rows; None where that means nothing.
    dropped : mapping
        Number of other rows, by reason.
    arrays : sequence of array
        The data if they are in memory.
    """

    path: Path
    source: FrameSource
    used: int | None
    dropped: Mapping[str, int] = field(default_factory=dict)
    arrays: Sequence[Array] = ()

    @property
    def sha256(self) -> str:
        """Return the checksum of the file, or of the numbers of its arrays; InputError."""
        return arrays_checksum(self.arrays) if self.arrays else checksum(self.path)


def joined(parts: Iterable[DataFile]) -> list[DataFile]:
    """Return one entry a file, in the order of their first part: rows are added up."""
    files: dict[Path, DataFile] = {}
    for part in parts:
        file = files.get(part.path, DataFile(part.path, part.source, None))
        dropped = Counter(file.dropped) + Counter(part.dropped)
        used = (file.used or 0) + (part.used or 0)
        arrays = (*file.arrays, *part.arrays)
        files[part.path] = DataFile(part.path, file.source, used, dict(dropped), arrays)
    return list(files.values())
