"""Read tables in text files: their lines, and columns as text, numbers or times."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from ..storage.reading import read_bytes
from .cells import Lines, Row, check_name, check_row, check_width, padded
from .numerals import (
    HOLES,
    is_ambiguous,
    is_stamp,
    marks_thousands,
    seconds_of_stamps,
    without_thousands,
)


@dataclass(frozen=True, eq=False)
class TextTable:
    """Cells as text, with the lines of the file they stand in.

    Attributes
    ----------
    path : Path
        File, for messages.
    cells : DataFrame of str
        Cells, with one column for each name of the header.
    lines : (rows,) array of int
        Line of each row, from 1.
    decimal : str
        Decimal mark of the numbers.
    """

    path: Path
    cells: pd.DataFrame
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
        text = self.text(column)
        values = _parse_column(text, self.decimal)
        is_bad = ~np.isfinite(values)
        if holes and is_bad.any():
            # Only of the rows in question: text costs more than numbers.
            is_bad[is_bad] = ~text[is_bad].str.strip().str.lower().isin(HOLES).to_numpy(dtype=bool)
        if is_bad.any():
            raise self._no_numbers(column, np.flatnonzero(is_bad))
        return values

    def _no_numbers(self, column: str, rows: NDArray[np.intp]) -> InputError:
        """Return the error of a column with cells that are no numbers in these rows."""
        cell = self.text(column).iloc[rows[0]].strip()
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

    def text(self, column: str) -> pd.Series:
        """Return one column as it stands in the file; InputError if it is not there once."""
        check_name(self.path, [str(name) for name in self.cells.columns], column)
        return self.cells[column]


def _parse_column(text: pd.Series, decimal: str) -> NDArray[np.float64]:
    """Return the numbers of a column, NaN for cells without one."""
    plain = text
    if decimal != ".":
        # A point beside decimal commas marks thousands, or a mistake: no number either way.
        plain = text.str.replace(".", "?", regex=False).str.replace(decimal, ".", regex=False)
    values = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float)
    if np.isfinite(values).all():
        return values
    cells = [cell.strip() for cell in text]
    if not marks_thousands(cells, decimal):
        return values
    plain = pd.Series([without_thousands(cell, decimal) for cell in cells])
    return pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float)


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
    is_utf_16 = any_encoding and content.startswith((b"\xff\xfe", b"\xfe\xff"))
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
    return TextTable(path, pd.DataFrame(rows, columns=header, dtype=str), numbers)


def _split_strictly(path: Path, number: int, text: str) -> Row:
    """Return the cells of a line as they stand, blanks and quotation marks of CSV heeded."""
    try:
        return Row(number, next(csv.reader([text], strict=True)))
    except csv.Error as error:
        problem = f"a quotation mark that is not closed, or too long a cell ({error})"
        raise InputError(path, f"line {number}", problem) from None
