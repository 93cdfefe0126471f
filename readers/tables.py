"""Comma-separated tables; errors name the file, the column and the line."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import content_of

if TYPE_CHECKING:
    import pandas as pd

#: Cells, in small letters, that stand for no value: empty, and what C, .NET and spreadsheets write.
HOLES = ("", "nan", "-nan", "-nan(ind)", "1.#qnan", "-1.#ind", "n. def.", "n/a", "---")


@dataclass(frozen=True, eq=False)
class TextTable:
    """Cells as text, with the line of each row from 1, and the decimal mark.

    path : the file. cells : one column a name of the header. lines : (rows,) line numbers in the
    file, from 1. decimal : the decimal mark, a point or a comma.
    """

    path: Path
    cells: pd.DataFrame
    lines: NDArray[np.intp]
    decimal: str = "."

    def numbers(self, column: str, holes: bool = False) -> NDArray[np.float64]:
        """Return one column as finite numbers, (rows,); with `holes`, those of `HOLES` give NaN."""
        import pandas as pd

        text = self.text(column)
        plain = text
        if self.decimal != ".":
            # A point beside decimal commas marks thousands, or a mistake: no number either way.
            plain = text.str.replace(".", "?", regex=False)
            plain = plain.str.replace(self.decimal, ".", regex=False)
        value = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float)
        bad = ~np.isfinite(value)
        if holes and bad.any():
            # Only of the rows in question: text costs more than numbers.
            lost = text[bad].str.strip().str.lower().isin(HOLES).to_numpy(dtype=bool)
            bad[bad] = ~lost
        if bad.any():
            first = int(np.argmax(bad))
            cell = text.iloc[first].strip()
            more = int(bad.sum()) - 1
            problem = f"expected a number, found {repr(cell[:40]) if cell else 'nothing'}"
            if more:
                problem += f"; so in {more} more row{'s' * (more > 1)}"
            raise InputError(self.path, f"line {self.lines[first]}, column {column!r}", problem)
        return value

    def constant(self, column: str) -> float:
        """Return one column that holds the same number in each row."""
        value = self.numbers(column)
        if (value != value[0]).any():
            line = self.lines[int(np.argmax(value != value[0]))]
            problem = f"expected the same number as in line {self.lines[0]}"
            raise InputError(self.path, f"line {line}, column {column!r}", problem)
        return float(value[0])

    def text(self, column: str) -> pd.Series:
        """Return one column as it stands in the file."""
        names = [str(name) for name in self.cells.columns]
        if names.count(column) != 1:
            what = "appears twice" if column in names else "is missing"
            problem = f"this column {what}; the file has: {', '.join(names)[:300]}"
            raise InputError(self.path, f"column {column!r}", problem)
        return self.cells[column]

    def rows(self, keep: NDArray[np.bool_]) -> TextTable:
        """Return the table with only the rows where `keep` (rows,) is true."""
        return TextTable(self.path, self.cells[keep], self.lines[keep], self.decimal)


#: Cells that may be missing from the ends of rows, beyond as many as a file has letters.
MOST_MISSING = 10**7


def check_width(path: Path, line: int, width: int, rows: int, letters: int) -> None:
    """Refuse a table that is mostly holes: a long row of names, far shorter rows."""
    if width * rows > letters + MOST_MISSING:
        problem = f"{width} names, and {rows} rows that are far shorter; is it a table?"
        raise InputError(path, f"line {line}", problem)


def read_table(path: Path | str, comment: str = "#") -> TextTable:
    """Read a table with a header line, without blank lines and those that start with `comment`."""
    import pandas as pd

    path = Path(path)
    numbered = read_lines(path, comment)
    if len(numbered) < 2:
        found = "only a header line" if numbered else "nothing"
        raise InputError(path, "", f"expected a header line and rows of numbers, found {found}")
    letters = sum(len(text) for _, text in numbered)
    check_width(path, numbered[0][0], numbered[0][1].count(",") + 1, len(numbered), letters)
    lines = np.array([number for number, _ in numbered])
    body = StringIO("\n".join(text for _, text in numbered))
    try:
        # Everything as text: what is not a number is then found with its line. header=None:
        # with a header, pandas takes surplus first cells for row names and shifts the rest.
        # C engine, and no quoting across lines, so that rows and lines stay in step.
        cells = pd.read_csv(
            body, header=None, dtype=str, keep_default_na=False, skip_blank_lines=False
        )
    except (ValueError, OverflowError) as error:
        raise InputError(path, *_complaint(error, lines)) from None
    if len(cells) != len(lines):
        raise InputError(path, "", "a quotation mark that is opened and not closed on its line")
    cells = cells.fillna("")
    header = [str(name).strip() for name in cells.iloc[0]]
    return TextTable(path, cells.iloc[1:].set_axis(header, axis=1), lines[1:])


def read_lines(path: Path, comment: str = "#", any_encoding: bool = False) -> list[tuple[int, str]]:
    """Read the lines that are neither blank nor a comment, with their numbers from 1.

    any_encoding : take UTF-16 with its mark, and Latin-1 where UTF-8 does not fit.
    """
    try:
        content = content_of(path)
        text = _decoded(content) if any_encoding else content.decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, "", "no such file") from None
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(
            path, "", "is not text in UTF-8; save it as a comma-separated table"
        ) from None
    if "\0" in text:
        raise InputError(path, "", "is not a text file; save it as a comma-separated table")
    kept = enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1)
    return [(n, t) for n, t in kept if t.strip() and not (comment and t.startswith(comment))]


def _decoded(content: bytes) -> str:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _complaint(error: Exception, lines: NDArray[np.intp]) -> tuple[str, str]:
    """Return place and problem of an error of pandas, which counts the lines it was given."""
    text, at = " ".join(str(error).split()), ""
    if found := re.search(r"(line|row) (\d+)", text):
        index = int(found[2]) - (found[1] == "line")  # "row" counts from 0, "line" from 1
        at = f"line {lines[min(max(index, 0), len(lines) - 1)]}"
    if found := re.search(r"Expected (\d+) fields in line \d+, saw (\d+)", text):
        return at, f"expected {found[1]} cells as in the header, found {found[2]}"
    if "EOF inside string" in text:
        return at, "a quotation mark that is opened and not closed"
    return at, f"is not a comma-separated table ({text[:200]})"


def write_table(
    path: Path | str,
    header: Sequence[str],
    rows: Sequence[Sequence[object]],
    comment: str | None = None,
) -> None:
    """Write a comma-separated table; floats so that they read back exactly."""
    with open(path, "w", encoding="utf-8", newline="") as stream:
        if comment is not None:
            stream.write(f"# {comment}\n")
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([repr(c) if isinstance(c, float) else c for c in row] for row in rows)


_NUMBER = re.compile(r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[eE][+-]?\d++)?")
_COMMA = re.compile(r"[+-]?\d*+,\d++([eE][+-]?\d++)?")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


def is_number(cell: str) -> bool:
    """Return whether a cell holds one number, with either mark."""
    return bool(_NUMBER.fullmatch(cell))


def decimal_mark(path: Path, cells: Sequence[tuple[int, str, str]]) -> str:
    """Return the decimal mark of cells that should be numbers: (line, column, text)."""
    commas = [one for one in cells if _COMMA.fullmatch(one[2])]
    points = any("." in cell and is_number(cell) for _, _, cell in cells)
    if not commas or points:
        return "."
    if all(_GROUPED.fullmatch(cell) for _, _, cell in commas):
        number, name, cell = commas[0]
        problem = f"{cell!r}: is the comma a decimal mark, or does it mark thousands? say decimal"
        raise InputError(path, f"line {number}, column {name!r}", problem)
    return ","
