"""Split the lines of text tables into cells, and check rows: the steps that all readers share.

Readers of test machines (`machine_export`) and of image correlation (`text_frames`) build on this:
they find the header, the units and the block of numbers, and leave out summary rows.
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
#: Separators of cells in the order in which they are tried; None is any number of blanks.
SEPARATORS = ("\t", ";", ",", None)
#: A letter that is not that of a number such as 1e3: a line without one names no quantity.
LETTER_BUT_E = re.compile(r"[^\W\d_eE]")
#: Number of lines at the top of a file among which the row of names is looked for.
MAX_LINES_ABOVE = 300
#: Number of cells that may be missing at the ends of rows, beyond the number of the file's letters.
MAX_MISSING_CELLS = 10**7
#: Words that label summary rows: a label has at least one word of the first set, and otherwise
#: only words of the second.
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
    """Return the row of a line; it is empty if a quotation mark is not closed."""
    return Row(number, split_cells(text, separator) or [])


def is_numeric(cells: Cells) -> bool:
    """Return whether half of the cells or more are numbers."""
    return 2 * sum(map(is_number, cells)) >= max(len(cells), 1)


def has_statistic(cells: Sequence[str]) -> bool:
    """Return whether a cell labels the row as a statistic, such as a mean or a maximum."""
    for cell in cells:
        if len(cell) >= MAX_NAME_LENGTH:
            continue
        words = {*re.split(r"[\W\d_]+", cell.casefold())} - {""}
        if words & _STATISTICS and words <= _STATISTICS | _OF_STATISTICS:
            return True
    return False


def is_hole(cell: str) -> bool:
    """Return whether a cell stands for a missing value, see `HOLES`."""
    return cell.casefold() in HOLES


def padded(cells: Cells, width: int) -> Cells:
    """Return exactly `width` cells of a row, filled with "" where it is shorter."""
    return (cells + [""] * width)[:width]


def check_name(path: Path, names: Sequence[str], name: str) -> None:
    """Raise InputError for a column name that is not in the header, or is there twice."""
    if names.count(name) != 1:
        state = "appears twice" if name in names else "is missing"
        problem = f"this column {state}; the file has: {', '.join(names)[:300]}"
        raise InputError(path, f"column {name!r}", problem)


def check_width(
    path: Path,
    line: int,
    width: int,
    rows: int,
    letters: int,
) -> None:
    """Raise InputError for a table whose rows are far shorter than its row of names.

    `width` is the number of names, `rows` the number of rows, `letters` that of their letters.
    """
    if width * rows > letters + MAX_MISSING_CELLS:
        problem = f"{width} names, and {rows} rows that are far shorter; is it a table?"
        raise InputError(path, f"line {line}", problem)


def check_row(
    path: Path,
    row: Row,
    width: int,
    separator: str | None,
    header: str,
) -> None:
    """Raise InputError for a row with more cells than names, or fewer if blanks separate cells.

    Blanks leave no empty cells, so that the columns of a short row are not known.
    """
    if any(row.cells[width:]) or (separator is None and len(row.cells) < width):
        problem = f"expected {width} cells as in {header}, found {len(row.cells)}"
        if separator == ",":
            problem += "; decimal commas need another separator, or quotation marks"
        raise InputError(path, f"line {row.line}", problem)
