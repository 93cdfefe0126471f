"""Read tables in text files: their lines, split into cells, and columns as text, numbers or times.

Readers of test machines (`machine_export`) and of image correlation (`text_frames`) share these
steps: they find the header, the units and the block of numbers, and leave out summary rows.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import date
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from ..storage.reading import read_bytes
from .units import MAX_NAME_LENGTH

#: First bytes of text in UTF-16.
UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, eq=False)
class TextTable:
    """Cells as text, with the lines of the file they stand in.

    Attributes
    ----------
    path : Path
        File, for messages.
    names : list of str
        Names of the columns, in the header.
    rows : sequence of list of str
        Cells of each row, one for each name.
    lines : (rows,) array of int
        Line of each row, from 1.
    decimal : str
        Decimal mark of the numbers.
    """

    path: Path
    names: Cells
    rows: Sequence[Cells]
    lines: NDArray[np.intp]
    decimal: str = "."

    def numbers(self, column: str, holes: bool = False) -> NDArray[np.float64]:
        """Return one column as finite numbers.

        Parameters
        ----------
        column : str
        holes : bool
            Whether cells that stand for no value, `HOLES`, are allowed; they give NaN.

        Returns
        -------
        (rows,) array

        Raises
        ------
        InputError
            The column is missing, or a cell holds no number.
        """
        cells = self.text(column)
        values = _parse_column(cells, self.decimal)
        is_bad = ~np.isfinite(values)
        if holes and is_bad.any():
            # Only of the rows in question: text costs more than numbers.
            is_bad[is_bad] = [not is_hole(cells[row].strip()) for row in np.flatnonzero(is_bad)]
        if is_bad.any():
            raise self._no_numbers(column, np.flatnonzero(is_bad))
        return values

    def _no_numbers(self, column: str, rows: NDArray[np.intp]) -> InputError:
        """Return the error of a column with cells that are no numbers in these rows."""
        cell = self.text(column)[rows[0]].strip()
        problem = f"expected a number, found {repr(cell[:40]) if cell else 'nothing'}"
        if is_ambiguous(cell):
            problem += "; write numbers without marks of thousands"
        further = len(rows) - 1
        if further:
            problem += f"; so in {further} more row{'s' * (further > 1)}"
        return self._error(column, rows[0], problem)

    def _error(self, column: str, row: int, problem: str) -> InputError:
        """Return the error of a cell, which names its file, line and column."""
        return InputError(self.path, f"line {self.lines[row]}, column {column!r}", problem)

    def stamps(self, column: str) -> NDArray[np.float64] | None:
        """Return the times of a wall clock in one column.

        Returns
        -------
        (rows,) array or None
            Seconds since the first midnight; None of a column that begins with no such time.

        Raises
        ------
        InputError
            The column is missing, some of its cells are no times, or a date is none.
        """
        cells = [cell.strip() for cell in self.text(column)]
        if not cells or not is_stamp(cells[0]):
            return None
        for row, cell in enumerate(cells):
            if not is_stamp(cell):
                problem = f"expected a time as {cells[0]!r}, found {cell[:40]!r}"
                raise self._error(column, row, problem)
        try:
            return seconds_of_stamps(cells)
        except ValueError:
            problem = "expected a date before each time, of day, month and year"
            raise InputError(self.path, f"column {column!r}", problem) from None

    def text(self, column: str) -> Cells:
        """Return one column as it stands in the file; InputError if it is not there once."""
        check_name(self.path, self.names, column)
        index = self.names.index(column)
        return [row[index] for row in self.rows]


def _parse_column(cells: Cells, decimal: str) -> NDArray[np.float64]:
    """Return the numbers of a column, NaN for cells without one."""
    plain = cells
    if decimal != ".":
        # A point beside decimal commas marks thousands, or a mistake: no number either way.
        plain = [cell.replace(".", "?").replace(decimal, ".") for cell in cells]
    values = _plain_numbers(plain)
    if np.isfinite(values).all():
        return values
    cells = [cell.strip() for cell in cells]
    if not marks_thousands(cells, decimal):
        return values
    return _plain_numbers([without_thousands(cell, decimal) for cell in cells])


def _plain_numbers(cells: Cells) -> NDArray[np.float64]:
    """Return numbers with a decimal point, NaN for cells without one."""
    return np.fromiter(map(_plain_number, cells), float, len(cells))


def _plain_number(cell: str) -> float:
    if not cell.isascii() or "_" in cell:  # Python takes 1_000 and the digits of any script
        return math.nan
    try:
        return float(cell)
    except ValueError:
        return math.nan


def read_lines(path: Path, comment: str = "#", any_encoding: bool = False) -> Lines:
    """Read the lines of a text file that are neither blank nor comments.

    Parameters
    ----------
    path : Path
    comment : str
        What comments begin with; "" for a file without any.
    any_encoding : bool
        Whether UTF-16 and Latin-1 are read too, not only UTF-8.

    Returns
    -------
    list of (int, str)
        Number of each line, from 1, and its text.
    """
    text = _read_text(path, any_encoding)
    if "\0" in text:
        raise InputError(path, "", "is not a text file; save it as a comma-separated table")
    lines = enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1)
    return [
        (number, line)
        for number, line in lines
        if line.strip() and not (comment and line.startswith(comment))
    ]


def _read_text(path: Path, any_encoding: bool) -> str:
    """Return the text of a file in UTF-8, or in other encodings if `any_encoding` allows them."""
    try:
        content = read_bytes(path)
    except FileNotFoundError:
        raise InputError(path, "", "no such file") from None
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    is_utf_16 = any_encoding and content.startswith(UTF_16_MARKS)
    try:
        return content.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except UnicodeDecodeError:
        if any_encoding and not is_utf_16:
            return content.decode("latin-1")
        problem = "is not text in UTF-8; save it as a comma-separated table"
        raise InputError(path, "", problem) from None


def read_table(path: Path) -> TextTable:
    """Read a comma-separated table with a header line, without blank lines and comments."""
    lines = read_lines(path)
    if len(lines) < 2:
        content = "only a header line" if lines else "nothing"
        raise InputError(path, "", f"expected a header line and rows of numbers, found {content}")
    header = [name.strip() for name in _split_strictly(path, *lines[0]).cells]
    width = len(header)
    rows = []
    for number, text in lines[1:]:
        row = _split_strictly(path, number, text)
        check_row(path, row, width, ",", "the header")
        rows.append(padded(row.cells, width))
    check_width(path, lines[0][0], width, len(lines), sum(len(text) for _, text in lines))
    numbers = np.array([number for number, _ in lines[1:]])
    return TextTable(path, header, rows, numbers)


def _split_strictly(path: Path, number: int, text: str) -> Row:
    """Return the cells of a line as they stand, blanks and quotation marks of CSV heeded."""
    try:
        return Row(number, next(csv.reader([text], strict=True)))
    except csv.Error as error:
        problem = f"a quotation mark that is not closed, or too long a cell ({error})"
        raise InputError(path, f"line {number}", problem) from None


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


#: Cells, in small letters, that stand for no value: empty, and what C, .NET and spreadsheets write.
HOLES = (
    *("", "-", "--", "---", "nan", "-nan", "-nan(ind)", "1.#qnan", "-1.#ind"),
    *("n. def.", "n/a", "na", "n.a.", "#n/a", "#nv", "null"),
)
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
        if _has_points(cells) and not _has_grouping_points_only(cells):
            return "."
    commas = [cell for cell in cells if _COMMA.fullmatch(cell[2])]
    if not commas:
        return "."
    _check_ambiguous(path, commas)
    return ","


def _has_grouping_points_only(cells: Sequence[tuple[int, str, str]]) -> bool:
    """Return whether points stand before three digits only, beside commas that are decimal."""
    texts = [cell for _, _, cell in cells if is_number(cell)]
    has_decimals = any(_COMMA.fullmatch(cell) and not is_ambiguous(cell) for cell in texts)
    return has_decimals and all(is_ambiguous(cell) for cell in texts if "." in cell)


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
