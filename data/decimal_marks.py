"""Numbers in the cells of a text file, and whether their decimal mark is a point or a comma."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError

_NUMBER = re.compile(r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[eE][+-]?\d++)?")
_COMMA = re.compile(r"[+-]?\d*+,\d++([eE][+-]?\d++)?")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


def is_number(cell: str) -> bool:
    """Whether a cell holds one number, with either mark."""
    return bool(_NUMBER.fullmatch(cell))


def decimal_mark(path: Path, cells: Sequence[tuple[int, str, str]]) -> str:
    """The mark, "." or ",", of cells that should be numbers: line, name of the column, text.

    Raises
    ------
    InputError : commas that may be marks of thousands.
    """
    commas = [one for one in cells if _COMMA.fullmatch(one[2])]
    points = any("." in cell and is_number(cell) for _, _, cell in cells)
    if not commas or points:
        return "."
    if all(_GROUPED.fullmatch(cell) for _, _, cell in commas):
        number, name, cell = commas[0]
        problem = f"{cell!r}: is the comma a decimal mark, or does it mark thousands? say decimal"
        raise InputError(path, f"line {number}, column {name!r}", problem)
    return ","
