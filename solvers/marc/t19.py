"""Reader of Marc's formatted post file (.t19), whose layout is in docs/reference/marc-deck.md."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...storage.reading import input_errors
from ..result_files import Array, ResultFrame, ResultMesh, last_frame

#: Number of characters of a number, and of numbers on a line.
WIDTH = 13
PER_LINE = 6
#: A Fortran number whose exponent of three digits has pushed the E out: 0.123456-100.
_SQUEEZED = re.compile(rb"(?<=[0-9])([+-][0-9]{3})(?=\s*$)")
_BEGIN = re.compile(r"=beg=(\d{3})(\d{2})\b")


class Records:
    """The lines of a post file and a `position` in it, from which blocks are read and checked.

    InputError of its methods names the line.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.position = 0
        with input_errors(path):
            self._lines = path.read_bytes().split(b"\n")

    def __len__(self) -> int:
        return len(self._lines)

    def integers(self, count: int) -> list[int]:
        """Read whole numbers that begin on a line of their own."""
        return self.parse(self._records(count), count, int).tolist()

    def reals(self, count: int) -> Array:
        """Read finite numbers that begin on a line of their own, (count,)."""
        return self.parse(self._records(count), count, float)

    def _records(self, count: int) -> list[bytes]:
        """Return the lines of a block of as many numbers; an error if the file ends before."""
        lines = -(-count // PER_LINE)
        if count < 0 or self.position + lines > len(self._lines):
            raise self.wrong("the file ends in the middle of a block: truncated")
        return [self.raw() for _ in range(lines)]

    def integers_to_end(self) -> list[int]:
        """Read all numbers of a block of whole numbers only."""
        first = self.position
        while not self._lines[self.position].startswith(b"=end="):
            self.raw()
            if self.position >= len(self._lines):
                raise self.wrong("the file ends in the middle of a block: truncated")
        rows = [row.rstrip() for row in self._lines[first : self.position]]
        return self.parse(rows, sum(-(-len(row) // WIDTH) for row in rows), int).tolist()

    def parse(self, rows: list[bytes], count: int, kind: type) -> NDArray:
        """Return the `count` numbers of a kind, int or float, that pieces of lines hold."""
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
        """Return number and version of the block that begins here."""
        match = _BEGIN.match(self.line())
        if match is None:
            raise self.wrong("expected the beginning of a block (=beg=)")
        return int(match[1]), int(match[2])

    def skip(self) -> None:
        """Go to the end of a block without reading it."""
        while (line := self.peek()) != "=end=":
            if line.startswith(("=beg=", "****", "----", "++++")):
                raise self.wrong("a block without its end (=end=): truncated")
            self.position += 1

    def end(self) -> None:
        """Go past the end of a block that was read."""
        if self.line() != "=end=":
            raise self.wrong("a block longer than announced, or without its end (=end=)")

    def peek(self) -> str:
        """Return the line here."""
        if self.position >= len(self._lines) - 1:
            raise self.wrong("the file ends before its end mark (++++): truncated")
        return self._lines[self.position].decode("latin-1").rstrip()

    def line(self) -> str:
        """Return the line here, and go on."""
        line = self.peek()
        self.position += 1
        return line

    def raw(self) -> bytes:
        """Return a data line, and go on."""
        # The last piece has no line end after it: it may be half a line.
        if self.position >= len(self._lines) - 1:
            raise self.wrong("the file ends in the middle of a block: truncated")
        self.position += 1
        return self._lines[self.position - 1]

    def wrong(self, problem: str) -> InputError:
        """Return the error to raise for a problem at this line."""
        return InputError(self.path, f"line {self.position}", problem)


#: meshio's name of the element types that public decks show.
CELLS = {7: ("hexahedron", None), 134: ("tetra", None), 138: ("triangle", None)}
CELLS |= dict.fromkeys((18, 75, 139, 140), ("quad", None))
#: Number of characters of a vector's name.
NAME = 48


class T19File:
    """A post file of Marc: its mesh is read at once, its increments by `frames`.

    InputError if the file is of another kind, truncated or corrupt; it names the line.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._file = Records(self.path)
        if len(self._file) < 2 or not self._file.peek().startswith("=beg=501"):
            problem = "is not a formatted post file of Marc (no =beg=501 at its start)"
            raise InputError(self.path, "", problem)
        self.mesh = self._model()
        self._first = self._file.position

    def frames(self, is_complete: bool = True) -> Iterator[ResultFrame]:
        """Yield the results of every increment in order.

        Parameters
        ----------
        is_complete : bool
            Whether the file must have its end mark; if not, reading ends with the last complete
            increment.
        """
        self._file.position = self._first
        while True:
            try:
                mark = self._file.line()
                if mark == "++++":
                    return
                if mark != "****":
                    raise self._file.wrong(f"expected **** or ++++, got {mark[:20]!r}")
                frame = self._frame()
            except InputError:
                if is_complete:
                    raise
                return
            yield frame

    def _model(self) -> ResultMesh:
        """Read all blocks before the first increment; return the mesh."""
        numbers = np.empty(0, np.int64)
        points = np.empty((0, 3))  # x, y, z of each node
        elements: list[tuple[int, NDArray[np.int64]]] = []
        header = [0] * 30
        while self._file.peek() not in ("****", "++++"):
            kind, _ = self._file.begin()
            if kind == 502:
                header = [*self._file.integers_to_end(), *header][:30]
            elif kind == 507:
                elements = [self._element(header[9]) for _ in range(header[2])]
            elif kind == 508:
                numbers, points = self._points(header[1], header[8])
            else:
                self._file.skip()
            self._file.end()
        if not len(numbers):
            raise self._file.wrong("no nodes (block 508) before the first increment")
        return ResultMesh(numbers, points, tuple(elements))

    def _frame(self) -> ResultFrame:
        """Read an increment up to its end; return its time and nodal vectors."""
        frame = ResultFrame()
        timed = False
        while self._file.peek() != "----":
            if self._file.peek() in ("****", "++++"):
                raise self._file.wrong("an increment without its end (----): truncated")
            kind, version = self._file.begin()
            if kind == 517:
                numbers = self._file.integers_to_end()
                if len(numbers) < 12:
                    raise self._file.wrong("a block 517 of fewer than 12 numbers")
                remeshed, frame.increment = numbers[:2]
                if remeshed:
                    raise self._file.wrong("an increment with a new mesh; switch remeshing off")
            elif kind == 518:
                # In later versions a count goes before the numbers.
                count = self._file.integers(1)[0] if version else 1
                if count < 1:
                    raise self._file.wrong("an increment without its time")
                frame.time = float(self._file.reals(count if version else 6)[0])
                timed = True
            elif kind == 524:
                self._vectors(frame)
            else:
                self._file.skip()
            self._file.end()
        self._file.line()
        if not timed:
            raise self._file.wrong("an increment without its time (block 518)")
        return frame

    def _vectors(self, frame: ResultFrame) -> None:
        """Read the nodal vectors of an increment, (nodes, components) each, into the frame."""
        for _ in range(self._file.integers(2)[0]):
            name = self._file.line()[:NAME].strip()
            numbers = self._file.integers(12)
            if numbers[6] != -1:
                continue
            components = max(numbers[3], 1)
            values = self._file.reals(len(self.mesh.numbers) * components)
            frame.fields[name] = values.reshape(-1, components)

    def _element(self, max_nodes: int) -> tuple[int, NDArray[np.int64]]:
        """Return type and node numbers (n,) of the next element of at most `max_nodes` nodes."""
        record = self._file.integers(3 + max_nodes)
        if not 1 <= record[2] <= max_nodes:
            raise self._file.wrong(f"an element of {record[2]} nodes")
        return record[1], np.array(record[3 : 3 + record[2]], dtype=np.int64)

    def _points(self, count: int, coordinates: int) -> tuple[NDArray[np.int64], Array]:
        """Return node numbers (count,) and positions (count, 3), zero where the file has less."""
        if not (0 < count <= len(self._file) and 1 <= coordinates <= 5):
            raise self._file.wrong(f"{count} nodes of {coordinates} coordinates")
        rows = [self._file.raw() for _ in range(count)]
        numbers = self._file.parse([row[:WIDTH] for row in rows], count, int)
        width = min(coordinates, 3)
        # Blanks after the coordinates are fields of ours no more.
        places = [row[WIDTH : WIDTH * (1 + coordinates)] for row in rows]
        values = self._file.parse(places, count * coordinates, float).reshape(count, coordinates)
        if not (np.diff(numbers) > 0).all():
            raise self._file.wrong("node numbers do not increase")
        points = np.pad(values[:, :width], ((0, 0), (0, 3 - width)))
        return numbers.astype(np.int64), points


def read_last_frame(path: Path) -> Any:
    """Return mesh and last increment of a file, for meshio."""
    return last_frame(T19File(path), CELLS)
