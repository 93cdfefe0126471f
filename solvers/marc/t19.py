"""Marc's formatted post file (.t19), read to its last mark.

Blocks between `=beg=NNNNN (name)` and `=end=`; fields of 13 columns, six a line, each record on
lines of its own; the model first, then an increment between `****` and `----`, again and again,
and `++++` at the end. A file that does not hold what its blocks announce, or stops before its end
mark, is refused: a job that was killed leaves such a file. Layout: docs/marc-deck.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

Array = NDArray[np.float64]
WIDTH, PER_LINE, NAME = 13, 6, 48
#: A Fortran number whose exponent of three digits has pushed the E out: 0.123456-100.
_SQUEEZED = re.compile(rb"(?<=[0-9])([+-][0-9]{3})(?=\s*$)")
_BEGIN = re.compile(r"=beg=(\d{3})(\d{2})\b")


@dataclass(frozen=True, eq=False)
class T19Mesh:
    """numbers (n,) and points (n, 3) of the nodes; per element its type and node numbers."""

    numbers: NDArray[np.int64]
    points: Array
    elements: tuple[tuple[int, NDArray[np.int64]], ...]


@dataclass(eq=False)
class T19Frame:
    """One increment: total time, its number, and vectors by name (nodes of the mesh, c)."""

    time: float = 0.0
    increment: int = 0
    fields: dict[str, Array] = field(default_factory=dict)


class T19File:
    """A post file, checked as it is read: `mesh`, then `frames()` one by one.

    Raises
    ------
    InputError : no such file, not a formatted post file, truncated or corrupt (which line).
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        try:
            self._lines = self.path.read_bytes().split(b"\n")
        except OSError as error:
            raise InputError(self.path, "", f"cannot be read: {error.strerror}") from None
        if not self._lines[0].startswith(b"=beg=501"):
            problem = "is not a formatted post file of Marc (no =beg=501 at its start)"
            raise InputError(self.path, "", problem)
        self._at = 0
        self.mesh = self._model()
        self._first = self._at

    def frames(self) -> Iterator[T19Frame]:
        """Every increment, in the file's order."""
        self._at = self._first
        while True:
            mark = self._line()
            if mark == "++++":
                return
            if mark != "****":
                raise self._wrong(f"expected **** or ++++, got {mark[:20]!r}")
            yield self._frame()

    def _model(self) -> T19Mesh:
        numbers, points = np.empty(0, np.int64), np.empty((0, 3))
        elements: list[tuple[int, NDArray[np.int64]]] = []
        header = [0] * 30
        while self._peek() not in ("****", "++++"):
            kind, _ = self._begin()
            if kind == 502:
                header = [*self._integers_to_end(), *header][:30]
            elif kind == 507:
                elements = [self._element(header[9]) for _ in range(header[2])]
            elif kind == 508:
                numbers, points = self._points(header[1], header[8])
            else:
                self._skip()
            self._end()
        if not len(numbers):
            raise self._wrong("no nodes (block 508) before the first increment")
        return T19Mesh(numbers, points, tuple(elements))

    def _frame(self) -> T19Frame:
        frame, timed = T19Frame(), False
        while self._peek() != "----":
            if self._peek() in ("****", "++++"):
                raise self._wrong("an increment without its end (----): truncated")
            kind, version = self._begin()
            if kind == 517:
                numbers = self._integers_to_end()
                if len(numbers) < 12:
                    raise self._wrong("a block 517 of fewer than 12 numbers")
                remeshed, frame.increment = numbers[:2]
                if remeshed:
                    raise self._wrong("an increment with a new mesh; switch remeshing off")
            elif kind == 518:
                # In later versions a count goes before the numbers.
                count = self._integers(1)[0] if version else 1
                if count < 1:
                    raise self._wrong("an increment without its time")
                frame.time, timed = float(self._reals(count if version else 6)[0]), True
            elif kind == 524:
                self._vectors(frame)
            else:
                self._skip()
            self._end()
        self._line()
        if not timed:
            raise self._wrong("an increment without its time (block 518)")
        return frame

    def _vectors(self, frame: T19Frame) -> None:
        for _ in range(self._integers(2)[0]):
            name = self._line()[:NAME].strip()
            numbers = self._integers(12)
            if numbers[6] != -1:
                continue
            components = max(numbers[3], 1)
            values = self._reals(len(self.mesh.numbers) * components)
            frame.fields[name] = values.reshape(-1, components)

    def _element(self, most: int) -> tuple[int, NDArray[np.int64]]:
        record = self._integers(3 + most)
        if not 1 <= record[2] <= most:
            raise self._wrong(f"an element of {record[2]} nodes")
        return record[1], np.array(record[3 : 3 + record[2]], dtype=np.int64)

    def _points(self, count: int, coordinates: int) -> tuple[NDArray[np.int64], Array]:
        if not (0 < count <= len(self._lines) and 1 <= coordinates <= 5):
            raise self._wrong(f"{count} nodes of {coordinates} coordinates")
        rows = [self._raw() for _ in range(count)]
        numbers = self._parse([row[:WIDTH] for row in rows], count, int)
        width = min(coordinates, 3)
        # Blanks after the coordinates are fields of ours no more.
        places = [row[WIDTH : WIDTH * (1 + coordinates)] for row in rows]
        values = self._parse(places, count * coordinates, float).reshape(count, coordinates)
        if not (np.diff(numbers) > 0).all():
            raise self._wrong("node numbers do not increase")
        return numbers.astype(np.int64), np.pad(values[:, :width], ((0, 0), (0, 3 - width)))

    def _integers(self, count: int) -> list[int]:
        return self._parse(self._records(count), count, int).tolist()

    def _reals(self, count: int) -> Array:
        return self._parse(self._records(count), count, float)

    def _records(self, count: int) -> list[bytes]:
        lines = -(-count // PER_LINE)
        if count < 0 or self._at + lines > len(self._lines):
            raise self._wrong("the file ends in the middle of a block: truncated")
        return [self._raw() for _ in range(lines)]

    def _integers_to_end(self) -> list[int]:
        """All numbers of a block of whole numbers only."""
        first = self._at
        while not self._lines[self._at].startswith(b"=end="):
            self._raw()
            if self._at >= len(self._lines):
                raise self._wrong("the file ends in the middle of a block: truncated")
        rows = [row.rstrip() for row in self._lines[first : self._at]]
        return self._parse(rows, sum(-(-len(row) // WIDTH) for row in rows), int).tolist()

    def _parse(self, rows: list[bytes], count: int, kind: type) -> NDArray:
        text = b"".join(row.rstrip() for row in rows)
        if len(text) != WIDTH * count:
            raise self._wrong("a data line that is too short or too long")
        fields = np.frombuffer(text, f"S{WIDTH}")
        try:
            values: NDArray = fields.astype(kind)
        except ValueError:
            try:
                mended = [_SQUEEZED.sub(rb"E\1", f) for f in fields.tolist()]
                values = np.array(mended, dtype=bytes).astype(kind)
            except ValueError as error:
                raise self._wrong(str(error)) from None
        if kind is float and not np.isfinite(values).all():
            raise self._wrong("a value that is not a finite number")
        return values

    def _begin(self) -> tuple[int, int]:
        """Number and version of the block that begins here."""
        found = _BEGIN.match(self._line())
        if found is None:
            raise self._wrong("expected the beginning of a block (=beg=)")
        return int(found[1]), int(found[2])

    def _skip(self) -> None:
        """To the end of a block that is of no interest."""
        while (line := self._peek()) != "=end=":
            if line.startswith(("=beg=", "****", "----", "++++")):
                raise self._wrong("a block without its end (=end=): truncated")
            self._at += 1

    def _end(self) -> None:
        if self._line() != "=end=":
            raise self._wrong("a block longer than announced, or without its end (=end=)")

    def _peek(self) -> str:
        if self._at >= len(self._lines) - 1:
            raise self._wrong("the file ends before its end mark (++++): truncated")
        return self._lines[self._at].decode("latin-1").rstrip()

    def _line(self) -> str:
        line = self._peek()
        self._at += 1
        return line

    def _raw(self) -> bytes:
        # The last piece has no line end after it: it may be half a line.
        if self._at >= len(self._lines) - 1:
            raise self._wrong("the file ends in the middle of a block: truncated")
        self._at += 1
        return self._lines[self._at - 1]

    def _wrong(self, problem: str) -> InputError:
        return InputError(self.path, f"line {self._at}", problem)
