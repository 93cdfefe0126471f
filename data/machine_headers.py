"""Rows of names in a test machine's text, and the rows of units and of numbers below them."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from ..errors import InputError
from .column_names import LENGTH_UNITS, LOAD_UNITS, MOST_NAMES, TIME_UNITS, columns_of, split_unit
from .decimal_marks import is_number

#: Line number from 1 and cells.
Rows = list[tuple[int, list[str]]]

SEPARATORS = ("\t", ";", ",")
UNITS = {*LENGTH_UNITS, *LOAD_UNITS, *TIME_UNITS}
_LETTER = re.compile(r"[^\W\d_eE]")


def cells_of(text: str, separator: str) -> list[str]:
    """The cells of one line."""
    # Line by line: a quotation mark left open must not swallow the rest of the file.
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator))]
    except csv.Error:
        return [text]


def find_header(rows: Rows, named: Mapping[str, str], quantities: Sequence[str]) -> int | None:
    """The first row of names with numbers one or two rows below; else the first row of names."""
    first = None
    for index in range(len(rows)):
        if _is_header(rows, index, named, quantities):
            return index
        if first is None and _names_all(rows[index][1], named, quantities):
            first = index
    return first


def _names_all(
    names: list[str], named: Mapping[str, str], quantities: Sequence[str]
) -> list[list[int]]:
    """The columns of each quantity; none where a quantity has no column of its own."""
    if len(names) > MOST_NAMES:
        return []
    columns = [columns_of(names, quantity, named) for quantity in quantities]
    # A sentence that speaks of load and extension is one cell, and no header.
    several = all(columns) and len(set().union(*columns)) >= len(quantities)
    return columns if several else []


def _is_header(rows: Rows, index: int, named: Mapping[str, str], quantities: Sequence[str]) -> bool:
    """Whether a row has the names, and numbers one or two rows below."""
    # Most rows are numbers, and quickly passed over.
    if not _LETTER.search("".join(rows[index][1])):
        return False
    columns = _names_all(rows[index][1], named, quantities)
    below = [row for _, row in rows[index + 1 : index + 3]]
    return bool(columns) and any(
        all(any(_is_number(row, i) for i in each) for each in columns) for row in below
    )


@dataclass(frozen=True)
class Block:
    """A row of names with the numbers below it. line : of the names."""

    line: int
    units: dict[str, str]
    rows: Rows


def find_blocks(
    path: Path, rows: Rows, first: int, named: Mapping[str, str], quantities: Sequence[str]
) -> dict[tuple[str, ...], list[Block]]:
    """The tables from the row `first` on, by their names.

    Raises
    ------
    InputError : a unit row says another unit than the name above it.
    """
    heads = [
        first,
        *(i for i in range(first + 1, len(rows)) if _is_header(rows, i, named, quantities)),
    ]
    blocks: dict[tuple[str, ...], list[Block]] = {}
    for head, end in zip(heads, [*heads[1:], len(rows)], strict=True):
        line, names = rows[head]
        needed = [i for quantity in quantities for i in columns_of(names, quantity, named)]
        units, body = {name: split_unit(name)[1] for name in names}, head + 1
        if body < end and _is_unit_row(rows[body][1], needed):
            units |= _unit_row(path, rows[body], names, units)
            body += 1
        inside = [(n, row) for n, row in rows[body:end] if any(row)]
        # What stands between two tables begins with a word: the title of the second.
        while end < len(rows) and inside and not _begins_with_a_number(inside[-1][1]):
            inside.pop()
        blocks.setdefault(tuple(names), []).append(Block(line, units, inside))
    return blocks


def _begins_with_a_number(row: list[str]) -> bool:
    return is_number(next((cell for cell in row if cell), ""))


def _is_number(row: list[str], column: int) -> bool:
    return column < len(row) and is_number(row[column])


def _is_unit_row(row: list[str], needed: list[int]) -> bool:
    cells = [row[i] for i in needed if i < len(row)]
    letters = [cell for cell in cells if re.search("[^\\W\\d_]", cell)]
    return bool(letters) and not any(_is_number(row, i) for i in needed)


def _unit_row(
    path: Path, row: tuple[int, list[str]], names: list[str], units: Mapping[str, str]
) -> dict[str, str]:
    number, cells = row
    found = {}
    for name, cell in zip(names, cells, strict=False):
        unit = cell.strip("()[]<>{} ")
        if unit and units[name] and unit != units[name]:
            problem = f"unit {unit!r} here, but {units[name]!r} in the column's name; correct one"
            raise InputError(path, f"line {number}, column {name!r}", problem)
        if unit:
            found[name] = unit
    return found


def nothing_found(
    lines: list[tuple[int, str]], named: Mapping[str, str], quantities: Sequence[str]
) -> str:
    """Why no row of names was found; and which row it might have been."""
    what = " and ".join(
        repr(named[quantity]) if quantity in named else f"one of {quantity}"
        for quantity in quantities
    )
    problem = f"no header row with the columns {what}; name them with columns"
    for index, ((number, text), (_, below)) in enumerate(pairwise(lines)):
        for separator in SEPARATORS:
            names, row = cells_of(text, separator), cells_of(below, separator)
            if sum(_is_number(row, i) for i in range(len(row))) >= 2:
                higher = cells_of(lines[index - 1][1], separator) if index else []
                # Names stand above their units.
                if len(higher) == len(names) and any(c.strip("()[]<> ") in UNITS for c in names):
                    number, names = lines[index - 1][0], higher
                heads = ", ".join(name for name in names if name)[:200]
                return f"{problem}; line {number}, above the first numbers, has: {heads}"
    return f"{problem}; no line with two numbers was found either"
