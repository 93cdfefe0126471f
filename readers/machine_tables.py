"""A test machine's table: which column holds what, and its numbers in mm and N."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError, check_one_of
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


@dataclass(frozen=True)
class Channel:
    """A column of readings (None: by meaning): scale (per volt, or None) * reading + offset."""

    column: str | None = None
    unit: str | None = None
    scale: float | None = None
    offset: float = 0.0


#: A column that is found by what names mean, in the unit that the file says.
AS_FOUND = Channel()


@dataclass(frozen=True, eq=False)
class MachineTable:
    """A table as the file has it: units by column, line of the names, notes of choices made.

    options, format : as `read_machine_table` was asked; a reader leaves them out.
    """

    table: tables.TextTable
    units: Mapping[str, str]
    header: int
    notes: tuple[str, ...] = ()
    options: TableOptions = TableOptions()
    format: str | None = None

    @property
    def names(self) -> list[str]:
        """Return the names of the columns."""
        return [str(name) for name in self.table.cells.columns]

    def error(self, column: str, problem: str) -> InputError:
        """Return an error about a column."""
        return InputError(self.table.path, f"line {self.header}, column {column!r}", problem)

    def column(self, quantity: str) -> str:
        """Return the column of a quantity, the nearest to the strip; "" where it may be absent."""
        names = self.names
        named = self.options.columns
        may_lack = quantity not in (*named, *self.options.quantities)
        if quantity == "time" and may_lack:
            return ""
        which = tables.columns_of(names, quantity, named)
        if quantity == "elongation" and quantity not in named:
            which = tables.nearest_to_strip(names, which)
            lengths = [i for i in which if self.units[names[i]] not in tables.STRAIN_UNITS]
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
        raise InputError(self.table.path, f"line {self.header}", problem)

    def choice(self, quantity: str) -> tuple[str, ...]:
        """Return a note where `column` chose one of several columns, else nothing."""
        names = self.names
        named = self.options.columns
        which = [] if quantity in named else tables.columns_of(names, quantity, named)
        if len(which) < 2:
            return ()
        chosen = self.column(quantity)
        others = " and ".join(repr(names[i]) for i in which if names[i] != chosen)
        why = "" if tables.distance_to_strip(chosen) else ", measured on the strip"
        return (
            f"the {quantity} is column {chosen!r}{why}, not {others};"
            f" columns = {{ {quantity} = ... }} names another",
        )

    def source(
        self, columns: Mapping[str, str], asked: Mapping[str, str | None], notes: Sequence[str] = ()
    ) -> FrameSource:
        """Return the record of what was read: columns by quantity, units where none is named."""
        taken = {quantity: column for quantity, column in columns.items() if column}
        units = {q: self.units.get(column) or asked.get(q) or "" for q, column in taken.items()}
        name = self.format or format_of("machine table", self.table.path).name
        return FrameSource(name, taken, {q: unit for q, unit in units.items() if unit}, (*notes,))

    def values(
        self, column: str, units: Mapping[str, float], channel: Channel = AS_FOUND, key: str = ""
    ) -> Array:
        """Return a column (rows,), converted by the table `units`; times without a unit are in s.

        key : the caller's argument that is the unit of the channel, which must be one of `units`.
        """
        if key:
            check_one_of(channel.unit, units, key)
        own = self.units[column]
        if units is tables.TIME_UNITS:
            if (stamps := self.table.stamps(column)) is not None:
                return stamps
            at_the_end = re.search(rf"[_\s]({'|'.join(units)})$", column)
            own = own or (at_the_end[1] if at_the_end else "")
            channel = channel if own or channel.unit else replace(channel, unit="s")
        readings = self.table.numbers(column)
        at = f"line {self.header}, column {column!r}"
        return in_unit(readings, own, channel, units, self.table.path, at, key)

    def times(self) -> Array | None:
        """Return the column of times in s that never falls, None where the table has none."""
        for i in tables.columns_of(self.names, "time", self.options.columns):
            try:
                values = self.values(self.names[i], tables.TIME_UNITS)
            except InputError:
                if "time" in self.options.columns:
                    raise
                continue
            if (np.diff(values) >= 0).all():
                return values
        return None


def read_machine_table(
    path: Path | str, options: TableOptions = TableOptions(), format: str | None = None
) -> MachineTable:
    """Read the first table with a column of each quantity that `options` ask for."""
    table: MachineTable = read_file("machine table", path, format, options)
    return replace(table, options=options, format=format)


def read_machine_loads(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    timed: bool = False,
    load_unit: Literal["N", "kN", "lbf"] | None = None,
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
    format: str | None = None,
) -> tuple[Array, Array | None]:
    """Read the loads (k,) N of an export, with `timed` the times (k,) s too, else None."""
    needed = ("load", "time") if timed else ("load",)
    found = read_machine_table(path, TableOptions(columns or {}, needed, comment, decimal), format)
    unit = Channel(unit=load_unit)
    load = found.values(found.column("load"), tables.LOAD_UNITS, unit, "load_unit")
    return load, found.values(found.column("time"), tables.TIME_UNITS) if timed else None


def read_times(
    path: Path | str,
    column: str | None = None,
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
) -> Array:
    """Read times (n,) in s, one a row, such as those of pictures in the camera's log."""
    named = {} if column is None else {"time": column}
    found = read_machine_table(path, TableOptions(named, ("time",), comment, decimal))
    return found.values(found.column("time"), tables.TIME_UNITS)


def in_unit(
    readings: Array,
    own: str,
    channel: Channel,
    units: Mapping[str, float],
    path: Path,
    at: str,
    key: str = "",
) -> Array:
    """Return readings (rows,) by `units` from `own`, the file's; InputError: no or two units.

    key : the caller's name of the channel's unit.
    """
    known = ", ".join(units)
    said = tables.scale_of(own, units) if own else None
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
