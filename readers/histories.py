"""Histories that turn: load over strain of a specimen through its cycles, pressures of a sheet.

A sheet may be inflated several times: inflations and releases are found in its frames' pressures.
The apex of a conditioned sheet is higher than that of the first loading at the same pressure.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, check_one_of
from . import tables
from .frames import Array
from .machine_tables import Channel, MachineTable, TableOptions, read_machine_table

QUANTITIES = ("load", "strain", "elongation", "travel", "time")
#: Of the rise before it, the part that an unloading goes back; of the unloading, that a loading
#: rises again; and of the range of all loads, the least change that is no noise.
BACK, AGAIN, FLOOR = 0.7, 0.2, 0.005
#: A strain without a unit is a number of one where it changes by less than this, else not known.
PLAIN = 0.5
#: A hold: a way along the curve slower than this share of the cycle's usual speed.
SLOW, FEWEST = 0.2, 4
#: Of the peak: the loads between which the rate of strain of a loading is taken.
RISE = (0.4, 0.9)


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """Load (n,) N, strain (n,); time (s) and machine's travel (mm) or None; where strain was."""

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
    """Read a whole load history: a plain table, or the export of an Instron, Zwick or MTS machine.

    columns : the file's own names of `QUANTITIES`. The strain is that of the column nearest to the
    specimen; length : mm between the points an elongation is of. units : where the file names none.
    """
    path = Path(path)
    named = dict(columns or {})
    for name in named:
        check_one_of(name, QUANTITIES, "columns")
    if length is not None and not length > 0:
        raise InputError(None, "length", f"expected a length above 0 mm, got {length:g}")
    along = {**named, **({"elongation": named["strain"]} if "strain" in named else {})}
    found = read_machine_table(path, TableOptions(along, decimal=decimal, sheet=sheet), format)
    force = Channel(unit=load_unit)
    way = Channel(unit=length_unit)
    load = found.values(found.column("load"), tables.LOAD_UNITS, force, "load_unit")
    names = found.names
    notes = found.notes
    # A strain that is computed from the travel is the travel's.
    strains = [] if "elongation" in named else tables.strain_columns(names, found.units, named)
    strains = [n for n in strains if "strain" in named or not tables.is_between_grips(n, False)]
    grips = False
    if strains:
        column = strains[0]
        strain, more = _strain(found, column, Channel(unit=strain_unit))
        others = f", not {' and '.join(map(repr, strains[1:]))}" if strains[1:] else ""
        notes += (f"{path.name}: the strain is column {column!r}{others}{more}",)
    else:
        column = found.column("elongation")
        if found.units[column] in tables.STRAIN_UNITS:
            strain, _ = _strain(found, column, Channel(unit=strain_unit))
        elif length is None:
            problem = "is an elongation: say the length in mm that it is of, length"
            raise found.error(column, problem)
        else:
            strain = found.values(column, tables.LENGTH_UNITS, way, "length_unit") / length
        grips = tables.is_between_grips(column, "elongation" in named)
    machine = [
        n
        for n in names
        if n
        and n != column
        and tables.means(n, "elongation")
        and tables.distance_to_strip(n)
        and found.units[n] in tables.LENGTH_UNITS
    ]
    moved = named.get("travel") or (machine[0] if machine else "")
    travel = found.values(moved, tables.LENGTH_UNITS, way, "length_unit") if moved else None
    if len(load) < 2 or not np.ptp(strain) > 0:
        raise InputError(path, f"column {column!r}", "the strain does not change: nothing to read")
    where: Literal["extensometer", "grips"] = "grips" if grips else "extensometer"
    return LoadHistory(path, load, strain, found.times(), travel, where, notes)


def _strain(found: MachineTable, column: str, channel: Channel) -> tuple[Array, str]:
    if found.units[column] or channel.unit:
        return found.values(column, tables.STRAIN_UNITS, channel, "strain_unit"), ""
    strain = found.table.numbers(column)
    if np.ptp(strain) > PLAIN:
        problem = f"changes by {np.ptp(strain):.3g} and names no unit; say strain_unit, % or mm/mm"
        raise found.error(column, problem)
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
    """Return the cycles of loads (n,); those whose unloading has fewer than 5 rows have none."""
    rows = turns(load)
    least = len(load) - 1
    cycles = []
    for k in range(0, len(rows) - 1, 2):
        end = rows[k + 2] if k + 2 < len(rows) else least
        unloaded = k + 2 < len(rows) and end - rows[k + 1] >= 5
        cycles.append(Cycle(k // 2 + 1, rows[k], rows[k + 1], end, unloaded))
    return cycles


def turns(load: Array, back: float = BACK, again: float = AGAIN, floor: float = FLOOR) -> list[int]:
    """Return rows of a valley, the peak after it, the next valley and so on."""
    least = floor * float(np.ptp(load)) if len(load) else 0.0
    if not least > 0:
        return []
    found: list[int] = []
    far, sign = 0, -1.0  # the first turn is a valley
    for i, value in enumerate(load):
        if sign * (value - load[far]) > 0:
            far = i
            continue
        before = abs(load[far] - load[found[-1]]) if found else 0.0
        if sign * (load[far] - value) > max(least, (back if sign > 0 else again) * before):
            found.append(far)
            far = i
            sign = -sign
    return [*found, far]


@dataclass(frozen=True)
class Hold:
    """Rows of a hold, first and last, of a cycle: at its top, or at its bottom after it."""

    cycle: int
    at: Literal["top", "bottom"]
    first: int
    last: int


def find_holds(history: LoadHistory, cycles: Sequence[Cycle]) -> list[Hold]:
    """Return the holds in order of time; none where the file has no time."""
    found: list[Hold] = []
    ends = [*(c.start for c in cycles[1:]), len(history.load) - 1]
    for c, end in zip(cycles, ends, strict=True):
        rows = slice(c.start, max(end, c.end) + FEWEST)
        if history.time is None or not np.ptp(history.strain[rows]) > 0:
            continue
        load, strain = (x[rows] / np.ptp(x[rows]) for x in (history.load, history.strain))
        way = np.hypot(np.diff(load), np.diff(strain))
        speed = way / np.maximum(np.diff(history.time[rows]), 1e-9)
        # Half of the way is gone slower: however long the holds are, hardly any way is theirs.
        order = np.argsort(speed)
        usual = speed[order][int(np.searchsorted(np.cumsum(way[order]), 0.5 * way.sum()))]
        slow = np.array([False, *(speed < SLOW * usual), False])
        runs = np.flatnonzero(slow[1:] != slow[:-1]).reshape(-1, 2) + c.start
        for first, last in runs.tolist():
            top = 2 * history.load[first] > history.load[c.peak] + history.load[c.start]
            before = first < c.peak and not top  # the beginning of a first loading
            if last - first >= FEWEST and not before and all(h.last < first for h in found):
                found.append(Hold(c.number, "top" if top else "bottom", first, last))
    return found


@dataclass(frozen=True)
class Pace:
    """The pace of a test: rate of strain on loading, 1/s, and longest hold, s; NaN: not known."""

    rate: float = math.nan
    hold: float = math.nan


def pace_of(histories: Iterable[LoadHistory]) -> Pace:
    """Return the median of the mean rates of all loadings, and the longest hold at a top."""
    rates = []
    holds = [0.0]
    for h in histories:
        if h.time is None:
            continue
        cycles = find_cycles(h.load)
        for c in cycles:
            up = slice(c.start, c.peak + 1)
            levels = [share * h.load[c.peak] for share in RISE]
            (a, b), (begin, end) = (
                [passage(h.load[up], x[up], level)[1] for level in levels]
                for x in (h.strain, h.time)
            )
            rates += [(b - a) / (end - begin)] * (end > begin)
        holds += [h.time[k.last] - h.time[k.first] for k in find_holds(h, cycles) if k.at == "top"]
    return Pace(float(np.median(rates)), float(max(holds))) if rates else Pace()


def passage(load: Array, strain: Array, level: float) -> tuple[int, float]:
    """Return the row before the first passage of a load level and the strain there; NaN if none."""
    side = load >= level
    change = np.flatnonzero(side[1:] != side[:-1])
    if not len(change):
        return -1, float("nan")
    i = int(change[0])
    share = (level - load[i]) / (load[i + 1] - load[i])
    return i, float(strain[i] + share * (strain[i + 1] - strain[i]))


#: Of the rise before it, what a release goes back; of the release, what an inflation rises again.
TURN = 0.3
#: The inflation that is taken, from 1, or every frame of all.
Which = int | Literal["all"]
#: Frames of an inflation, at least; pressures of the terminal.
LEAST_FRAMES, FEW = 3, 5


def branches_of(pressures: Array) -> list[NDArray[np.intp]]:
    """Return the frames of each inflation and release in turn, of frames (n,) in order of time.

    Frames without a pressure (NaN) are in none. Where nothing rises, all are one inflation.
    """
    known = np.flatnonzero(np.isfinite(pressures))
    rows = turns(pressures[known], TURN, TURN)
    if len(rows) < 2:
        return [known]
    between = [row + 1 for row in rows[1:-1]]
    ends = zip([rows[0], *between], [*between, len(known)], strict=True)
    return [known[a:b] for a, b in ends]


def has_several(pressures: Array) -> bool:
    """Return whether frames are of several inflations, and not only in another order than time."""
    inflations = branches_of(pressures)[::2]
    return len(inflations) > 1 and min(map(len, inflations)) >= LEAST_FRAMES


@dataclass(frozen=True, eq=False)
class Inflations:
    """Frames of several inflations, pressure (n,) MPa, height (n,) mm of the apex; and `taken`."""

    pressure: Array
    height: Array
    taken: Which

    @property
    def curves(self) -> list[tuple[Array, Array]]:
        """Return pressures (MPa, rising) and heights (mm) of each inflation and release in turn."""
        found = []
        for branch in branches_of(self.pressure):
            own = branch[np.isfinite(self.height[branch])]
            pressure, first = np.unique(self.pressure[own], return_index=True)
            found.append((pressure, self.height[own][first]))
        return found

    @property
    def rows(self) -> list[tuple[int, float, float, float, float, float, float]]:
        """Return a row a later inflation and common pressure, those of the first one's frames.

        Number, kPa; mm of the first inflation, of the release before this one (NaN beyond its
        pressures), of this one; mm and % that this one is higher than the first.
        """
        curves = self.curves
        found = []
        for k in range(2, len(curves), 2):
            pressures = curves[0][0]
            most, least = (f(curves[k][0]) for f in (np.max, np.min))
            for p in pressures[(pressures >= least) & (pressures <= most) & (pressures > 0)]:
                # Straight in the cube root of the pressure, as a flat sheet rises.
                first, release, now = (
                    float(np.interp(np.cbrt(p), np.cbrt(x), y, np.nan, np.nan))
                    for x, y in (curves[0], curves[k - 1], curves[k])
                )
                more = now - first
                found.append((1 + k // 2, 1e3 * p, first, release, now, more, 100 * more / first))
        return found

    @property
    def line(self) -> str:
        """Return which inflation is taken, in one line."""
        count = (len(self.curves) + 1) // 2
        if self.taken == "all":
            return f"all frames of {count} inflations are taken, in their order"
        state = "the first loading" if self.taken == 1 else "conditioned"
        said = f"inflation {self.taken} of {count}, {state}, is taken"
        return f"{said}; inflation = N or 'all' takes others"

    @property
    def lines(self) -> Sequence[str]:
        """Return how far the apex is higher at a few common pressures."""
        said = []
        for number in dict.fromkeys(row[0] for row in self.rows):
            own = [row for row in self.rows if row[0] == number]
            for _, kilo, first, _, now, more, percent in own[:: -(-len(own) // FEW)]:
                said.append(
                    f"inflation {number} at {kilo:.4g} kPa: apex {now:.4g} mm, {first:.4g} mm in "
                    f"the first: {more:+.2g} mm, {percent:+.2g} %"
                )
        return said
