"""Provenance of a test's measured files, for the record of a run: rows used and checksums."""

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
    """A measured file, or arrays in memory, and how much of it is used.

    Attributes
    ----------
    path : Path
        The file; for arrays, the name that their file has once it is written.
    source : FrameSource
        Format, columns and units that were read, and choices made while reading.
    used : int or None
        Number of rows that are used; None where that means nothing.
    dropped : mapping of str to int
        Number of rows that are not used, by reason.
    arrays : sequence of array
        The data where they are in memory, otherwise empty.
    """

    path: Path
    source: FrameSource
    used: int | None
    dropped: Mapping[str, int] = field(default_factory=dict)
    arrays: Sequence[Array] = ()

    @property
    def sha256(self) -> str:
        """Return the SHA-256 of the file, or of the numbers of its arrays, in hexadecimal digits.

        Raise InputError where the file cannot be read.
        """
        return arrays_checksum(self.arrays) if self.arrays else checksum(self.path)


def joined(parts: Iterable[DataFile]) -> list[DataFile]:
    """Join entries of the same file to one, in the order of their first: rows are added up."""
    files: dict[Path, DataFile] = {}
    for part in parts:
        file = files.get(part.path, DataFile(part.path, part.source, None))
        dropped = Counter(file.dropped) + Counter(part.dropped)
        used = (file.used or 0) + (part.used or 0)
        arrays = (*file.arrays, *part.arrays)
        files[part.path] = DataFile(part.path, file.source, used, dict(dropped), arrays)
    return list(files.values())
