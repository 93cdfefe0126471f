"""A test machine's table: which column holds what, and its numbers in mm and N."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .column_names import columns_of, nearest_to_strip, scale_of
from .frames import FrameSource
from .registry import format_of, read_file
from .tables import TextTable

NEEDED = ("elongation", "load")


@dataclass(frozen=True)
class TableOptions:
    """What a reader of machine tables is told beside the file.

    Parameters
    ----------
    columns : quantities whose column is known by name.
    quantities : of elongation, load, deflection and time, those that the table must hold.
    comment : lines that start so are skipped, where the format has no comments of its own.
    decimal : the decimal mark, "." or ","; None finds it.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    quantities: Sequence[str] = NEEDED
    comment: str = "#"
    decimal: str | None = None


@dataclass(frozen=True, eq=False)
class MachineTable:
    """A table as the file has it.

    table : the rows of numbers. units : for each column name the unit that the file names, "" for
    none. header : line number of the row of names. notes : one sentence each: what was chosen where
    the file leaves a choice.
    """

    table: TextTable
    units: Mapping[str, str]
    header: int
    notes: tuple[str, ...] = ()


def read_machine_table(
    path: Path | str, options: TableOptions = TableOptions(), format: str | None = None
) -> MachineTable:
    """Read the first table with a column of each quantity that `options` ask for.

    Parameters
    ----------
    format : its name (`registry.format_names("machine table")`); found by content unless given.

    Raises
    ------
    InputError : no such file or table, a format that cannot be told.
    """
    table: MachineTable = read_file("machine table", path, format, options)
    return table


def column_of(
    found: MachineTable,
    quantity: str,
    named: Mapping[str, str],
    needed: Sequence[str] = NEEDED,
) -> str:
    """The name of the one column that holds a quantity; "" where it may be absent and is.

    Times are looked for only where they are named or needed. Of several elongations, the one that
    was measured nearest to the strip (`choice_of`).

    Raises
    ------
    InputError : several columns, or none of one that is needed or was named.
    """
    names = [str(name) for name in found.table.cells.columns]
    if quantity == "time" and quantity not in (*named, *needed):
        return ""
    which = columns_of(names, quantity, named)
    if quantity == "elongation" and quantity not in named:
        which = nearest_to_strip(names, which)
    if len(which) == 1 or (not which and quantity not in (*named, *needed)):
        return names[which[0]] if which else ""
    there = ", ".join(name for name in names if name)[:300]
    several = " or ".join(repr(names[i]) for i in which[:6])
    what = f"may be {several}; name one with columns" if which else "is missing"
    if quantity in named:
        what = f"{named[quantity]!r} {'appears twice' if which else 'is missing'}"
    problem = f"the column of {quantity} {what}; the file has: {there}"
    raise InputError(found.table.path, f"line {found.header}", problem)


def choice_of(found: MachineTable, quantity: str, named: Mapping[str, str]) -> tuple[str, ...]:
    """A sentence where `column_of` chose one column among several; else nothing."""
    names = [str(name) for name in found.table.cells.columns]
    which = [] if quantity in named else columns_of(names, quantity, named)
    if len(which) < 2:
        return ()
    chosen = column_of(found, quantity, named)
    others = " and ".join(repr(names[i]) for i in which if names[i] != chosen)
    return (
        f"{found.table.path.name}: the {quantity} is column {chosen!r}, not {others};"
        f" columns = {{ {quantity} = ... }} names another",
    )


def source_of(
    found: MachineTable,
    columns: Mapping[str, str],
    asked: Mapping[str, str | None],
    format: str | None,
    notes: Sequence[str] = (),
) -> FrameSource:
    """What of a table was taken, for the record.

    Parameters
    ----------
    columns : the file's name of each quantity, "" for those that it lacks. asked : units that the
        caller said, by quantity, for columns that name none. format : as it was asked for.
    """
    taken = {quantity: column for quantity, column in columns.items() if column}
    units = {q: found.units.get(column) or asked.get(q) or "" for q, column in taken.items()}
    name = format or format_of("machine table", found.table.path).name
    return FrameSource(name, taken, {q: unit for q, unit in units.items() if unit}, tuple(notes))


def measured(
    found: MachineTable, column: str, kind: str, units: dict[str, float], asked: str | None
) -> NDArray[np.float64]:
    """One column (rows,) in mm or N.

    Parameters
    ----------
    kind : length or load, for complaints.
    units : mm or N in one of each unit.
    asked : the unit the caller says, None to take the file's.

    Raises
    ------
    InputError : no unit, an unknown one, or one that differs from `asked`; cells that are not
        finite numbers.
    """
    path, at = found.table.path, f"line {found.header}, column {column!r}"
    if asked is not None and asked not in units:
        problem = f"expected one of {', '.join(units)}, got {asked!r}"
        raise InputError(None, f"{kind}_unit", problem)
    unit = found.units[column]
    if not unit and asked is None:
        problem = f"the file does not name the unit; say {kind}_unit, one of {', '.join(units)}"
        raise InputError(path, at, problem)
    scale = scale_of(unit or asked or "", units)
    if scale is None:
        problem = f"unit {unit[:20]!r} is not one of {', '.join(units)}; convert the column"
        raise InputError(path, at, problem)
    if asked is not None and scale != units[asked]:
        problem = f"the file says {unit!r}, {kind}_unit says {asked!r}; correct one of them"
        raise InputError(path, at, problem)
    with np.errstate(over="ignore"):
        value = found.table.numbers(column) * scale
    if not np.isfinite(value).all():
        raise InputError(path, at, f"numbers too large; is the unit {unit or asked!r} right?")
    return value
