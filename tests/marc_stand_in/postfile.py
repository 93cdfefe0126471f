"""The formatted post file (.t19), increment by increment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .content import Content

Array = NDArray[np.float64]
WIDTH, A_LINE, LABEL = 13, 6, 48


def e13(value: float) -> str:
    """Fortran's E13.6: 0.d six digits; a power of three digits takes the place of its E."""
    if not np.isfinite(value):
        return "NaN".rjust(WIDTH)
    if value == 0.0:
        return " 0.000000E+00"
    mantissa, power = f"{value:.5e}".split("e")
    exponent = int(power) + 1
    digits = f"{'-' if value < 0 else ' '}0.{mantissa.lstrip('-').replace('.', '')}"
    return digits + (f"E{exponent:+03d}" if abs(exponent) < 100 else f"{exponent:+04d}")


class PostFile:
    """Written as Marc does: what is there when it is killed is the beginning of a file."""

    def __init__(self, path: Path, content: Content, title: str) -> None:
        self.stream, self.content = path.open("w", encoding="ascii"), content
        p = content.parameters
        self._block(50100, "Analysis Title", [title])
        header = [0, p.nodes, p.elements, 6, 4, 9, 1, 0, 3, 4, 2, 0, 0, 14, *[0] * 16]
        self._block(50200, "Analysis Verification Data", _integers(header))
        self._block(50600, "Element Variable Postcodes", [])
        assert content.connectivity is not None and content.coordinates is not None
        rows: list[str] = []
        for number, nodes in enumerate(content.connectivity.tolist(), 1):
            rows += _integers([number, p.type, 4, *nodes])
        self._block(50700, "Element Connectivities", rows)
        points = content.coordinates.tolist()
        rows = [f"{n:13d}" + "".join(map(e13, x)) for n, x in enumerate(points, 1)]
        self._block(50800, "Nodal Coordinates", rows)
        self._block(51301, "Set Definitions", _integers([0]))

    def frame(self, increment: int, time: float, vectors: Mapping[str, Array]) -> None:
        """One increment and its nodal vectors (nodes, 3)."""
        self._line("****")
        self._block(51600, "Loadcase Title", [""])
        self._block(51701, "Integer Increment Verification Data",
                    _integers([0, increment, 0, 1, 2, 0, 0, 1, 0, 0, 0, 0]))  # fmt: skip
        rows = [*_integers([24]), *_reals([time, *[0.0] * 23])]
        self._block(51801, "Real Increment Verification Data", rows)
        self._block(52300, "Element Integration Point Values", [])
        rows = _integers([len(vectors), 6])
        for name, values in vectors.items():
            rows.append(name.ljust(LABEL))
            rows += _integers([1, 0, 0, values.shape[1], 0, 0, -1, 0, 0, 0, 0, 0])
            rows += _reals(values.ravel().tolist())
        self._block(52401, "Nodal Results", rows)
        self._line("----")
        self.stream.flush()

    def end(self) -> None:
        """The file is whole."""
        self._line("++++")
        self.stream.close()

    def _block(self, number: int, name: str, rows: Iterable[str]) -> None:
        self._line(f"=beg={number} ({name})")
        for row in rows:
            self._line(row)
        self._line("=end=")

    def _line(self, text: str) -> None:
        self.stream.write(text + "\n")


def _integers(values: list[int]) -> list[str]:
    return _rows([f"{value:13d}" for value in values])


def _reals(values: list[float]) -> list[str]:
    return _rows([e13(value) for value in values])


def _rows(fields: list[str]) -> list[str]:
    return ["".join(fields[i : i + A_LINE]) for i in range(0, len(fields), A_LINE)]
