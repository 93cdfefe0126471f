"""Files of a test: its measured data with checksums, and what a run writes for it."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from pathlib import Path

import numpy as np

from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from ..notes import NoteKind
from ..readers.frames import Array, FrameSource
from ..storage.reading import checksum
from ..storage.writing import replacing, write_csv

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
    used_count : int or None
        Number of rows that are used; None where that means nothing.
    dropped : mapping of str to int
        Number of rows that are not used, by reason.
    arrays : sequence of array
        The data where they are in memory, otherwise empty.
    """

    path: Path
    source: FrameSource
    used_count: int | None
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
        counts = [count for count in (file.used_count, part.used_count) if count is not None]
        used_count = sum(counts) if counts else None
        arrays = (*file.arrays, *part.arrays)
        files[part.path] = DataFile(part.path, file.source, used_count, dict(dropped), arrays)
    return list(files.values())


#: The name of a file below the output folder, and its caption or description.
CaptionedFile = tuple[str, str]


@dataclass(frozen=True)
class Output:
    """The place where a test writes: files below `folder`, whose names begin with `prefix`."""

    folder: Path
    prefix: str = ""

    @classmethod
    def of(cls, folder: Path, test: str, several: bool) -> Output:
        """Return the output of a test; with several tests, its name begins that of every file.

        Characters that do not belong in the name of a file become dashes; six digits of a checksum
        keep such names apart.

        Parameters
        ----------
        test : str
            Name of the test.
        """
        max_bytes = 80
        plain = "".join(c if c.isalnum() or c in "._" else "-" for c in test)
        plain = plain.encode()[:max_bytes].decode(errors="ignore").strip("-.")
        if plain != test.replace(" ", "-"):
            plain = f"{plain}-{hashlib.sha256(test.encode()).hexdigest()[:6]}".strip("-")
        return cls(folder, f"{plain}-" if several else "")

    def name(self, file: str) -> str:
        """Return the name of a file below the folder, with the prefix."""
        return self.prefix + file

    def path(self, file: str) -> Path:
        """Return the path of a file, with the prefix."""
        return self.folder / self.name(file)

    def write(
        self,
        file: str,
        table: pd.DataFrame,
        description: str = "",
        digits: int | None = 9,
    ) -> CaptionedFile:
        """Write a table as CSV; return the name of the file and its description.

        Parameters
        ----------
        digits : int or None
            Of numbers; None writes all.
        """
        with replacing(self.path(file)) as path:
            write_csv(table, path, digits)
        return self.name(file), description
