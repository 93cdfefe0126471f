"""Parse numbers in text: decimal marks, thousands separators, signs of a missing value."""

import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError

#: Cells, in small letters, that stand for no value: empty, and what C, .NET and spreadsheets write.
HOLES = ("", "nan", "-nan", "-nan(ind)", "1.#qnan", "-1.#ind", "n. def.", "n/a", "---")
NUMBER = r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[eE][+-]?\d++)?"
_NUMBER = re.compile(NUMBER)
_COMMA = re.compile(r"[+-]?\d*+,\d++([eE][+-]?\d++)?")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}((,\d{3})+|(\.\d{3})+)")
_BELOW_1000 = re.compile(r"[+-]?\d{1,3}")
#: "1 013,5", "1'013.5": no mark of decimals stands before three digits here.
_BLANKS = re.compile(r"(?<=\d)[ '’\u00a0\u2009\u202f](?=\d{3}(?!\d))")


def is_number(cell: str) -> bool:
    """Return whether a cell holds one number, with either mark."""
    return bool(_NUMBER.fullmatch(cell))


def parse_number(cell: str) -> float:
    """Return the number in a cell without marks of thousands; ValueError if it is none."""
    return float(cell.replace(",", "."))


def is_ambiguous(cell: str) -> bool:
    """Return whether a cell may be a whole number with marks of thousands, or one with decimals."""
    return bool(_GROUPED.fullmatch(cell))


def marks_thousands(cells: Sequence[str], decimal: str) -> bool:
    """Return whether marks of thousands are in the cells of a column, beyond any doubt."""
    # One cell with both marks says which is which, for the others of its column too.
    return any(_is_grouped(cell, decimal) for cell in cells) or _are_thousands(cells, decimal)


def _is_grouped(cell: str, decimal: str) -> bool:
    mark = _thousands_mark(decimal)
    if re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}(\{mark}\d{{3}})+\{decimal}\d+", cell):
        return True
    return bool(_BLANKS.search(cell)) and is_number(_BLANKS.sub("", cell))


def _are_thousands(cells: Sequence[str], decimal: str) -> bool:
    """Return whether all are whole numbers, some with marks of thousands, some plain above 99."""
    mark = _thousands_mark(decimal)
    marked = [cell for cell in cells if mark in cell]
    plain = [cell for cell in cells if mark not in cell and cell.casefold() not in HOLES]
    return (
        bool(marked)
        and all(map(_GROUPED.fullmatch, marked))
        and all(map(_BELOW_1000.fullmatch, plain))
        and any(len(cell.lstrip("+-")) == 3 for cell in plain)
    )


def _thousands_mark(decimal: str) -> str:
    return "," if decimal == "." else "."


def without_thousands(cell: str, decimal: str) -> str:
    """Return a number without marks of thousands and with a decimal point; else no number."""
    cell = _BLANKS.sub("", cell)
    mark = _thousands_mark(decimal)
    if re.fullmatch(rf"[+-]?([1-9]\d{{0,2}}(\{mark}\d{{3}})+(\{decimal}\d*)?)", cell):
        return cell.replace(mark, "").replace(decimal, ".")
    return cell.replace(mark, "?").replace(decimal, ".")


def decimal_mark(path: Path, cells: Sequence[tuple[int, str, str]]) -> str:
    """Return the decimal mark of cells that should be numbers: (line, column, text)."""
    if not any(_COMMA.fullmatch(cell) for _, _, cell in cells):
        return "."
    if _has_points(cells):
        # Marks of thousands say nothing of the decimal mark, but that it is the other.
        thousands = _columns_of_thousands(cells)
        cells = [cell for cell in cells if cell[1] not in thousands]
        if _has_points(cells):
            return "."
    commas = [cell for cell in cells if _COMMA.fullmatch(cell[2])]
    if commas and all(is_ambiguous(cell) for _, _, cell in commas):
        number, name, cell = commas[0]
        problem = f"{cell!r}: is the comma a decimal mark, or does it mark thousands? say decimal"
        raise InputError(path, f"line {number}, column {name!r}", problem)
    return "," if commas else "."


def _has_points(cells: Sequence[tuple[int, str, str]]) -> bool:
    return any("." in cell and is_number(cell) for _, _, cell in cells)


def _columns_of_thousands(cells: Sequence[tuple[int, str, str]]) -> set[str]:
    """Return the names of the columns of whole numbers with marks of thousands."""
    by_column: dict[str, list[str]] = {}
    for _, name, cell in cells:
        by_column.setdefault(name, []).append(cell)
    return {
        name
        for name, column in by_column.items()
        if _are_thousands(column, ".") or _are_thousands(column, ",")
    }
