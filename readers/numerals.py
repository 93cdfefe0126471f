"""Parse numbers and times of a wall clock in text."""

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
    """Return whether marks in a cell can only be of thousands: beside decimals, or blanks."""
    mark = _thousands_mark(decimal)
    if re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}(\{mark}\d{{3}})+\{decimal}\d+", cell):
        return True
    return bool(_BLANKS.search(cell)) and is_number(_BLANKS.sub("", cell))


def _are_thousands(cells: Sequence[str], decimal: str) -> bool:
    """Return whether all are whole numbers, some with marks of thousands, some plain above 99.

    Beside 1,234, a plain 999 shows that marks begin at 1000: with decimals to three places it would
    be 999,000. A plain number below 100 could be one whose decimals were dropped.
    """
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
    """Return the mark of thousands that goes with a decimal mark: the other of the two."""
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
    if not any("," in cell and _COMMA.fullmatch(cell) for _, _, cell in cells):
        return "."
    if _has_points(cells):
        # Marks of thousands say nothing of the decimal mark, but that it is the other.
        thousands = _columns_of_thousands(cells)
        cells = [cell for cell in cells if cell[1] not in thousands]
        if _has_points(cells):
            return "."
    commas = [cell for cell in cells if _COMMA.fullmatch(cell[2])]
    if not commas:
        return "."
    _check_ambiguous(path, commas)
    return ","


def _check_ambiguous(path: Path, commas: Sequence[tuple[int, str, str]]) -> None:
    """Raise InputError if commas of all these cells may be decimal marks or mark thousands."""
    if all(is_ambiguous(cell) for _, _, cell in commas):
        number, name, cell = commas[0]
        problem = f"{cell!r}: is the comma a decimal mark, or does it mark thousands? say decimal"
        raise InputError(path, f"line {number}, column {name!r}", problem)


def _has_points(cells: Sequence[tuple[int, str, str]]) -> bool:
    """Return whether a number is written with a decimal point; cells are (row, column, text)."""
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


HALF_A_DAY = 43200.0  # s
#: "12.03.2021 14:02:11,500", "2021-03-12T14:02:11.5Z", "2:02:11 PM".
_STAMP = re.compile(
    r"(?:(?P<date>\d{1,4}[./-]\d{1,2}[./-]\d{1,4})[T,]? ?)?"
    r"(?P<h>\d{1,2}):(?P<m>[0-5]\d):(?P<s>[0-5]\d(?:[.,]\d+)?)"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?:Z|UTC|[+-]\d\d:?\d\d))?"
)
#: Where year, month and day stand in a date: 2021-3-12, 12.3.2021, 3/12/2021.
_DATE_ORDERS = ((0, 1, 2), (2, 1, 0), (2, 0, 1))


def is_stamp(cell: str) -> bool:
    """Return whether a cell holds a time of a wall clock, with or without its date."""
    return bool(_STAMP.fullmatch(cell))


def seconds_of_stamps(cells: Sequence[str]) -> NDArray[np.float64]:
    """Return times (n,) in s since midnight of the first day; ValueError if dates are not valid."""
    stamps = [stamp for cell in cells if (stamp := _STAMP.fullmatch(cell)) is not None]
    clock = np.array([_seconds_of_day(stamp) for stamp in stamps])
    dates = [stamp["date"] for stamp in stamps]
    if not any(dates):
        # A clock without dates that falls by half a day has passed midnight.
        days = np.cumsum(np.diff(clock, prepend=clock[0]) < -HALF_A_DAY, dtype=np.intp)
    elif all(dates):
        days = _day_numbers(dates)
    else:
        raise ValueError("dates before some of the times only")
    return clock + 2 * HALF_A_DAY * days


def _seconds_of_day(stamp: re.Match[str]) -> float:
    """Return the seconds since midnight of a time, on a clock of 12 or of 24 hours."""
    hour = int(stamp["h"])
    half = stamp["half"]
    if half:
        hour = hour % 12 + 12 * (half in "Pp")
    return 3600.0 * hour + 60.0 * int(stamp["m"]) + float(stamp["s"].replace(",", "."))


def _day_numbers(dates: Sequence[str]) -> NDArray[np.intp]:
    """Return the days (n,) since the first date.

    Where day and month may be in either order, the order that gives the shorter time is taken.
    """
    parts = [[int(part) for part in re.split("[./-]", text)] for text in dates]
    candidates = []
    for order in _DATE_ORDERS:
        with suppress(ValueError):
            days = [date(*(numbers[i] for i in order)).toordinal() for numbers in parts]
            candidates.append(np.array(days) - days[0])
    return min(candidates, key=np.ptp)
