"""Read a test machine's table: find the column of each quantity, convert to mm, N, MPa and s.

A biaxial test's table holds loads and strains along both yarns.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, check_one_of
from ..light_dataclasses import dataclass
from .frames import Array, FrameSource
from .quantities import columns_of, distance_to_strip, nearest_to_strip
from .registry import format_of, read_file
from .tables import TextTable
from .units import LOAD_UNITS, STRAIN_UNITS, TIME_UNITS, scale_of

NEEDED = ("elongation", "load")


@dataclass(frozen=True)
class TableOptions:
    """Options of a reader of machine tables.

    Attributes
    ----------
    columns : mapping
        Column names in the file by quantity; other columns are found by what their names mean.
    quantities : sequence of str
        Quantities that the table must hold.
    comment : str
        Text that comment lines begin with.
    decimal : str or None
        Decimal mark; None if it is to be detected.
    sheet : str or None
        Sheet of a workbook.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    quantities: Sequence[str] = NEEDED
    comment: str = "#"
    decimal: str | None = None
    sheet: str | None = None


@dataclass(frozen=True)
class Channel:
    """A column of readings, and how they become a quantity: scale * reading + offset, in `unit`.

    Attributes
    ----------
    column : str or None
        Name of the column; None if it is found by what its name means.
    unit : str or None
        Unit of the quantity; None for the unit that the file says.
    scale : float or None
        Units of the quantity per unit of the readings, such as kPa per volt; None for 1.
    offset : float
        Value that is added to scaled readings, in the unit of the quantity.
    """

    column: str | None = None
    unit: str | None = None
    scale: float | None = None
    offset: float = 0.0


#: A column that is found by what names mean, in the unit that the file says.
AS_FOUND = Channel()


@dataclass(frozen=True, eq=False)
class MachineTable:
    """A table as the file has it.

    Attributes
    ----------
    table : TextTable
    units : mapping
        Unit by column, "" where the file has none.
    header : int
        Line of the names.
    notes : tuple of str
        Choices made while reading.
    options, format
        Arguments of `read_machine_table`, which adds them; readers of formats leave them out.
    """

    table: TextTable
    units: Mapping[str, str]
    header: int
    notes: tuple[str, ...] = ()
    options: TableOptions = TableOptions()
    format: str | None = None

    @property
    def names(self) -> list[str]:
        """Return the names of the columns."""
        return self.table.names

    def error(self, column: str, problem: str) -> InputError:
        """Return an error about a column."""
        return InputError(self.table.path, f"line {self.header}, column {column!r}", problem)

    def specimens(self, column: str) -> list[str]:
        """Return the specimen's name in each row; InputError where a cell has none."""
        names = self.table.text(column)
        for line, name in zip(self.table.lines, names, strict=True):
            if not name:
                field = f"line {line}, column {column!r}"
                problem = "expected the specimen's name, found nothing"
                raise InputError(self.table.path, field, problem)
        return names

    def column(self, quantity: str) -> str:
        """Return the name of the column of a quantity.

        Of several elongations it is the one measured closest to the strip.

        Returns
        -------
        str
            Name of the column, "" where the table has none and need not have one.

        Raises
        ------
        InputError
            The column is missing, or several columns may be meant.
        """
        is_optional = quantity not in (*self.options.columns, *self.options.quantities)
        if quantity == "time" and is_optional:
            return ""
        candidates = self._candidates(quantity)
        if len(candidates) == 1:
            return candidates[0]
        if not candidates and is_optional:
            return ""
        names = ", ".join(name for name in self.names if name)[:300]
        state = self._describe_candidates(quantity, candidates)
        problem = f"the column of {quantity} {state}; the file has: {names}"
        raise InputError(self.table.path, f"line {self.header}", problem)

    def _candidates(self, quantity: str) -> list[str]:
        """Return the columns that may hold a quantity."""
        names = self.names
        indices = columns_of(names, quantity, self.options.columns)
        if quantity != "elongation" or quantity in self.options.columns:
            return [names[i] for i in indices]
        candidates = [names[i] for i in nearest_to_strip(names, indices)]
        return [name for name in candidates if self.units[name] not in STRAIN_UNITS] or candidates

    def _describe_candidates(self, quantity: str, candidates: Sequence[str]) -> str:
        """Describe why a quantity has no column."""
        if quantity in self.options.columns:
            state = "appears twice" if candidates else "is missing"
            return f"{self.options.columns[quantity]!r} {state}"
        if not candidates:
            return "is missing"
        if len({*candidates}) == 1:
            return f"{candidates[0]!r} appears twice, with other numbers; rename one in the file"
        return f"may be {' or '.join(map(repr, candidates[:6]))}; name one with columns"

    def choice(self, quantity: str) -> tuple[str, ...]:
        """Return a note where `column` chose one of several columns, else nothing."""
        if quantity in self.options.columns:
            return ()
        candidates = [self.names[i] for i in columns_of(self.names, quantity, {})]
        if len(candidates) < 2:
            return ()
        column = self.column(quantity)
        unused = " and ".join(repr(name) for name in candidates if name != column)
        reason = "" if distance_to_strip(column) else ", measured on the strip"
        return (
            f"the {quantity} is column {column!r}{reason}, not {unused};"
            f" columns = {{ {quantity} = ... }} names another",
        )

    def source(
        self,
        columns: Mapping[str, str],
        units: Mapping[str, str | None],
        notes: Sequence[str] = (),
    ) -> FrameSource:
        """Return the record of what was read.

        Parameters
        ----------
        columns : mapping
            Column by quantity, "" where there is none.
        units : mapping
            The caller's unit by quantity, for columns without one.
        notes : sequence of str
        """
        columns = {quantity: column for quantity, column in columns.items() if column}
        units = {q: self.units.get(column) or units.get(q) for q, column in columns.items()}
        name = self.format or format_of("machine table", self.table.path).name
        return FrameSource(name, columns, {q: u for q, u in units.items() if u}, tuple(notes))

    def values(
        self,
        column: str,
        units: Mapping[str, float],
        channel: Channel = AS_FOUND,
        key: str = "",
        holes: bool = False,
    ) -> Array:
        """Return the numbers of a column in the base unit.

        Parameters
        ----------
        column : str
        units : mapping
            Table of units of the quantity; times without a unit are in s.
        channel : Channel
            What the caller says of the column.
        key : str
            Argument of the caller, for messages, that gives the unit of the channel.
        holes : bool
            Whether cells may stand for no value; they give NaN.

        Returns
        -------
        (rows,) array

        Raises
        ------
        InputError
            A cell is no number, or the unit is missing, unknown or contradicted.
        """
        if key:
            check_one_of(channel.unit, units, key)
        unit = self.units[column]
        if units is TIME_UNITS:
            stamps = self.table.stamps(column)
            if stamps is not None:
                return stamps
            match = re.search(rf"[_\s/,]({'|'.join(units)})$", column)
            if not unit and match:
                unit = match[1]
            if not unit and not channel.unit:
                channel = replace(channel, unit="s")
        readings = self.table.numbers(column, holes)
        location = f"line {self.header}, column {column!r}"
        return in_unit(
            readings,
            unit,
            channel,
            units,
            self.table.path,
            location,
            key,
        )

    def times(self) -> Array | None:
        """Return the first column of times (s) that never fall; None where the table has none.

        Raise InputError where the times of a column that the options name fall.
        """
        for index in columns_of(self.names, "time", self.options.columns):
            try:
                times = self.values(self.names[index], TIME_UNITS)
            except InputError:
                if "time" in self.options.columns:
                    raise
                continue
            if (np.diff(times) >= 0).all():
                return times
            if "time" in self.options.columns:
                problem = "these times fall, as of a clock that restarts with each cycle"
                raise self.error(self.names[index], f"{problem}; name times of the whole test")
        return None


def read_machine_table(
    path: Path | str, options: TableOptions, format: str | None = None
) -> MachineTable:
    """Read the first table with a column of each quantity that the options require.

    Parameters
    ----------
    path : path
        Export of a test machine: text, workbook, or a plug-in's format.
    options : TableOptions
    format : str, optional
        Name of the format; recognised by the content if omitted.

    Raises
    ------
    InputError
        There is no such table, or it may be read in two ways.
    """
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
    """Read the loads of a test machine's export, and their times if wanted.

    Parameters
    ----------
    path : path
    columns : mapping, optional
        Column names in the file of `load` and `time`.
    timed : bool
        Whether times are required.
    load_unit : {"N", "kN", "lbf"}, optional
        Unit of loads where the file names none.
    comment, decimal, format
        As in `TableOptions` and `read_machine_table`.

    Returns
    -------
    loads : (k,) array, N
    times : (k,) array, s, or None
    """
    quantities = ("load", "time") if timed else ("load",)
    options = TableOptions(columns or {}, quantities, comment, decimal)
    table = read_machine_table(path, options, format)
    channel = Channel(unit=load_unit)
    loads = table.values(table.column("load"), LOAD_UNITS, channel, "load_unit")
    return loads, table.values(table.column("time"), TIME_UNITS) if timed else None


def read_times(
    path: Path | str,
    column: str | None = None,
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
) -> Array:
    """Read a column of times, such as those of pictures in a camera's log.

    Parameters
    ----------
    path : path
    column : str, optional
        Name of the column; found by its meaning if omitted.
    comment, decimal
        As in `TableOptions`.

    Returns
    -------
    (n,) array, s
    """
    columns = {} if column is None else {"time": column}
    table = read_machine_table(path, TableOptions(columns, ("time",), comment, decimal))
    return table.values(table.column("time"), TIME_UNITS)


def in_unit(
    readings: Array,
    file_unit: str,
    channel: Channel,
    units: Mapping[str, float],
    path: Path,
    location: str,
    key: str = "",
) -> Array:
    """Return readings in the base unit of a table of units.

    Parameters
    ----------
    readings : (rows,) array
    file_unit : str
        Unit that the file says, "" if it says none.
    channel : Channel
    units : mapping
    path : Path
    location : str
        Line and column, for messages.
    key : str
        The caller's name of the channel's unit, "" for that of a project.

    Raises
    ------
    InputError
        No unit, or two that contradict each other; numbers that are too large.
    """
    is_known = bool(file_unit) and scale_of(file_unit, units) is not None
    unit = channel.unit or (file_unit if channel.scale is None or is_known else "")
    try:
        scale = _scale(unit, file_unit, channel, units, key)
    except ValueError as error:
        raise InputError(path, location, str(error)) from None
    factor = 1.0 if channel.scale is None else channel.scale
    with np.errstate(over="ignore"):
        values = np.asarray((factor * readings + channel.offset) * scale)
    if np.isinf(values).any():
        raise InputError(path, location, f"numbers too large; is the unit {unit!r} right?")
    return values


def _known_scale(unit: str, units: Mapping[str, float]) -> float:
    """Return the size of a unit in base units; ValueError for a unit that is not in `units`."""
    scale = scale_of(unit, units)
    if scale is None:
        advice = "a sensor in volts needs scale and unit" if unit in ("V", "mV") else "convert it"
        raise ValueError(f"unit {unit[:20]!r} is not one of {', '.join(units)}; {advice}")
    return scale


def _scale(
    unit: str,
    file_unit: str,
    channel: Channel,
    units: Mapping[str, float],
    key: str,
) -> float:
    """Return the size of a unit in base units.

    ValueError is raised, with the reason, where there is no unit or it contradicts the file.
    """
    file_scale = scale_of(file_unit, units) if file_unit else None
    is_scaled = channel.scale is not None
    if file_scale is not None and channel.scale not in (None, 1.0):
        raise ValueError(f"is in {file_unit} already: leave the scale {channel.scale:g} out")
    if not unit:
        stage = "after scaling" if is_scaled else "of the readings"
        raise ValueError(f"say {key or 'the unit'} {stage}, one of {', '.join(units)}")
    scale = _known_scale(unit, units)
    is_comparable = file_scale is not None or (file_unit and not is_scaled)
    if channel.unit and is_comparable and file_scale != scale:
        statement = f"{key or 'the project'} {channel.unit!r}"
        raise ValueError(f"the file says {file_unit!r}, {statement}; correct one of them")
    return scale


@dataclass(frozen=True, eq=False)
class BiaxialTable:
    """Readings of a cruciform loaded along both yarns.

    Attributes
    ----------
    path : Path or None
        File of the readings; None if they were given as arrays.
    load : (n, 2) array, N/mm
        Loads per width along warp and fill.
    strain : (n, 2) array
        Strains along warp and fill (0.01 is 1 %).
    ratio : tuple of n str or None
        Load ratio warp:fill of each reading, such as "2:1", where it is stated.
    lines : (n,) array of int
        Line of the file of each reading.
    source : FrameSource
        Format, columns and units that were read.
    time : (n,) array, s, or None
        Time of each reading.
    argument : str
        Argument that error messages name where there is no file.
    name : str
        Name of the table in results: that of the file.
    partner : BiaxialTable or None
        Table of the readings along the fill, where they are in a file of their own.
    """

    path: Path | None
    load: Array
    strain: Array
    ratio: tuple[str, ...] | None
    lines: NDArray[np.intp]
    source: FrameSource
    time: Array | None = None
    argument: str = ""
    name: str = ""
    partner: BiaxialTable | None = None
