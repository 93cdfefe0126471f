"""Readers of CalculiX's result files: .frd, text and binary, frame by frame, and printed tables.

Records (cgx manual, "Result Format") are 1C, 1U and 1P for headers, 2C for nodes, 3C for elements,
100C for one result of one increment, and 9999 for the end. They are text in fixed columns, or
binary (flag 2 for float32, 3 for float64). A file that does not hold what its headers announce, or
stops before 9999, is refused.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...storage.reading import input_errors
from ..result_files import Array, ResultFrame, ResultMesh, last_frame

#: How numbers are written: text with short or long node numbers; binary, float32 or float64.
SHORT = 0
LONG = 1
FLOAT = 2
DOUBLE = 3
ROW = 6  # number of values in a line of text
#: Size in bytes that the results of any file may reach when nodes without a value are padded.
MAX_PADDED_BYTES = 2**28
#: Number of nodes of each element type of the format.
NODES = {1: 8, 2: 6, 3: 4, 4: 20, 5: 15, 6: 10, 7: 3, 8: 6, 9: 4, 10: 8, 11: 2, 12: 3}

#: meshio's name of each element type of the format, and its node order where it differs.
CELLS: dict[int, tuple[str, tuple[int, ...] | None]] = {
    1: ("hexahedron", None),
    2: ("wedge", None),
    3: ("tetra", None),
    4: ("hexahedron20", (*range(12), 16, 17, 18, 19, 12, 13, 14, 15)),
    5: ("wedge15", (*range(9), 12, 13, 14, 9, 10, 11)),
    6: ("tetra10", None),
    7: ("triangle", None),
    8: ("triangle6", None),
    9: ("quad", None),
    10: ("quad8", None),
    11: ("line", None),
    12: ("line3", (0, 2, 1)),
}


class FrdFile:
    """A CalculiX result file: its mesh is read at once, its frames by `frames`.

    InputError if the file does not exist, is of another kind or is corrupt, then with the byte.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        with input_errors(self.path):
            self._data = self.path.read_bytes()
        self._position = 0
        self._padded_bytes = 0
        self.mesh = self._header()
        self._first = self._position

    def frames(self, is_complete: bool = True) -> Iterator[ResultFrame]:
        """Yield the results of every increment in order.

        Parameters
        ----------
        is_complete : bool
            Whether the file must have its end mark; if not, it may end after any result.
        """
        self._position = self._first
        self._padded_bytes = 0
        frame: ResultFrame | None = None
        step = increment = 0
        while is_complete or self._position < len(self._data):
            line = self._line()
            if line.startswith("9999", 1):
                break
            if line.startswith("    1PSTEP"):
                increment = self._int(line[36:48])
                step = self._int(line[48:60])
            elif line.startswith("  100C"):
                time = self._number(line[12:24], float, "a number")
                if frame is None or (frame.step, frame.increment) != (step, increment):
                    if frame is not None:
                        yield frame
                    frame = ResultFrame(time, step, increment)
                self._result(line, frame)
            elif not line.startswith("    1"):
                raise self._wrong(f"unknown record {line[:12]!r}")
        if frame is not None:
            yield frame

    def _header(self) -> ResultMesh:
        """Read all records before the first result; return the mesh."""
        if not self._data.startswith(b"    1C"):
            raise InputError(self.path, "", "is not a CalculiX result file (no 1C record)")
        numbers = np.empty(0, np.int64)
        points = np.empty((0, 3))  # x, y, z of each node
        elements = []
        while True:
            start = self._position
            line = self._line()
            if line.startswith("    2C"):
                numbers, points = self._rows(self._int(line[24:36]), 3, self._int(line[73:75]))
            elif line.startswith("    3C"):
                elements = self._elements(self._int(line[24:36]), self._int(line[73:75]))
            elif line.startswith(("  100C", "    1PSTEP")) or line.startswith("9999", 1):
                self._position = start
                break
            elif not line.startswith("    1"):
                raise self._wrong(f"unknown record {line[:12]!r}")
        if not len(numbers):
            raise self._wrong("no node block")
        if not (np.diff(numbers) > 0).all():
            raise self._wrong("node numbers do not increase")
        return ResultMesh(numbers, points, tuple(elements))

    def _result(self, header: str, frame: ResultFrame) -> None:
        """Read a result, whose header was read, into the frame's fields: (nodes, components).

        Nodes without the result have NaN.
        """
        count = self._int(header[24:36])
        flag = self._int(header[73:75])
        line = self._line()
        if not line.startswith(" -4"):
            raise self._wrong("a result without its name")
        name = line[5:13].strip()
        components = self._int(line[13:18])
        for _ in range(components):
            # Calculated components (the length of a vector) are named but not stored.
            components -= self._line()[33:38].strip() == "1"
        if components < 0:
            raise self._wrong(f"{name} of {components} components")
        numbers, values = self._rows(count, components, flag)
        place = np.searchsorted(self.mesh.numbers, numbers)
        is_node = place < len(self.mesh.numbers)
        if not is_node.all() or (self.mesh.numbers[place] != numbers).any():
            raise self._wrong(f"{name} at a node that the mesh does not have")
        # Results at few nodes are padded: so much is no result but a header that says it is.
        self._padded_bytes += 8 * len(self.mesh.numbers) * max(components, 1)
        if self._padded_bytes > max(MAX_PADDED_BYTES, 100 * len(self._data)):
            raise self._wrong(f"{name} of {components} components is more than the file can hold")
        rows = np.full((len(self.mesh.numbers), components), np.nan)
        rows[place] = values
        frame.fields[name] = rows

    def _rows(self, count: int, width: int, flag: int) -> tuple[NDArray[np.int64], Array]:
        """Return node numbers (count,) and values (count, width) of the block that begins here.

        Parameters
        ----------
        flag : int
            How its numbers are written.
        """
        if flag in (FLOAT, DOUBLE):
            kind = np.dtype([("node", "<i4"), ("values", "<f4" if flag == FLOAT else "<f8", width)])
            table = np.frombuffer(self._take(count * kind.itemsize), kind)
            numbers = table["node"].astype(np.int64)
            values = table["values"].astype(float)
        else:
            digits = 10 if flag == LONG else 5
            numbers, values = self._text_rows(count, width, digits)
            self._end_of_block()
        if not np.isfinite(values).all():
            raise self._wrong("a value that is not a finite number")
        return numbers, values.reshape(count, width)

    def _text_rows(self, count: int, width: int, digits: int) -> tuple[NDArray[np.int64], Array]:
        """Return numbers (count,) and values (count, width) of a block that is written as text.

        Parameters
        ----------
        digits
            Of the node number.
        """
        lines = [min(ROW, width - first) for first in range(0, width, ROW)]
        sizes = [3 + digits + 12 * n + 1 for n in lines]
        table = np.frombuffer(self._take(count * sum(sizes)), np.uint8).reshape(count, sum(sizes))
        parts = []
        start = 0
        for i, (n, size) in enumerate(zip(lines, sizes, strict=True)):
            rows = table[:, start : start + size]
            key = b" -1" if i == 0 else b" -2"
            has_key = (rows[:, :3] == np.frombuffer(key, np.uint8)).all()
            ends_in_newline = (rows[:, -1] == ord("\n")).all()
            if not (has_key and ends_in_newline):
                raise self._wrong("a data line that is too short or too long")
            parts.append(self._numbers(rows[:, 3 + digits : -1], 12, float).reshape(count, n))
            start += size
        return self._numbers(table[:, 3 : 3 + digits], digits, int).reshape(count), np.hstack(parts)

    def _numbers(self, columns: NDArray[np.uint8], width: int, kind: type) -> NDArray:
        """Return the numbers of a table of bytes; an error names the file."""
        try:
            return np.ascontiguousarray(columns).view(f"S{width}").astype(kind)
        except ValueError as error:
            raise self._wrong(str(error)) from None

    def _elements(self, count: int, flag: int) -> list[tuple[int, NDArray[np.int64]]]:
        """Return type and node numbers of each element of a block."""
        blocks = []
        for _ in range(count):
            if flag in (FLOAT, DOUBLE):
                kind = int(np.frombuffer(self._take(16), "<i4")[1])
                nodes = np.frombuffer(self._take(4 * self._nodes(kind)), "<i4").astype(np.int64)
            else:
                digits = 10 if flag == LONG else 5
                kind = self._int(self._line()[3 + digits : 8 + digits])
                text = ""
                while len(text) < digits * self._nodes(kind):
                    text += self._line()[3:]
                places = range(0, digits * self._nodes(kind), digits)
                nodes = np.array([self._int(text[i : i + digits]) for i in places])
            blocks.append((kind, nodes))
        if flag not in (FLOAT, DOUBLE):
            self._end_of_block()
        return blocks

    def _nodes(self, kind: int) -> int:
        if kind not in NODES:
            raise self._wrong(f"unknown element type {kind}")
        return NODES[kind]

    def _end_of_block(self) -> None:
        if not self._line().startswith(" -3"):
            raise self._wrong("a block longer than announced")

    def _take(self, size: int) -> bytes:
        """Return the next bytes, as many as asked for; an error if the file ends before."""
        if size < 0 or self._position + size > len(self._data):
            raise self._wrong("the file ends in the middle of a block: truncated")
        self._position += size
        return self._data[self._position - size : self._position]

    def _line(self) -> str:
        """Return the next line without its end; an error if the file ends before."""
        end = self._data.find(b"\n", self._position)
        if end < 0:
            raise self._wrong("the file ends before its end mark (9999): truncated")
        line = self._data[self._position : end].decode("ascii", errors="replace")
        self._position = end + 1
        return line

    def _int(self, text: str) -> int:
        return int(self._number(text, int, "a whole number"))

    def _number(self, text: str, kind: type, expected: str) -> float:
        """Return a text as a number; an error names the file."""
        try:
            return float(text) if kind is float else int(text)
        except ValueError:
            raise self._wrong(f"expected {expected}, got {text.strip()!r}") from None

    def _wrong(self, problem: str) -> InputError:
        return InputError(self.path, f"byte {self._position}", problem)


def read_last_frame(path: Path) -> Any:
    """Return mesh and last increment of a file, for meshio."""
    return last_frame(FrdFile(path), CELLS)


_TABLE = re.compile(
    r"^ *(displacements|forces) \(.*\) for set \S+ and time +(\S+)\n\s*?\n"
    r"((?: +\d+(?: +\S+){3}\n)+)",
    re.MULTILINE,
)


class PrintedFile:
    """Displacements and forces of the node sets that a .dat file has; nodes have no places there.

    Attributes
    ----------
    mesh : ResultMesh
        Numbers of the nodes; their points are no numbers.
    """

    def __init__(self, path: Path) -> None:
        # Fortran leaves out the E of an exponent of three digits: 1.000000-120.
        text = re.sub(r"(?<=\d)([+-]\d{3})\b", r"E\1", path.read_text(encoding="latin-1"))
        tables = [
            (float(time), quantity, np.array([row.split() for row in rows.splitlines()], float))
            for quantity, time, rows in _TABLE.findall(text)
        ]
        nodes = [np.empty(0), *(table[:, 0] for _, _, table in tables)]
        numbers = np.unique(np.concatenate(nodes)).astype(int)
        self.mesh = ResultMesh(numbers, np.full((len(numbers), 3), np.nan), ())
        fields: dict[float, dict[str, np.ndarray]] = {}
        for time, quantity, table in tables:
            absent = np.full((len(numbers), 3), np.nan)
            field = fields.setdefault(time, {}).setdefault(quantity, absent)
            field[np.searchsorted(numbers, table[:, 0])] = table[:, 1:]
        self._frames = [ResultFrame(time, fields=fields[time]) for time in sorted(fields)]

    def frames(self) -> Iterator[ResultFrame]:
        """Yield what was printed at each time."""
        return iter(self._frames)
