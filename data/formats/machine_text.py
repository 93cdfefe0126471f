"""A test machine's export as text: header row, unit row, separator and decimal mark are found.

The layouts that MTS TestSuite and TestWorks, Instron Bluehill and ZwickRoell testXpert write:
some lines about the test and the specimen, one row of names, mostly one row of units, numbers;
separated by commas, semicolons or tabs; the decimal mark a point or a comma. A table of results may
stand above the readings, and the readings of several specimens one block after the other, each with
its names: of several tables the one with most rows is read, and all blocks with the same names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..column_names import columns_of
from ..decimal_marks import decimal_mark
from ..machine_headers import SEPARATORS, Block, cells_of, find_blocks, find_header, nothing_found
from ..machine_tables import MachineTable, TableOptions
from ..registry import Format, register_format
from ..tables import TextTable, check_width, read_lines


def read(path: Path, options: TableOptions) -> MachineTable:
    """The first table with a column of each of the quantities asked for.

    Raises
    ------
    InputError : no such table, nothing below it, two units for one column (also where its names
        come again), rows longer than the header, a decimal mark that cannot be told from a mark of
        thousands.
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
    """Of the columns of tables of the same names, which are read as one."""
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
