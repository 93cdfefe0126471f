"""Histories that turn: load over strain of a specimen through its cycles and holds."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError, check_one_of
from .frames import Array
from .machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from .quantities import distance_to_strip, is_between_grips, means, strain_columns
from .units import LENGTH_UNITS, LOAD_UNITS, STRAIN_UNITS

QUANTITIES = ("load", "strain", "elongation", "travel", "time")
#: A strain without a unit is a number of one where it changes by less than this, else not known.
MAX_PLAIN_CHANGE = 0.5
#: Rows of an unloading at least.
MIN_UNLOADING_ROWS = 5
#: Rows of a hold at least, beside the first.
MIN_HOLD_ROWS = 4
#: A hold: a path along the curve slower than this share of the cycle's usual speed.
HOLD_SPEED = 0.2
#: Of the peak: the loads between which the rate of strain of a loading is taken.
RATE_LEVELS = (0.4, 0.9)


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """Load over strain of one specimen, as recorded.

    Attributes
    ----------
    load : (n,) array, N
    strain : (n,) array
    time : (n,) array, s, or None
    travel : (n,) array, mm, or None
        Of the machine.
    measured : {"extensometer", "grips"}
        Where the strain was measured.
    notes : tuple of str
        Choices made while reading.
    """

    path: Path
    load: Array
    strain: Array
    time: Array | None = None
    travel: Array | None = None
    measured: Literal["extensometer", "grips"] = "extensometer"
    notes: tuple[str, ...] = ()


def read_history(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    length: float | None = None,
    load_unit: str | None = None,
    strain_unit: str | None = None,
    length_unit: str | None = None,
    decimal: Literal[".", ","] | None = None,
    sheet: str | None = None,
    format: str | None = None,
) -> LoadHistory:
    """Read a load history from a plain table, or the export of an Instron, Zwick or MTS machine.

    Parameters
    ----------
    path : path
    columns : mapping, optional
        The file's names of `QUANTITIES`; otherwise the strain is that of the column nearest to the
        specimen.
    length : float, mm, optional
        Distance of the points that an elongation is measured between.
    load_unit, strain_unit, length_unit : str, optional
        Units where the file names none.
    decimal, sheet, format : optional
        As in `TableOptions` and `read_machine_table`.

    Raises
    ------
    InputError
        The table has no such columns or no unit, or its strain does not change.
    """
    path = Path(path)
    columns = dict(columns or {})
    for quantity in columns:
        check_one_of(quantity, QUANTITIES, "columns")
    if length is not None and not length > 0:
        raise InputError(None, "length", f"expected a length above 0 mm, got {length:g}")
    table_columns = {**columns, "elongation": columns["strain"]} if "strain" in columns else columns
    options = TableOptions(table_columns, decimal=decimal, sheet=sheet)
    table = read_machine_table(path, options, format)
    load = table.values(table.column("load"), LOAD_UNITS, Channel(unit=load_unit), "load_unit")
    channel = Channel(unit=length_unit)
    strain_channel = Channel(unit=strain_unit)
    notes = table.notes
    is_travel = False
    strains = _columns_of_strain(table, columns)
    if strains:
        column = strains[0]
        strain, note = _strain_with_note(table, strains, strain_channel)
        notes = (*notes, note)
    else:
        column = table.column("elongation")
        is_travel = is_between_grips(column, "elongation" in columns)
        if table.units[column] in STRAIN_UNITS:
            strain, _ = _read_strain(table, column, strain_channel)
        else:
            strain = _strain_of_elongation(table, column, channel, length)
    travel_column = columns.get("travel") or _travel_column(table, column)
    travel = None
    if travel_column:
        travel = table.values(travel_column, LENGTH_UNITS, channel, "length_unit")
    if len(load) < 2 or not np.ptp(strain) > 0:
        raise InputError(path, f"column {column!r}", "the strain does not change: nothing to read")
    measured: Literal["extensometer", "grips"] = "grips" if is_travel else "extensometer"
    return LoadHistory(path, load, strain, table.times(), travel, measured, notes)


def _columns_of_strain(table: MachineTable, columns: Mapping[str, str]) -> list[str]:
    """Return the columns of strains of the specimen, the nearest to it first."""
    if "elongation" in columns:
        return []
    strains = strain_columns(table.names, table.units, columns)
    if "strain" in columns:
        return strains
    # A strain that is computed from the travel is the travel's.
    return [name for name in strains if not is_between_grips(name, False)]


def _strain_of_elongation(
    table: MachineTable, column: str, channel: Channel, length: float | None
) -> Array:
    """Return the strain (rows,) of an elongation over a length in mm."""
    if length is None:
        problem = "is an elongation: say the length in mm that it is of, length"
        raise table.error(column, problem)
    return table.values(column, LENGTH_UNITS, channel, "length_unit") / length


def _travel_column(table: MachineTable, strain_column: str) -> str:
    """Return the column of the machine's travel, "" where there is none."""
    for name in table.names:
        if not name or name == strain_column or table.units[name] not in LENGTH_UNITS:
            continue
        if means(name, "elongation") and distance_to_strip(name):
            return name
    return ""


def _strain_with_note(
    table: MachineTable, columns: Sequence[str], channel: Channel
) -> tuple[Array, str]:
    """Return the strain in the first of its columns, and a note that says which it is."""
    column = columns[0]
    strain, unit_note = _read_strain(table, column, channel)
    unused = f", not {' and '.join(map(repr, columns[1:]))}" if columns[1:] else ""
    name = table.table.path.name
    return strain, f"{name}: the strain is column {column!r}{unused}{unit_note}"


def _read_strain(table: MachineTable, column: str, channel: Channel) -> tuple[Array, str]:
    """Return a strain (rows,), and a note on a unit that is assumed."""
    if table.units[column] or channel.unit:
        return table.values(column, STRAIN_UNITS, channel, "strain_unit"), ""
    strain = table.table.numbers(column)
    if np.ptp(strain) > MAX_PLAIN_CHANGE:
        problem = f"changes by {np.ptp(strain):.3g} and names no unit; say strain_unit, % or mm/mm"
        raise table.error(column, problem)
    return strain, ", which names no unit: mm/mm is taken"


@dataclass(frozen=True)
class Cycle:
    """Rows of a cycle, from 1: loading from `start` to `peak`, unloading from there to `end`."""

    number: int
    start: int
    peak: int
    end: int
    unloaded: bool = True


def find_cycles(load: Array) -> list[Cycle]:
    """Return the cycles of loads (n,); an unloading of fewer than 5 rows is none."""
    rows = turns(load)
    last = len(load) - 1
    cycles = []
    for k in range(0, len(rows) - 1, 2):
        is_last = k + 2 >= len(rows)
        end = last if is_last else rows[k + 2]
        is_unloaded = not is_last and end - rows[k + 1] >= MIN_UNLOADING_ROWS
        cycles.append(Cycle(k // 2 + 1, rows[k], rows[k + 1], end, is_unloaded))
    return cycles


def turns(
    load: Array,
    unloading_share: float = 0.7,
    loading_share: float = 0.2,
    noise_share: float = 0.005,
) -> list[int]:
    """Return the rows of a valley, the peak after it, the next valley and so on.

    Parameters
    ----------
    load : (n,) array
    unloading_share : float
        Part of the rise before it that an unloading goes back.
    loading_share : float
        Part of the unloading before it that a loading rises again.
    noise_share : float
        Of the range of all loads, the least change that is no noise.
    """
    noise = noise_share * float(np.ptp(load)) if len(load) else 0.0
    if not noise > 0:
        return []
    rows: list[int] = []
    extreme = 0
    sign = -1.0  # the first turn is a valley
    for row, value in enumerate(load):
        if sign * (value - load[extreme]) > 0:
            extreme = row
            continue
        previous_change = abs(load[extreme] - load[rows[-1]]) if rows else 0.0
        share = unloading_share if sign > 0 else loading_share
        if sign * (load[extreme] - value) > max(noise, share * previous_change):
            rows.append(extreme)
            extreme = row
            sign = -sign
    return [*rows, extreme]


@dataclass(frozen=True)
class Hold:
    """Rows of a hold, first and last, of a cycle: at its top, or at its bottom after it."""

    cycle: int
    at: Literal["top", "bottom"]
    first: int
    last: int


def find_holds(history: LoadHistory, cycles: Sequence[Cycle]) -> list[Hold]:
    """Return the holds of a history in order of time; none where the file has no time."""
    holds: list[Hold] = []
    next_starts = [*(cycle.start for cycle in cycles[1:]), len(history.load) - 1]
    for cycle, next_start in zip(cycles, next_starts, strict=True):
        rows = slice(cycle.start, max(next_start, cycle.end) + MIN_HOLD_ROWS)
        for start, end in _slow_rows(history, rows):
            first = cycle.start + start
            last = cycle.start + end
            is_top = 2 * history.load[first] > history.load[cycle.peak] + history.load[cycle.start]
            is_beginning = first < cycle.peak and not is_top
            is_known = any(hold.last >= first for hold in holds)
            if last - first >= MIN_HOLD_ROWS and not is_beginning and not is_known:
                holds.append(Hold(cycle.number, "top" if is_top else "bottom", first, last))
    return holds


def _slow_rows(history: LoadHistory, rows: slice) -> list[list[int]]:
    """Return first and last row of each slow stretch of some rows, counted from the first of them.

    Speeds are those along the curve of load over strain, each as a share of its range.
    """
    if history.time is None or not np.ptp(history.strain[rows]) > 0:
        return []
    load = history.load[rows] / np.ptp(history.load[rows])
    strain = history.strain[rows] / np.ptp(history.strain[rows])
    path = np.hypot(np.diff(load), np.diff(strain))
    speed = path / np.maximum(np.diff(history.time[rows]), 1e-9)
    # Half of the path is passed slower: however long holds are, hardly any of the path is theirs.
    order = np.argsort(speed)
    usual = speed[order][int(np.searchsorted(np.cumsum(path[order]), 0.5 * path.sum()))]
    is_slow = np.array([False, *(speed < HOLD_SPEED * usual), False])
    stretches: list[list[int]] = np.flatnonzero(is_slow[1:] != is_slow[:-1]).reshape(-1, 2).tolist()
    return stretches


@dataclass(frozen=True)
class Pace:
    """The pace of a test: rate of strain on loading, 1/s, and longest hold, s; NaN: not known."""

    rate: float = math.nan
    hold: float = math.nan


def pace_of(histories: Iterable[LoadHistory]) -> Pace:
    """Return the median of the mean rates of all loadings, and the longest hold at a top."""
    rates: list[float] = []
    durations = [0.0]
    for history in histories:
        if history.time is None:
            continue
        cycles = find_cycles(history.load)
        for cycle in cycles:
            rates += _loading_rate(history.load, history.strain, history.time, cycle)
        for hold in find_holds(history, cycles):
            if hold.at == "top":
                durations.append(history.time[hold.last] - history.time[hold.first])
    return Pace(float(np.median(rates)), float(max(durations))) if rates else Pace()


def _loading_rate(load: Array, strain: Array, time: Array, cycle: Cycle) -> list[float]:
    """Return the mean rate of strain (1/s) of a loading; nothing where it takes no time."""
    rows = slice(cycle.start, cycle.peak + 1)
    levels = [share * load[cycle.peak] for share in RATE_LEVELS]
    strains = [passage(load[rows], strain[rows], level)[1] for level in levels]
    times = [passage(load[rows], time[rows], level)[1] for level in levels]
    duration = times[1] - times[0]
    return [(strains[1] - strains[0]) / duration] if duration > 0 else []


def passage(load: Array, strain: Array, level: float) -> tuple[int, float]:
    """Return where a curve passes a load level first.

    Parameters
    ----------
    load, strain : (n,) arrays
    level : float
        In the unit of the load.

    Returns
    -------
    row : int
        Last row before the passage, -1 if there is none.
    strain : float
        Strain at the passage, NaN if there is none.
    """
    is_above = load >= level
    changes = np.flatnonzero(is_above[1:] != is_above[:-1])
    if not len(changes):
        return -1, float("nan")
    row = int(changes[0])
    share = (level - load[row]) / (load[row + 1] - load[row])
    return row, float(strain[row] + share * (strain[row + 1] - strain[row]))
