"""Read load histories of uniaxial specimens with their cycles, and logs of pressure sensors."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError, check_one_of
from ..light_dataclasses import dataclass
from .frames import Array, Frame
from .machine_tables import AS_FOUND, Channel, MachineTable, TableOptions, read_machine_table
from .quantities import distance_to_strip, is_between_grips, means, strain_columns
from .units import LENGTH_UNITS, LOAD_UNITS, PRESSURE_UNITS, STRAIN_UNITS, TIME_UNITS

QUANTITIES = ("load", "strain", "elongation", "travel", "time")
#: A strain column without a unit is taken as mm/mm if it changes by no more than this; a larger
#: change may be percent and is refused.
MAX_PLAIN_CHANGE = 0.5
#: Fewest rows between a peak and the end of its cycle that count as an unloading.
MIN_UNLOADING_ROWS = 5
#: Fewest rows of a hold after its first row.
MIN_HOLD_ROWS = 4
#: A hold is a stretch in which the curve of load over strain is followed more slowly than this
#: share of the cycle's usual speed.
HOLD_SPEED = 0.2
#: Loads, as shares of the cycle's peak, between which the rate of strain of a loading is taken.
RATE_LEVELS = (0.4, 0.9)


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """Load and strain of one specimen, reading by reading as recorded.

    Attributes
    ----------
    path : Path
        File that the history was read from.
    load : (n,) array
        Load, N; a pressure or a load per width where only its pace is asked for.
    strain : (n,) array
        Engineering strain (0.01 is 1 %).
    time : (n,) array, s, or None
        Never falls.
    travel : (n,) array, mm, or None
        Travel of the machine's crosshead.
    measured : {"extensometer", "grips"}
        Whether the strain was measured on the specimen, or follows from the machine's travel.
    notes : tuple of str
        Choices made while reading, such as which column is the strain.
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
        Column names in the file by quantity, of `QUANTITIES`. Unless named, the strain is the
        column measured closest to the specimen.
    length : float, mm, optional
        Initial distance between the points whose elongation is measured; needed where the file has
        an elongation and no strain.
    load_unit, strain_unit, length_unit : str, optional
        Units of columns for which the file names none.
    decimal, sheet, format : optional
        As in `TableOptions` and `read_machine_table`.

    Raises
    ------
    InputError
        A column or a unit is missing, or the strain does not change.
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
    return LoadHistory(
        path,
        load,
        strain,
        time=table.times(),
        travel=travel,
        measured=measured,
        notes=notes,
    )


def _columns_of_strain(table: MachineTable, columns: Mapping[str, str]) -> list[str]:
    """Return the columns of strain, that measured closest to the specimen first."""
    if "elongation" in columns:
        return []
    strains = strain_columns(table.names, table.units, columns)
    if "strain" in columns:
        return strains
    # A strain computed from the machine's travel is left to the reading of an elongation.
    return [name for name in strains if not is_between_grips(name, False)]


def _strain_of_elongation(
    table: MachineTable,
    column: str,
    channel: Channel,
    length: float | None,
) -> Array:
    """Return the strain (rows,) of an elongation column: elongation over `length` (mm)."""
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
    """Return the strain in the first of `columns`, and a note that names the column."""
    column = columns[0]
    strain, unit_note = _read_strain(table, column, channel)
    unused = f", not {' and '.join(map(repr, columns[1:]))}" if columns[1:] else ""
    name = table.table.path.name
    return strain, f"{name}: the strain is column {column!r}{unused}{unit_note}"


def _read_strain(table: MachineTable, column: str, channel: Channel) -> tuple[Array, str]:
    """Return the strain (rows,) of a column, and words on its unit if that is assumed."""
    if table.units[column] or channel.unit:
        return table.values(column, STRAIN_UNITS, channel, "strain_unit"), ""
    strain = table.table.numbers(column)
    if np.ptp(strain) > MAX_PLAIN_CHANGE:
        problem = f"changes by {np.ptp(strain):.3g} and names no unit; say strain_unit, % or mm/mm"
        raise table.error(column, problem)
    return strain, ", which names no unit: mm/mm is taken"


@dataclass(frozen=True)
class Cycle:
    """A load cycle of a history: loading from row `start` to row `peak`, then unloading to `end`.

    Attributes
    ----------
    number : int
        Number of the cycle in the history, from 1.
    start, peak, end : int
        Row indices into the history, from 0. `end` is the `start` of the next cycle, or
        the last row of the history.
    unloaded : bool
        Whether there is an unloading that can be evaluated.
    """

    number: int
    start: int
    peak: int
    end: int
    unloaded: bool = True


def find_cycles(load: Array) -> list[Cycle]:
    """Find the load cycles in loads (n,).

    A cycle counts as unloaded if at least `MIN_UNLOADING_ROWS` rows follow its peak up to its end.
    """
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
    """Find the turning points of a load history: rows of a valley, the peak after it and so on.

    The last turning point is the extreme that the history ends on.

    Parameters
    ----------
    load : (n,) array
    unloading_share : float
        Smallest fall after a peak, as a share of the rise before the peak, that makes it one.
    loading_share : float
        Smallest rise after a valley, as a share of the fall before the valley, that makes it one.
    noise_share : float
        Smallest change that counts as a turn, as a share of the range of all loads.

    Returns
    -------
    list of int
        Row indices, valleys and peaks in turn; empty where the load does not change.
    """
    noise = noise_share * np.ptp(load) if len(load) else 0.0
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
    """A hold: the machine stands still at the peak of a cycle, or at the low load after it.

    Attributes
    ----------
    cycle : int
        Number of the cycle, from 1.
    position : {"top", "bottom"}
        Whether the hold is at the peak or after the unloading.
    first, last : int
        Its first and last row in the history.
    """

    cycle: int
    position: Literal["top", "bottom"]
    first: int
    last: int


def find_holds(history: LoadHistory, cycles: Sequence[Cycle]) -> list[Hold]:
    """Find the holds in a history, in order of time.

    Parameters
    ----------
    history : LoadHistory
        Without times no hold is found.
    cycles : sequence of Cycle
        All cycles of the history.
    """
    holds: list[Hold] = []
    next_starts = [*(cycle.start for cycle in cycles[1:]), len(history.load) - 1]
    for cycle, next_start in zip(cycles, next_starts, strict=False):  # of no cycle nothing is next
        rows = slice(cycle.start, max(next_start, cycle.end) + MIN_HOLD_ROWS)
        for start, end in _slow_rows(history, rows):
            first = cycle.start + start
            last = cycle.start + end
            is_top = 2 * history.load[first] > history.load[cycle.peak] + history.load[cycle.start]
            is_beginning = first < cycle.peak and not is_top
            is_listed = any(hold.last >= first for hold in holds)
            if last - first >= MIN_HOLD_ROWS and not is_beginning and not is_listed:
                holds.append(Hold(cycle.number, "top" if is_top else "bottom", first, last))
    return holds


def _slow_rows(history: LoadHistory, rows: slice) -> list[list[int]]:
    """Return the first and last row of each slow stretch, counted from the first of `rows`.

    Of readings with the same time, as of a clock of whole seconds, the first counts.

    Speed is the length of the curve of load over strain that is covered per second, with load and
    strain each divided by its range.
    """
    if history.time is None or not np.ptp(history.strain[rows]) > 0:
        return []
    time = history.time[rows]
    numbers = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0)
    load = history.load[rows][numbers] / np.ptp(history.load[rows])
    strain = history.strain[rows][numbers] / np.ptp(history.strain[rows])
    length = np.hypot(np.diff(load), np.diff(strain))
    if not length.sum() > 0:
        return []
    speed = length / np.diff(time[numbers])
    # The usual speed is the median over the length of the curve, not over time: long holds cover
    # hardly any length.
    order = np.argsort(speed)
    usual = speed[order][np.searchsorted(np.cumsum(length[order]), 0.5 * length.sum())]
    is_slow = np.array([False, *(speed < HOLD_SPEED * usual), False])
    ends = np.flatnonzero(is_slow[1:] != is_slow[:-1])
    return numbers[ends].reshape(-1, 2).tolist()


@dataclass(frozen=True)
class Pace:
    """How fast a test was run.

    Attributes
    ----------
    rate : float, 1/s
        Rate of strain on loading; NaN where it is not known.
    hold : float, s
        Longest hold at a peak; NaN where it is not known.
    """

    rate: float = math.nan
    hold: float = math.nan


def pace_of(histories: Iterable[LoadHistory]) -> Pace:
    """Return the pace of a test: the median rate of strain of its loadings, and its longest hold.

    Parameters
    ----------
    histories : iterable of LoadHistory
        All histories of the test; those without times are passed over.
    """
    rates: list[float] = []
    durations = [0.0]
    for history in histories:
        if history.time is None:
            continue
        cycles = find_cycles(history.load)
        for cycle in cycles:
            rates += _loading_rate(history.load, history.strain, history.time, cycle)
        for hold in find_holds(history, cycles):
            if hold.position == "top":
                durations.append(history.time[hold.last] - history.time[hold.first])
    return Pace(float(np.median(rates)), max(durations)) if rates else Pace()


def _loading_rate(
    load: Array,
    strain: Array,
    time: Array,
    cycle: Cycle,
) -> list[float]:
    """Return the mean rate of strain (1/s) of a loading in a list, empty if it takes no time.

    Parameters
    ----------
    load, strain, time : (n,) array
        The history; times in s.
    cycle : Cycle
        Rows of the loading.
    """
    rows = slice(cycle.start, cycle.peak + 1)
    strain_change = change_on_branch(load[rows], strain[rows])
    duration = change_on_branch(load[rows], time[rows])
    return [strain_change / duration] if duration > 0 else []


def change_on_branch(load: Array, reading: Array) -> float:
    """Return a reading at the higher of `RATE_LEVELS` of a branch less that at the lower.

    Parameters
    ----------
    load, reading : (n,) array
        Of the branch, whose largest load the levels are shares of; NaN if a level is not passed.
    """
    lower, higher = (passage(load, reading, share * load.max())[1] for share in RATE_LEVELS)
    return float(higher - lower)


def passage(load: Array, strain: Array, level: float) -> tuple[int, float]:
    """Interpolate strain, or another reading, where the load first crosses a level.

    Parameters
    ----------
    load : (n,) array
    strain : (n,) array
        Values to interpolate linearly: strains, or times or travel of the same rows.
    level : float
        Level in the unit of the load; rising and falling crossings count alike.

    Returns
    -------
    row : int
        Last row before the crossing, -1 if there is none.
    strain : float
        Value at the crossing, NaN if there is none.
    """
    is_above = load >= level
    changes = np.flatnonzero(is_above[1:] != is_above[:-1])
    if not len(changes):
        return -1, math.nan
    row = int(changes[0])
    share = (level - load[row]) / (load[row + 1] - load[row])
    return row, strain[row] + share * (strain[row + 1] - strain[row])


def read_pressure_log(
    path: Path,
    pressure: Channel = AS_FOUND,
    time: Channel = AS_FOUND,
    format: str | None = None,
    comment: str = "#",
    decimal: str | None = None,
) -> tuple[Array, Array]:
    """Read the log of a pressure sensor, a machine table or a table of volts.

    Parameters
    ----------
    path : Path
    pressure, time : Channel
        Columns, units and scales.
    format, comment, decimal
        As in `read_machine_table` and `TableOptions`.

    Returns
    -------
    times : (k,) array, s
        Not falling.
    pressures : (k,) array, MPa

    Raises
    ------
    InputError
        The log cannot be read, or its times go back or stand still.
    """
    channels = {"time": time, "pressure": pressure}
    columns = {key: c.column for key, c in channels.items() if c.column is not None}
    options = TableOptions(columns, ("time", "pressure"), comment, decimal)
    table = read_machine_table(path, options, format)
    column = table.column("time")
    pressures = table.values(table.column("pressure"), PRESSURE_UNITS, pressure)
    times = table.values(column, TIME_UNITS, time)
    falls = np.flatnonzero(np.diff(times) < 0)
    if len(falls):
        field = f"line {table.table.lines[falls[0] + 1]}, column {column!r}"
        raise InputError(path, field, "times must not go back; is this the log of one test?")
    if len(times) < 2 or not times[-1] > times[0]:
        raise InputError(path, f"column {column!r}", "expected readings at two times or more")
    return times, pressures


def rest_limit_of(
    pressures: Array,
    deviations: float = 4.0,
    min_count: int = 10,
    rest_share: float = 0.02,
) -> float:
    """Return the pressure (MPa) below which a reading of a log is noise about zero.

    The noise is that of second differences, which drop a steady drift, of readings near zero.

    Parameters
    ----------
    pressures : (k,) array, MPa
    deviations : float
        Standard deviations of the noise up to which a reading is one at rest.
    min_count : int
        Number of second differences without which the noise counts as none.
    rest_share : float
        Share of the largest pressure below which a reading may be one at rest.
    """
    is_small = np.abs(pressures) < rest_share * pressures.max()
    differences = np.diff(pressures, 2)[is_small[:-2] & is_small[1:-1] & is_small[2:]]
    if len(differences) < min_count:
        return 0.0
    # A second difference has 1 + 4 + 1 times the variance of a reading.
    return float(deviations * np.sqrt(np.mean(differences**2) / 6.0))


def apex_height(frame: Frame, quantile: float = 0.98) -> float:
    """Return how far the apex of a frame is displaced.

    Parameters
    ----------
    frame : Frame
    quantile : float
        Share of the points that are displaced less than the apex; below 1, so that an outlier does
        not count as the apex.

    Returns
    -------
    float, mm
        NaN if no displacement is known.
    """
    distances = np.linalg.norm(frame.displacement, axis=1)
    distances = distances[np.isfinite(distances)]
    return float(np.quantile(distances, quantile)) if len(distances) else math.nan
