"""Read a value, such as the pressure, from a file of points: a constant column, or a line above."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from .cells import MAX_LINES_ABOVE, SEPARATORS, Cells, Lines, Rows, is_hole, row_of
from .frames import Array
from .headings import heading_of
from .machine_tables import Channel, in_unit
from .numerals import NUMBER, is_number, parse_number
from .quantities import MAX_COLUMNS
from .tables import read_lines
from .units import split_unit, without_brackets

#: Number of characters of a line that are searched.
MAX_LINE_LENGTH = 1000
#: Units of readings that a scale makes something of.
VOLTS = ("V", "mV")


@dataclass(frozen=True)
class FileValues:
    """Values of a file, one for each frame, their unit, and their line and column for messages."""

    values: Sequence[float]
    unit: str
    location: str


def values_in_file(path: Path, channel: Channel, units: Mapping[str, float]) -> Array:
    """Return the values that a file of frames names, such as its pressure.

    Parameters
    ----------
    path : Path
    channel : Channel
        Its column is the name of a column that is constant in each frame, or stands in a line
        above the numbers with the value behind it.
    units : mapping
        Table of units of the quantity.

    Returns
    -------
    (frames,) array
        In the base unit.

    Raises
    ------
    InputError
        There is no such value, several in a frame, or no unit.
    """
    name = channel.column or ""
    # With comments: a value may stand in one.
    lines = read_lines(path, "", any_encoding=True)
    result = _in_column(path, lines, name) or _above_numbers(path, lines, name, (*units, *VOLTS))
    if result is None:
        problem = f"neither a column {name!r} nor a line above the numbers that says {name!r}"
        raise InputError(path, "", f"{problem} and a value")
    values = np.array(result.values)
    return in_unit(values, result.unit, channel, units, path, result.location)


def _in_column(path: Path, lines: Lines, name: str) -> FileValues | None:
    """Return the values of a column, None where there is none of this name."""
    for rows in _tables_naming(lines, name):
        line = rows[0].line
        names = [cell.lstrip("# ") for cell in rows[0].cells]
        columns = [i for i, cell in enumerate(names) if name in (cell, split_unit(cell)[0])]
        if len(columns) > 1:
            raise InputError(path, f"line {line}", f"{len(columns)} columns are called {name!r}")
        if columns:
            return _constants(path, rows, names, columns[0])
    return None


def _tables_naming(lines: Lines, name: str) -> Iterator[Rows]:
    """Yield the rows from each header on in which a name stands, at each separator."""
    for separator in SEPARATORS:
        for index, (_, text) in enumerate(lines[:MAX_LINES_ABOVE]):
            if name not in text:
                continue
            top = [row_of(*line, separator) for line in lines[index : index + 3]]
            if _is_header(top):
                yield [row_of(*line, separator) for line in lines[index:]]


def _is_header(rows: Rows) -> bool:
    """Return whether the first of three rows has names, and one of the others numbers of them."""
    names = [cell.lstrip("# ") for cell in rows[0].cells]
    if not 2 <= len(names) <= MAX_COLUMNS or any(map(is_number, names)):
        return False
    return any(
        len(row.cells) >= len(names) - 1 and 2 * sum(map(is_number, row.cells)) >= len(names)
        for row in rows[1:]
    )


def _constants(path: Path, rows: Rows, names: Cells, column: int) -> FileValues:
    """Return the value of a column in each frame, by the numbers of frames if there are any."""
    name = names[column]
    unit = split_unit(name)[1]
    header = rows[0].line
    frame_column = _frame_column(names)
    values: dict[float, float] = {}
    first_lines: dict[float, int] = {}
    for line, cells in rows[1:]:
        cell = cells[column] if column < len(cells) else ""
        field = f"line {line}, column {name!r}"
        if not is_number(cell):
            # The row of units stands right below the names.
            if not values and line <= header + 2 and cell:
                unit = without_brackets(cell)
            elif not is_hole(cell):
                raise InputError(path, field, f"expected a number, found {cell[:40]!r}")
            continue
        number = _frame_number(path, line, names, cells, frame_column)
        value = parse_number(cell)
        if values.setdefault(number, value) != value:
            problem = f"expected the same number as in line {first_lines[number]}, one a file"
            raise InputError(path, field, problem)
        first_lines.setdefault(number, line)
    location = f"line {header}, column {name!r}"
    if not values:
        raise InputError(path, location, "holds no number")
    return FileValues([values[number] for number in sorted(values)], unit, location)


def _frame_column(names: Cells) -> int | None:
    """Return the column of the numbers of frames; None where there is none, or several."""
    columns = [i for i, name in enumerate(names) if heading_of(name).quantity == "frame"]
    return columns[0] if len(columns) == 1 else None


def _frame_number(
    path: Path, line: int, names: Cells, cells: Cells, frame_column: int | None
) -> float:
    """Return the number of the frame that a row is of; 0 in a file of one."""
    if frame_column is None or frame_column >= len(cells):
        return 0.0
    if not is_number(cells[frame_column]):
        problem = f"expected a number, found {cells[frame_column][:40]!r}"
        raise InputError(path, f"line {line}, column {names[frame_column]!r}", problem)
    return parse_number(cells[frame_column])


def _above_numbers(path: Path, lines: Lines, name: str, units: Sequence[str]) -> FileValues | None:
    """Find a line such as "name [unit] = number", "name_unit=number" or "name: number unit"."""
    unit_names = "|".join(sorted(units, key=len, reverse=True))
    statement = re.compile(
        rf"(?<!\w){re.escape(name)}(?:_({unit_names}))?(?!\w)[ _]*(?:[(\[<]([^)\]>]*)[)\]>])?"
        rf"[\s:=;,]*({NUMBER})(?:[\s;,]*({unit_names})(?!\w))?"
    )
    matches = []
    for line, text in lines[:MAX_LINES_ABOVE]:
        match = statement.search(text[:MAX_LINE_LENGTH])
        if match:
            matches.append((line, match))
    if not matches:
        return None
    values = {parse_number(match[3]) for _, match in matches}
    line, match = matches[0]
    if len(values) > 1:
        second = matches[1][0]
        raise InputError(path, f"line {second}", f"says another {name!r} than line {line}")
    unit = match[1] or match[2] or match[4] or split_unit(name)[1]
    return FileValues([*values], unit.strip(), f"line {line}")
