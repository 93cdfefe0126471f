"""Rows of cells of a text table: the first passes, which all readers share.

Readers of test machines (`machine_export`) and of image correlation (`text_frames`) go on from
here: find the header, units and the block of numbers, name columns, drop summary rows.
"""

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError
from .numerals import HOLES, is_number
from .units import MAX_NAME_LENGTH

Cells = list[str]
#: Line number from 1 and text.
Lines = list[tuple[int, str]]
#: What separates cells, in the order of trial; None is any number of blanks.
SEPARATORS = ("\t", ";", ",", None)
#: The row of names stands within so many lines.
MAX_LINES_ABOVE = 300
#: Cells that may be missing from the ends of rows, beyond as many as a file has letters.
MAX_MISSING_CELLS = 10**7
#: Words of a label of rows that are no readings, one of the first in it and nothing else.
_STATISTICS = frozenset(
    "mean average avg mittel mittelwert median std sd stdev stdabw deviation standardabweichung"
    " variation variationskoeffizient cov cv variance varianz min max minimum maximum range"
    " spannweite".split()
)
_OF_STATISTICS = frozenset("standard dev of the coefficient value values wert".split())
_INCH = re.compile(r'[\[(]"[\])]')


class Row(NamedTuple):
    """The cells of one line; lines are counted from 1."""

    line: int
    cells: Cells


Rows = list[Row]


def split_cells(text: str, separator: str | None) -> Cells | None:
    """Return the cells of one line; None where a quotation mark is not closed on it."""
    if '"' not in text:
        return text.split() if separator is None else [c.strip() for c in text.split(separator)]
    text = _INCH.sub("[in]", text)
    if text.count('"') % 2:
        return None
    try:
        row = next(csv.reader([text.strip()], delimiter=separator or " ", skipinitialspace=True))
    except csv.Error:
        return None
    return [cell.strip(' "') for cell in row if cell or separator is not None]


def row_of(number: int, text: str, separator: str | None) -> Row:
    """Return the cells of a line; none if a quotation mark is not closed."""
    return Row(number, split_cells(text, separator) or [])


def is_numeric(cells: Cells) -> bool:
    """Return whether half of the cells or more are numbers."""
    return 2 * sum(map(is_number, cells)) >= max(len(cells), 1)


def has_statistic(cells: Sequence[str]) -> bool:
    """Return whether a cell of a row labels a mean, a deviation, a least or largest value."""
    for cell in cells:
        if len(cell) >= MAX_NAME_LENGTH:
            continue
        words = {*re.split(r"[\W\d_]+", cell.casefold())} - {""}
        if words & _STATISTICS and words <= _STATISTICS | _OF_STATISTICS:
            return True
    return False


def is_hole(cell: str) -> bool:
    """Return whether a cell stands for no value."""
    return cell.casefold() in HOLES


def padded(cells: Cells, width: int) -> Cells:
    """Return the cells of a row of so many, "" where it is shorter."""
    return (cells + [""] * width)[:width]


def check_name(path: Path, names: Sequence[str], name: str) -> None:
    """Refuse a name that is not in the header, or twice."""
    if names.count(name) != 1:
        state = "appears twice" if name in names else "is missing"
        problem = f"this column {state}; the file has: {', '.join(names)[:300]}"
        raise InputError(path, f"column {name!r}", problem)


def check_width(path: Path, line: int, width: int, rows: int, letters: int) -> None:
    """Refuse a table that is mostly holes: a long row of names, far shorter rows."""
    if width * rows > letters + MAX_MISSING_CELLS:
        problem = f"{width} names, and {rows} rows that are far shorter; is it a table?"
        raise InputError(path, f"line {line}", problem)


def check_row(path: Path, row: Row, width: int, separator: str | None, header: str) -> None:
    """Refuse a row with more cells than names, or one of blanks that has fewer.

    Blanks leave no empty cells: a short row has lost its place.
    """
    if any(row.cells[width:]) or (separator is None and len(row.cells) < width):
        problem = f"expected {width} cells as in {header}, found {len(row.cells)}"
        if separator == ",":
            problem += "; decimal commas need another separator, or quotation marks"
        raise InputError(path, f"line {row.line}", problem)
