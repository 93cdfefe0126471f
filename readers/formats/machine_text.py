"""A test machine's export as text: header row, unit row, separator and decimal mark are found.

The layouts that MTS TestSuite and TestWorks, Instron Bluehill and ZwickRoell testXpert write:
some lines about the test and the specimen, one row of names, mostly one row of units, numbers;
separated by commas, semicolons or tabs; the decimal mark a point or a comma. A table of results may
stand above the readings, and the readings of several specimens one block after the other, each with
its names: of several tables the one with most rows is read, and all blocks with the same names.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..columns import LENGTH_UNITS, LOAD_UNITS, MOST_NAMES, TIME_UNITS, columns_of, split_unit
from ..machine_tables import MachineTable, TableOptions
from ..registry import Format, register_format
from ..tables import TextTable, check_width, decimal_mark, is_number, read_lines

#: Line number from 1 and cells.
Rows = list[tuple[int, list[str]]]

SEPARATORS = ("\t", ";", ",")
UNITS = {*LENGTH_UNITS, *LOAD_UNITS, *TIME_UNITS}
_LETTERS = re.compile(r"[^\W\d_]")
_LETTER = re.compile(r"[^\W\d_eE]")


def cells_of(text: str, separator: str) -> list[str]:
    """Return the cells of one line."""
    # Line by line: a quotation mark left open must not swallow the rest of the file.
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator))]
    except csv.Error:
        return [text]


def find_header(rows: Rows, named: Mapping[str, str], quantities: Sequence[str]) -> int | None:
    """Return the first row of names with numbers below it, else the first row of names."""
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
    """Return the columns of each quantity; none where one has no column of its own."""
    if len(names) > MOST_NAMES:
        return []
    columns = [columns_of(names, quantity, named) for quantity in quantities]
    # A sentence that speaks of load and extension is one cell, and no header.
    several = all(columns) and len(set().union(*columns)) >= len(quantities)
    return columns if several else []


def _is_header(rows: Rows, index: int, named: Mapping[str, str], quantities: Sequence[str]) -> bool:
    """Return whether a row has the names, and numbers one or two rows below."""
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
    """Return the tables from the row `first` on, by their names.

    Raises InputError: a unit row says another unit than the name above it.
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
        below = rows[body][1] if body < end else []
        letters = any(_LETTERS.search(below[i]) for i in needed if i < len(below))
        if letters and not any(_is_number(below, i) for i in needed):
            units |= _unit_row(path, rows[body], names, units)
            body += 1
        inside = [(n, row) for n, row in rows[body:end] if any(row)]
        # What stands between two tables begins with a word: the title of the second.
        while (
            end < len(rows)
            and inside
            and not is_number(next((cell for cell in inside[-1][1] if cell), ""))
        ):
            inside.pop()
        blocks.setdefault(tuple(names), []).append(Block(line, units, inside))
    return blocks


def _is_number(row: list[str], column: int) -> bool:
    return column < len(row) and is_number(row[column])


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
    """Describe the row that might have been the row of names."""
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


def read(path: Path, options: TableOptions) -> MachineTable:
    """Read the first table with a column of each of the quantities asked for.

    Raises InputError: no such table, nothing below it, two units for one column (also where its
    names come again), rows longer than the header, a decimal mark that may be a mark
    of thousands.
    """
    import pandas as pd

    named, quantities = options.columns, options.quantities
    lines = read_lines(path, options.comment, any_encoding=True)
    found = []
    for separator in SEPARATORS:
        rows = [(number, cells_of(text, separator)) for number, text in lines]
        index = find_header(rows, named, quantities)
        if index is not None:
            found.append((len(rows[index][1]), rows, index, separator))
    if not found:
        raise InputError(path, "", nothing_found(lines, named, quantities))
    _, rows, index, separator = max(found, key=lambda one: one[0])
    blocks = find_blocks(path, rows, index, named, quantities)
    chosen = max(blocks, key=lambda names: sum(len(one.rows) for one in blocks[names]))
    names, several = list(chosen), blocks[chosen]
    header_line, units = several[0].line, _units(path, several)
    rest = [row for one in several for row in one.rows]
    if not rest:
        raise InputError(path, f"line {header_line}", "no rows of numbers below these names")
    for number, row in rest:
        if any(row[len(names) :]):
            count = len(row)
            problem = f"expected {len(names)} cells as in line {header_line}, found {count}"
            if separator == ",":
                problem += "; decimal commas need another separator, or quotation marks"
            raise InputError(path, f"line {number}", problem)
    width = len(names)
    check_width(path, header_line, width, len(rest), sum(len(row) for _, row in rest))
    cells = pd.DataFrame([(row + [""] * width)[:width] for _, row in rest], columns=names)
    line_numbers = np.array([number for number, _ in rest])
    needed = [i for quantity in quantities for i in columns_of(names, quantity, named)]
    numbers = [(n, names[i], row[i]) for n, row in rest for i in needed if i < len(row)]
    decimal = options.decimal or decimal_mark(path, numbers)
    table = TextTable(path, cells, line_numbers, decimal)
    return MachineTable(table, units, header_line, _notes(path, blocks, chosen))


def _units(path: Path, several: Sequence[Block]) -> dict[str, str]:
    """Return the units of tables of the same names, which are read as one."""
    first = several[0]
    for one in several[1:]:
        for name, unit in one.units.items():
            if unit and unit != first.units[name]:
                before = repr(first.units[name]) if first.units[name] else "none"
                problem = (
                    f"unit {unit!r} here, but {before} in the table of the same names in line "
                    f"{first.line}; correct one"
                )
                raise InputError(path, f"line {one.line}, column {name!r}", problem)
    return first.units


def _notes(
    path: Path, blocks: Mapping[tuple[str, ...], list[Block]], chosen: tuple[str, ...]
) -> tuple[str, ...]:
    others = [
        str(one.line) for names, several in blocks.items() if names != chosen for one in several
    ]
    if not others:
        return ()
    line = blocks[chosen][0].line
    return (
        f"{path.name}: the table with its names in line {line}, which has most rows, is read; not"
        f" that of line {' and '.join(others)}",
    )


register_format(Format("text", "machine table", "columns of text, as test machines export", read))
