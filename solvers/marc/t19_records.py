"""The lines of Marc's formatted post files: fields of 13 columns, six a line, in marked blocks."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

Array = NDArray[np.float64]
WIDTH, PER_LINE = 13, 6
#: A Fortran number whose exponent of three digits has pushed the E out: 0.123456-100.
_SQUEEZED = re.compile(rb"(?<=[0-9])([+-][0-9]{3})(?=\s*$)")
_BEGIN = re.compile(r"=beg=(\d{3})(\d{2})\b")


class Records:
    """A place in a file, and what stands there; every step is checked.

    Raises
    ------
    InputError : the file cannot be read, or ends where it must not, or holds what it must not;
        which line.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.at = path, 0
        try:
            self._lines = path.read_bytes().split(b"\n")
        except OSError as error:
            raise InputError(path, "", f"cannot be read: {error.strerror}") from None

    def __len__(self) -> int:
        return len(self._lines)

    def integers(self, count: int) -> list[int]:
        """Whole numbers that begin on a line of their own."""
        return self.parse(self._records(count), count, int).tolist()

    def reals(self, count: int) -> Array:
        """Finite numbers that begin on a line of their own, (count,)."""
        return self.parse(self._records(count), count, float)

    def _records(self, count: int) -> list[bytes]:
        lines = -(-count // PER_LINE)
        if count < 0 or self.at + lines > len(self._lines):
            raise self.wrong("the file ends in the middle of a block: truncated")
        return [self.raw() for _ in range(lines)]

    def integers_to_end(self) -> list[int]:
        """All numbers of a block of whole numbers only."""
        first = self.at
        while not self._lines[self.at].startswith(b"=end="):
            self.raw()
            if self.at >= len(self._lines):
                raise self.wrong("the file ends in the middle of a block: truncated")
        rows = [row.rstrip() for row in self._lines[first : self.at]]
        return self.parse(rows, sum(-(-len(row) // WIDTH) for row in rows), int).tolist()

    def parse(self, rows: list[bytes], count: int, kind: type) -> NDArray:
        """`count` fields in pieces of lines."""
        text = b"".join(row.rstrip() for row in rows)
        if len(text) != WIDTH * count:
            raise self.wrong("a data line that is too short or too long")
        fields = np.frombuffer(text, f"S{WIDTH}")
        try:
            values: NDArray = fields.astype(kind)
        except ValueError:
            try:
                mended = [_SQUEEZED.sub(rb"E\1", f) for f in fields.tolist()]
                values = np.array(mended, dtype=bytes).astype(kind)
            except ValueError as error:
                raise self.wrong(str(error)) from None
        if kind is float and not np.isfinite(values).all():
            raise self.wrong("a value that is not a finite number")
        return values

    def begin(self) -> tuple[int, int]:
        """Number and version of the block that begins here."""
        found = _BEGIN.match(self.line())
        if found is None:
            raise self.wrong("expected the beginning of a block (=beg=)")
        return int(found[1]), int(found[2])

    def skip(self) -> None:
        """To the end of a block that is of no interest."""
        while (line := self.peek()) != "=end=":
            if line.startswith(("=beg=", "****", "----", "++++")):
                raise self.wrong("a block without its end (=end=): truncated")
            self.at += 1

    def end(self) -> None:
        """Of a block that was read."""
        if self.line() != "=end=":
            raise self.wrong("a block longer than announced, or without its end (=end=)")

    def peek(self) -> str:
        """The line here."""
        if self.at >= len(self._lines) - 1:
            raise self.wrong("the file ends before its end mark (++++): truncated")
        return self._lines[self.at].decode("latin-1").rstrip()

    def line(self) -> str:
        """The line here, and on."""
        line = self.peek()
        self.at += 1
        return line

    def raw(self) -> bytes:
        """A data line, and on."""
        # The last piece has no line end after it: it may be half a line.
        if self.at >= len(self._lines) - 1:
            raise self.wrong("the file ends in the middle of a block: truncated")
        self.at += 1
        return self._lines[self.at - 1]

    def wrong(self, problem: str) -> InputError:
        """What to raise here."""
        return InputError(self.path, f"line {self.at}", problem)
