"""A test machine's export as text: header row, unit row, separator and decimal mark are found.

The layouts that MTS TestSuite and TestWorks, Instron Bluehill and ZwickRoell testXpert write:
some lines about the test and the specimen, one row of names, mostly one row of units, numbers;
separated by commas, semicolons or tabs; the decimal mark a point or a comma.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..column_names import LENGTH_UNITS, LOAD_UNITS, TIME_UNITS, columns_of, split_unit
from ..machine_tables import MachineTable, TableOptions
from ..registry import Format, register_format
from ..tables import TextTable, read_lines

Rows = list[tuple[int, list[str]]]

SEPARATORS = ("\t", ";", ",")
UNITS = {*LENGTH_UNITS, *LOAD_UNITS, *TIME_UNITS}
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


def read(path: Path, options: TableOptions) -> MachineTable:
    """The first table with a column of each of the quantities asked for.

    Raises
    ------
    InputError : no such table, nothing below it, two units for one column, rows longer than the
        header, a decimal mark that cannot be told from a mark of thousands.
    """
    import pandas as pd

    named, quantities = options.columns, options.quantities
    lines = read_lines(path, options.comment, any_encoding=True)
    found = []
    for separator in SEPARATORS:
        rows = [(number, _cells(text, separator)) for number, text in lines]
        index = _header(rows, named, quantities)
        if index is not None:
            found.append((len(rows[index][1]), rows, index, separator))
    if not found:
        raise InputError(path, "", _nothing_found(lines, named, quantities))
    _, rows, index, separator = max(found, key=lambda one: one[0])
    header_line, names = rows[index]
    needed = [i for quantity in quantities for i in columns_of(names, quantity, named)]
    body = index + 1
    units = {name: split_unit(name)[1] for name in names}
    if body < len(rows) and _is_unit_row(rows[body][1], needed):
        units |= _unit_row(path, rows[body], names, units)
        body += 1
    rest = [(n, row) for n, row in rows[body:] if any(row)]
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
    cells = pd.DataFrame([(row + [""] * width)[:width] for _, row in rest], columns=names)
    line_numbers = np.array([number for number, _ in rest])
    decimal = options.decimal or _decimal(path, rest, names, needed)
    return MachineTable(TextTable(path, cells, line_numbers, decimal), units, header_line)


def _cells(text: str, separator: str) -> list[str]:
    # Line by line: a quotation mark left open must not swallow the rest of the file.
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator))]
    except csv.Error:
        return [text]


def _header(rows: Rows, named: Mapping[str, str], quantities: Sequence[str]) -> int | None:
    """The first row of names with numbers one or two rows below; else the first row of names."""
    first = None
    for index, (_, names) in enumerate(rows):
        columns = [columns_of(names, quantity, named) for quantity in quantities]
        # A sentence that speaks of load and extension is one cell, and no header.
        if not all(columns) or len(set().union(*columns)) < len(quantities):
            continue
        below = [row for _, row in rows[index + 1 : index + 3]]
        if any(all(any(_is_number(row, i) for i in each) for each in columns) for row in below):
            return index
        first = index if first is None else first
    return first


def _is_number(row: list[str], column: int) -> bool:
    return column < len(row) and bool(_NUMBER.fullmatch(row[column]))


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


def _decimal(path: Path, rows: Rows, names: list[str], needed: list[int]) -> str:
    cells = [(n, names[i], row[i]) for n, row in rows for i in needed if i < len(row)]
    commas = [one for one in cells if _COMMA.fullmatch(one[2])]
    points = any("." in cell and _NUMBER.fullmatch(cell) for _, _, cell in cells)
    if not commas or points:
        return "."
    if all(_GROUPED.fullmatch(cell) for _, _, cell in commas):
        number, name, cell = commas[0]
        problem = f"{cell!r}: is the comma a decimal mark, or does it mark thousands? say decimal"
        raise InputError(path, f"line {number}, column {name!r}", problem)
    return ","


def _nothing_found(
    lines: list[tuple[int, str]], named: Mapping[str, str], quantities: Sequence[str]
) -> str:
    what = " and ".join(
        repr(named[quantity]) if quantity in named else f"one of {quantity}"
        for quantity in quantities
    )
    problem = f"no header row with the columns {what}; name them with columns"
    for index, ((number, text), (_, below)) in enumerate(pairwise(lines)):
        for separator in SEPARATORS:
            names, row = _cells(text, separator), _cells(below, separator)
            if sum(_is_number(row, i) for i in range(len(row))) >= 2:
                higher = _cells(lines[index - 1][1], separator) if index else []
                # Names stand above their units.
                if len(higher) == len(names) and any(c.strip("()[]<> ") in UNITS for c in names):
                    number, names = lines[index - 1][0], higher
                heads = ", ".join(name for name in names if name)[:200]
                return f"{problem}; line {number}, above the first numbers, has: {heads}"
    return f"{problem}; no line with two numbers was found either"


register_format(Format("text", "machine table", "columns of text, as test machines export", read))
