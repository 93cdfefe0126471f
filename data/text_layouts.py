"""Where the numbers of a table of points stand in a text file: header, units, separator, mark.

Exports differ in what stands above the row of names, in whether a row of units follows it, and in
the separator. All of it is found by what the names mean (`frame_headings`).
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from .column_names import MOST_NAMES
from .decimal_marks import decimal_mark, is_number
from .frame_headings import LENGTHS, PIXELS, Heading, columns_of, heading_of
from .tables import check_width, read_lines

#: Line number from 1 and text.
Lines = list[tuple[int, str]]

#: None is any number of blanks.
SEPARATORS = ("\t", ";", ",", None)
#: The row of names stands within so many lines.
TOP = 300
#: So many rows are looked at for the decimal mark.
SAMPLE = 500


@dataclass(frozen=True)
class TextLayout:
    """Where the numbers stand.

    separator : None for blanks. headings : of the columns. columns : those of each quantity, see
    `frame_headings.columns_of`. header : line number of the names. body : the rows of numbers.
    decimal : the mark.
    """

    separator: str | None
    headings: Sequence[Heading]
    columns: Mapping[str, Sequence[int]]
    header: int
    body: Lines
    decimal: str


def cells_of(text: str, separator: str | None) -> list[str] | None:
    """The cells of one line; None where a quotation mark is opened and not closed on it."""
    if separator is None and '"' not in text:
        return text.split()
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    if text.count('"') % 2:
        return None
    try:
        row = next(csv.reader([text.strip()], delimiter=separator or " ", skipinitialspace=True))
    except csv.Error:
        return None
    return [cell.strip(' "') for cell in row if cell or separator is not None]


def find_layout(
    path: Path,
    quantities: Sequence[str],
    named: Mapping[str, str],
    comment: str,
    decimal: str | None = None,
    upper: bool = False,
) -> TextLayout:
    """The layout of a file.

    Parameters
    ----------
    quantities : what its rows must hold.
    named : the file's own names of some of them.
    comment : lines that start so are passed over; a row of names may be one of them.
    decimal : the mark, where it is known.
    upper : see `frame_headings.columns_of`.

    Raises
    ------
    InputError : no such file, no text, no row of names, a mark that may be one of thousands.
    """
    lines = read_lines(path, comment, any_encoding=True)
    found = _best_header(lines, quantities, named, upper)
    if found is None and comment:
        # The names may be a comment, as numpy.savetxt writes them.
        above = [(n, t.lstrip(comment).strip()) for n, t in read_lines(path, "", any_encoding=True)]
        first = lines[0][0] if lines else 0
        heads = [one for one in above if one[0] < first][-2:]
        found = _best_header(heads + lines, quantities, named, upper)
        lines = heads + lines if found is not None else lines
    if found is None:
        raise InputError(path, "", _nothing_found(lines))
    index, separator, names = found
    header, body = lines[index][0], lines[index + 1 :]
    units = [""] * len(names)
    below = cells_of(body[0][1], separator) if body else None
    if below is not None and _is_units(below):
        units = [cell.strip("()[]<>{} ") for cell in below] + units
        body = body[1:]
    headings = [heading_of(name, unit) for name, unit in zip(names, units, strict=False)]
    columns = columns_of(headings, named, upper)
    if not body:
        problem = "expected a header line and rows of numbers, found only a header line"
        raise InputError(path, f"line {header}", problem)
    check_width(path, header, len(names), len(body), sum(len(text) for _, text in body))
    mark = decimal or _decimal(path, body, separator, headings, columns)
    return TextLayout(separator, headings, columns, header, body, mark)


def _best_header(
    lines: Lines, quantities: Sequence[str], named: Mapping[str, str], upper: bool
) -> tuple[int, str | None, list[str]] | None:
    """The row of names that tells most quantities, by any separator: index, separator, names."""
    best: tuple[tuple[int, bool, bool, bool, int], int, str | None, list[str]] | None = None
    for separator in SEPARATORS:
        for index, (_, text) in enumerate(lines[:TOP]):
            names = cells_of(text, separator)
            if names is None or not 2 <= len(names) <= MOST_NAMES or _is_numbers(names):
                continue
            columns = columns_of([heading_of(name) for name in names], named, upper)
            known = {key.split()[0] for key, where in columns.items() if where}
            hits = len(known & {*quantities})
            rows = [cells_of(text, separator) for _, text in lines[index + 1 : index + 3]]
            numbers = [row for row in rows if row is not None and _is_numbers(row)]
            # A heading with a blank in it makes more names than there are numbers.
            fits = any(len(names) == len(row) - (not row[-1]) for row in numbers)
            fits = fits or any(len(names) == len(row) for row in numbers)
            score = (hits, bool(numbers), fits, separator is not None, len(names))
            if hits >= 2 and (best is None or score > best[0]):
                best = score, index, separator, names
    return None if best is None else best[1:]


def _is_numbers(row: Sequence[str]) -> bool:
    """Whether half of the cells or more are numbers."""
    return 2 * sum(is_number(cell) for cell in row) >= max(len(row), 1)


def _is_units(row: Sequence[str]) -> bool:
    """Whether a row below the names is one of units: some are lengths, and none is a number."""
    plain = [cell.strip("()[]<>{} ").casefold() for cell in row]
    known = any(cell in LENGTHS or cell in PIXELS for cell in plain)
    return known and not any(is_number(cell) for cell in plain)


def _decimal(
    path: Path,
    body: Lines,
    separator: str | None,
    headings: Sequence[Heading],
    columns: Mapping[str, Sequence[int]],
) -> str:
    wanted = [i for key, where in columns.items() if key not in ("valid", "invalid") for i in where]
    cells = [
        (number, headings[i].name, row[i])
        for number, text in body[:SAMPLE]
        for row in [cells_of(text, separator) or []]
        for i in wanted
        if i < len(row)
    ]
    return decimal_mark(path, cells)


def _nothing_found(lines: Lines) -> str:
    if len(lines) < 2:
        found = "only a header line" if lines else "nothing"
        return f"expected a header line and rows of numbers, found {found}"
    head = " ".join(lines[0][1].split())[:100]
    return (
        "no row of names with places and displacements (x, y, dx, dy, dz and the like) was found;"
        f" name them with columns. Line {lines[0][0]} is: {head}"
    )
