"""A test machine's table: which column holds what, and its numbers in mm and N."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError
from . import tables
from .frames import Array, FrameSource
from .registry import format_of, read_file

NEEDED = ("elongation", "load")


@dataclass(frozen=True)
class TableOptions:
    """Names of columns, quantities that a table must hold, comment, decimal mark, sheet."""

    columns: Mapping[str, str] = field(default_factory=dict)
    quantities: Sequence[str] = NEEDED
    comment: str = "#"
    decimal: str | None = None
    sheet: str | None = None


@dataclass(frozen=True, eq=False)
class MachineTable:
    """A table as the file has it: units by column, line of the names, notes of choices made."""

    table: tables.TextTable
    units: Mapping[str, str]
    header: int
    notes: tuple[str, ...] = ()


def read_machine_table(
    path: Path | str, options: TableOptions = TableOptions(), format: str | None = None
) -> MachineTable:
    """Read the first table with a column of each quantity that `options` ask for."""
    table: MachineTable = read_file("machine table", path, format, options)
    return table


def column_of(
    found: MachineTable, quantity: str, named: Mapping[str, str], needed: Sequence[str] = NEEDED
) -> str:
    """Return the column of a quantity, the nearest to the strip; "" where it may be absent."""
    names = [str(name) for name in found.table.cells.columns]
    may_lack = quantity not in (*named, *needed)
    if quantity == "time" and may_lack:
        return ""
    which = tables.columns_of(names, quantity, named)
    if quantity == "elongation" and quantity not in named:
        which = tables.nearest_to_strip(names, which)
        lengths = [i for i in which if found.units[names[i]] not in tables.STRAIN_UNITS]
        which = lengths or which
    if len(which) == 1 or (not which and may_lack):
        return names[which[0]] if which else ""
    there = ", ".join(name for name in names if name)[:300]
    several = " or ".join(repr(names[i]) for i in which[:6])
    what = f"may be {several}; name one with columns" if which else "is missing"
    if len(which) > len({names[i] for i in which}) == 1:
        what = f"{names[which[0]]!r} appears twice, with other numbers; rename one in the file"
    if quantity in named:
        what = f"{named[quantity]!r} {'appears twice' if which else 'is missing'}"
    problem = f"the column of {quantity} {what}; the file has: {there}"
    raise InputError(found.table.path, f"line {found.header}", problem)


def choice_of(found: MachineTable, quantity: str, named: Mapping[str, str]) -> tuple[str, ...]:
    """Return a note where `column_of` chose one of several columns, else nothing."""
    names = [str(name) for name in found.table.cells.columns]
    which = [] if quantity in named else tables.columns_of(names, quantity, named)
    if len(which) < 2:
        return ()
    chosen = column_of(found, quantity, named)
    others = " and ".join(repr(names[i]) for i in which if names[i] != chosen)
    why = "" if tables.distance_to_strip(chosen) else ", measured on the strip"
    return (
        f"the {quantity} is column {chosen!r}{why}, not {others};"
        f" columns = {{ {quantity} = ... }} names another",
    )


def source_of(
    found: MachineTable, columns: Mapping[str, str], asked: Mapping[str, str | None],
    format: str | None, notes: Sequence[str] = (),
) -> FrameSource:  # fmt: skip
    """Return the record of what was read: columns by quantity, units of those that name none."""
    taken = {quantity: column for quantity, column in columns.items() if column}
    units = {q: found.units.get(column) or asked.get(q) or "" for q, column in taken.items()}
    name = format or format_of("machine table", found.table.path).name
    return FrameSource(name, taken, {q: unit for q, unit in units.items() if unit}, tuple(notes))


def measured(
    found: MachineTable, column: str, kind: str, units: Mapping[str, float], asked: str | None
) -> Array:
    """Return a column (rows,) in mm or N; `asked`, the caller's unit, must be the file's."""
    if asked is not None and asked not in units:
        known = ", ".join(units)
        raise InputError(None, f"{kind}_unit", f"expected one of {known}, got {asked!r}")
    return channel_values(found, column, Channel(unit=asked), units, f"{kind}_unit")


@dataclass(frozen=True, eq=False)
class MachineLoads:
    """Loads of a machine: load (k,) N; time (k,) s, None unless asked for; path of the file."""

    load: Array
    time: Array | None
    path: Path


def read_machine_loads(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    timed: bool = False,
    load_unit: Literal["N", "kN", "lbf"] | None = None,
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
    format: str | None = None,
) -> MachineLoads:
    """Read the loads of an export, with `timed` the times too; its table is found as for curves."""
    path, named = Path(path), dict(columns or {})
    needed = ("load", "time") if timed else ("load",)
    found = read_machine_table(path, TableOptions(named, needed, comment, decimal), format)
    load = measured(
        found, column_of(found, "load", named, needed), "load", tables.LOAD_UNITS, load_unit
    )
    return MachineLoads(load, _times(found, named, needed) if timed else None, path)


def read_times(
    path: Path | str,
    column: str | None = None,
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
    format: str | None = None,
) -> Array:
    """Read times (n,) in s, one a row, such as those of pictures in the camera's log."""
    named = {} if column is None else {"time": column}
    found = read_machine_table(path, TableOptions(named, ("time",), comment, decimal), format)
    return _times(found, named, ("time",))


def _times(found: MachineTable, named: Mapping[str, str], needed: tuple[str, ...]) -> Array:
    column = column_of(found, "time", named, needed)
    return channel_values(found, column, AS_FOUND, tables.TIME_UNITS)


def called_times(found: MachineTable, named: Mapping[str, str]) -> Array | None:
    """Return the column of times in s that never falls, None where the table has none."""
    names = [str(name) for name in found.table.cells.columns]
    for i in tables.columns_of(names, "time", named):
        try:
            values = _times(found, {"time": names[i]}, ("time",))
        except InputError:
            if "time" in named:
                raise
            continue
        if (np.diff(values) >= 0).all():
            return values
    return None


@dataclass(frozen=True)
class Channel:
    """A column of readings (None: by meaning): scale (per volt, or None) * reading + offset."""

    column: str | None = None
    unit: str | None = None
    scale: float | None = None
    offset: float = 0.0


#: A column that is found by what names mean, in the unit that the file says.
AS_FOUND = Channel()


def channel_values(
    found: MachineTable, column: str, channel: Channel, units: Mapping[str, float], key: str = ""
) -> Array:
    """Return a column (rows,), converted by the table `units`; times without a unit are in s."""
    own, at = found.units[column], f"line {found.header}, column {column!r}"
    if units is tables.TIME_UNITS:
        if (stamps := found.table.stamps(column)) is not None:
            return stamps
        at_the_end = re.search(rf"[_\s]({'|'.join(units)})$", column)
        own = own or (at_the_end[1] if at_the_end else "")
        channel = channel if own or channel.unit else replace(channel, unit="s")
    readings = found.table.numbers(column)
    return in_unit(readings, own, channel, units, found.table.path, at, key)


def in_unit(
    readings: Array, own: str, channel: Channel, units: Mapping[str, float], path: Path, at: str,
    key: str = "",
) -> Array:  # fmt: skip
    """Return readings (rows,) by `units` from `own`, the file's; InputError: no or two units.

    key : the caller's name of the channel's unit.
    """
    known, said = ", ".join(units), tables.scale_of(own, units) if own else None
    raw = channel.scale is not None
    factor = 1.0 if channel.scale is None else channel.scale
    if factor != 1.0 and said is not None:
        raise InputError(path, at, f"is in {own} already: leave the scale {factor:g} out")
    unit = channel.unit or ("" if raw and said is None else own)
    if not unit:
        what = "after scaling" if raw else "of the readings"
        raise InputError(path, at, f"say {key or 'the unit'} {what}, one of {known}")
    scale = tables.scale_of(unit, units)
    if scale is None:
        advice = "a sensor in volts needs scale and unit" if unit in ("V", "mV") else "convert it"
        raise InputError(path, at, f"unit {unit[:20]!r} is not one of {known}; {advice}")
    if channel.unit and own and (not raw or said is not None) and said != scale:
        asked = f"{key or 'the project'} {channel.unit!r}"
        raise InputError(path, at, f"the file says {own!r}, {asked}; correct one of them")
    with np.errstate(over="ignore"):
        value = (factor * readings + channel.offset) * scale
    if not np.isfinite(value).all():
        raise InputError(path, at, f"numbers too large; is the unit {unit!r} right?")
    return np.asarray(value)
