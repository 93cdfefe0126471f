"""Load cycles of a biaxial test: their ratios warp:fill, loading branches to evaluate, and tables.

A cycle begins where the larger of the two loads (warp, fill) turns from falling to rising. Turns
that are small beside the range of loads are noise or a hold, and begin no cycle. Tables have loads
per width and strains along warp and fill.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from ...errors import InputError, check_one_of
from ...materials.designers import RATIOS, shares
from ...readers.histories import turns
from ...readers.machine_tables import (
    BiaxialTable,
    Channel,
    MachineTable,
    TableOptions,
    read_machine_table,
)
from ...readers.quantities import PAIRS
from ...readers.units import LOAD_UNITS, STRAIN_UNITS, WIDTH_LOAD_UNITS, scale_of
from ...solvers.base import Array

#: Ratios among which that of a pair of measured loads is looked for.
USUAL_RATIOS = (*RATIOS, "3:1", "1:3", "3:2", "2:3", "4:1", "1:4", "5:1", "1:5")


def canonical_ratio(ratio: str) -> str:
    """Return the canonical spelling of a ratio: "2:1" for "2/1", "2.0 : 1" and "4:2"."""
    warp, fill = shares(ratio)
    smallest = min(share for share in (warp, fill) if share > 0)
    multiples = [round(share / smallest, 3) for share in (warp, fill)]
    for factor in range(1, 6):
        scaled = [factor * multiple for multiple in multiples]
        if all(math.isclose(x, round(x), abs_tol=0.005 * factor) for x in scaled):
            return ":".join(f"{round(x)}" for x in scaled)
    return f"{round(warp, 3):g}:{round(fill, 3):g}"


def nearest_ratio(loads: Sequence[float], *, tolerance: float = 4.0) -> str:
    """Return the usual ratio closest to a pair of loads, or their own ratio where none is close.

    Parameters
    ----------
    loads : (2,) sequence
        Loads along warp and fill; negative ones count as zero.
    tolerance : float, degrees
        Largest angle between the loads and a usual ratio as vectors (warp, fill).

    Examples
    --------
    >>> nearest_ratio([30.0, 14.8]), nearest_ratio([25.0, 0.5])
    ('2:1', '1:0')
    """
    warp, fill = (max(load, 0.0) for load in loads)
    larger = max(warp, fill)
    angle = math.degrees(math.atan2(fill, warp))
    deviations = {
        name: abs(math.degrees(math.atan2(*shares(name)[::-1])) - angle) for name in USUAL_RATIOS
    }
    best = min(deviations, key=lambda name: deviations[name])
    if deviations[best] <= tolerance or not larger > 0:
        return best
    return f"{warp / larger:.2g}:{fill / larger:.2g}"


@dataclass(frozen=True)
class LoadCycle:
    """One load cycle of a biaxial test.

    Attributes
    ----------
    ratio : str
        Load ratio warp:fill, such as "2:1".
    phase : int
        Number of the cycle's phase in the file, from 1. A phase is a run of consecutive cycles at
        one ratio.
    number : int
        Number of the cycle within its phase, from 1.
    number_in_file : int
        Number of the cycle within the file, from 1, whatever the ratio.
    first, last : int
        First and last row of the loading: the last row within 1 % of the cycle's range above its
        lowest load, and the first row after it within 1 % of its highest load.
    """

    ratio: str
    phase: int
    number: int
    number_in_file: int
    first: int
    last: int


def find_cycles(load: Array, labels: Sequence[str] | None = None) -> list[LoadCycle]:
    """Find the load cycles of a file, in the order in which they were measured.

    Parameters
    ----------
    load : (n, 2) array
        Loads along warp and fill, in any unit.
    labels : (n,) sequence of str or None
        Ratio of each row; no cycle goes on where it changes. Without labels the ratio of a cycle
        is that of the loads at its highest load.
    """
    load = np.asarray(load)
    larger = load.max(axis=1)
    changes = []
    if labels is not None:
        changes = [row for row in range(1, len(labels)) if labels[row] != labels[row - 1]]
    cycles: list[LoadCycle] = []
    for start, stop in pairwise([0, *changes, len(larger)]):
        label = labels[start] if labels is not None and stop > start else None
        for first, last in _loadings(larger[start:stop]):
            first_row = start + first
            last_row = start + last
            # The prestress, equal along warp and fill, is subtracted before the ratio is taken.
            lowest = load[first_row]
            ratio = label or nearest_ratio(load[last_row] - np.minimum(lowest, lowest.min()))
            phase, number = _place_in_phases(ratio, cycles)
            cycle = LoadCycle(
                ratio=ratio,
                phase=phase,
                number=number,
                number_in_file=len(cycles) + 1,
                first=first_row,
                last=last_row,
            )
            cycles.append(cycle)
    return cycles


def _place_in_phases(ratio: str, cycles: Sequence[LoadCycle]) -> tuple[int, int]:
    """Return the phase, and the number within it, of a cycle of a ratio that follows `cycles`."""
    if not cycles:
        return 1, 1
    previous = cycles[-1]
    if previous.ratio == ratio:
        return previous.phase, previous.number + 1
    return previous.phase + 1, 1


def _loadings(
    load: Array, *, smallest_turn: float = 0.2, hold: float = 0.01
) -> list[tuple[int, int]]:
    """Return the first and the last row of every loading branch in loads (n,).

    Parameters
    ----------
    load : (n,) array
        Larger of the two loads of each row.
    smallest_turn : float
        Smallest change of load between two turning points, as a share of the range of `load`;
        smaller changes are taken for noise or a hold.
    hold : float
        Share of a cycle's range of loads. Rows within it of the lowest and of the highest load are
        holds at the prestress and at the peak, in which the fabric creeps, and no part of the
        loading.
    """
    rows = turns(load, 0.0, 0.0, smallest_turn)
    loadings = []
    for low, high in zip(rows[::2], rows[1::2], strict=False):
        margin = hold * (load[high] - load[low])
        rising = load[low : high + 1]
        first = low + int(np.flatnonzero(rising <= load[low] + margin)[-1])
        last = first + int(np.flatnonzero(load[first : high + 1] >= load[high] - margin)[0])
        loadings.append((first, last))
    return loadings


#: Which cycle of a ratio is evaluated: the last of its phase, or the one with this number (from 1,
#: counted after the conditioning cycles).
CycleChoice = int | Literal["last"]


@dataclass(frozen=True, eq=False)
class BiaxialPath:
    """The loading branch of one cycle, which a law is fitted to or constants are taken from.

    Attributes
    ----------
    table : BiaxialTable
        The file, or arrays, that the branch is taken from.
    cycle : LoadCycle
        The cycle that the branch belongs to.
    cycle_count : int
        How many cycles its phase has, without conditioning cycles.
    load : (n, 2) array, N/mm
        Loads per width along warp and fill.
    strain : (n, 2) array
        Strains along warp and fill as recorded in the file (0.01 is 1 %).
    """

    table: BiaxialTable
    cycle: LoadCycle
    cycle_count: int
    load: Array
    strain: Array

    @property
    def larger(self) -> Array:
        """Return the larger of the loads along warp and fill in every row, (n,) N/mm."""
        return self.load.max(axis=1)

    @property
    def ratio(self) -> str:
        return self.cycle.ratio

    @property
    def residual(self) -> Array:
        """Return the strain (2,) where the loading begins less that of the file's first row."""
        return self.strain[0] - self.table.strain[0]

    @property
    def strain_change(self) -> Array:
        """Return the strain (n, 2) less that at the beginning of the loading."""
        return self.strain - self.strain[0]

    def between(self, lowest: float, highest: float) -> BiaxialPath:
        """Return the part of the path whose larger load lies from `lowest` to `highest` (N/mm).

        Raises
        ------
        InputError
            Fewer than two rows lie between these loads.
        """
        larger = self.larger
        is_between = (larger >= lowest * (1 - 1e-9)) & (larger <= highest * (1 + 1e-9))
        if is_between.sum() < 2:
            problem = (
                f"fewer than two rows of ratio {self.ratio} lie between {lowest:g} and "
                f"{highest:g} kN/m; its loading goes from {larger.min():.4g} to {larger.max():.4g}"
            )
            raise InputError(self.table.path, self.table.argument, problem)
        return replace(self, load=self.load[is_between], strain=self.strain[is_between])

    def thinned(self, max_rows: int) -> BiaxialPath:
        """Return the path with at most `max_rows` rows, evenly spaced over the larger load.

        The first and the last row are always kept.
        """
        if len(self.load) <= max_rows:
            return self
        larger = np.maximum.accumulate(self.larger)
        levels = np.linspace(larger[0], larger[-1], max_rows)
        rows = np.unique(np.clip(np.searchsorted(larger, levels), 0, len(larger) - 1))
        rows[-1] = len(larger) - 1
        return replace(self, load=self.load[rows], strain=self.strain[rows])


def evaluated_paths(
    tables: Sequence[BiaxialTable],
    cycles: Sequence[Sequence[LoadCycle]],
    choice: CycleChoice = "last",
    conditioning: int = 0,
    ratios: Collection[str] | None = None,
) -> list[BiaxialPath]:
    """Return the loading branch of one cycle of each ratio.

    Where a ratio comes in several phases, the first phase after the conditioning counts.

    Parameters
    ----------
    tables : sequence of BiaxialTable
        Files of the test.
    cycles : sequence of sequences of LoadCycle
        Cycles of each table, in the same order.
    choice : int or "last"
        Which cycle of the phase: its number from 1, or the last.
    conditioning : int
        Number of cycles at the beginning of each file that are not evaluated.
    ratios : collection of str or None
        Ratios that are evaluated; all of the files unless given.

    Returns
    -------
    list of BiaxialPath
        One path for each ratio: those of `RATIOS` in their order, then the others by name.

    Raises
    ------
    InputError
        A ratio has no cycle after the conditioning, or fewer cycles than `choice`.
    """
    paths: dict[str, BiaxialPath] = {}
    for table, cycles_of_table in zip(tables, cycles, strict=True):
        for phase in phases_of(cycles_of_table[conditioning:]):
            ratio = phase[0].ratio
            is_evaluated = ratios is None or ratio in ratios
            if is_evaluated and ratio not in paths:
                paths[ratio] = _path_of_phase(table, phase, choice)
    missing = [ratio for ratio in ratios or () if ratio not in paths]
    if missing or not paths:
        problem = f"no cycle of ratio {', '.join(missing) or 'any'} after the conditioning"
        argument = tables[0].argument.partition("[")[0]
        measured = f"the ratios there: {_measured_ratios(cycles)}"
        raise InputError(tables[0].path, argument, f"{problem}; {measured}")
    order = {ratio: k for k, ratio in enumerate(RATIOS)}
    return sorted(paths.values(), key=lambda path: (order.get(path.ratio, len(order)), path.ratio))


def _measured_ratios(cycles: Sequence[Sequence[LoadCycle]]) -> str:
    """Return the ratios of all cycles, each once."""
    ratios = [cycle.ratio for cycles_of_table in cycles for cycle in cycles_of_table]
    return ", ".join(dict.fromkeys(ratios))


def phases_of(cycles: Sequence[LoadCycle]) -> list[list[LoadCycle]]:
    """Return the cycles of each phase of a file, in the order of the phases."""
    return [list(phase) for _, phase in groupby(cycles, key=lambda cycle: cycle.phase)]


def _path_of_phase(
    table: BiaxialTable, phase: Sequence[LoadCycle], choice: CycleChoice
) -> BiaxialPath:
    """Return the loading branch of one cycle of a phase; InputError if it has fewer cycles."""
    count = len(phase)
    if choice != "last" and choice > count:
        problem = f"ratio {phase[0].ratio} has {count} cycles, number {choice} is asked for"
        raise InputError(table.path, table.argument, problem)
    cycle = phase[-1] if choice == "last" else phase[choice - 1]
    rows = slice(cycle.first, cycle.last + 1)
    return BiaxialPath(table, cycle, count, table.load[rows], table.strain[rows])


LoadUnit = Literal["kN/m", "N/mm", "N/m", "N/cm", "N/50mm", "N/5cm", "lbf/in", "N", "kN", "lbf"]
StrainUnit = Literal["%", "‰", "mm/mm"]
YARNS = ("warp", "fill")
#: Largest fall of a load from row to row, as a share of the largest, over which tables are paired.
LARGEST_FALL = 0.02
#: Largest load of a yarn that carries none, as a share of that of the other.
LARGEST_OF_UNLOADED = 0.02
#: Quantities that a table has to hold, by the key with which a project names their column.
QUANTITIES: Mapping[str, str] = {name.replace(" ", "_"): name for name in PAIRS}


def read_biaxial_table(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    load_unit: LoadUnit | None = None,
    strain_unit: StrainUnit | None = None,
    width: float | None = None,
    sheet: str | None = None,
    decimal: Literal[".", ","] | None = None,
    comment: str = "#",
    format: str | None = None,
    yarns: Sequence[str] = YARNS,
) -> BiaxialTable:
    """Read the table of a biaxial test.

    Column names, units, separator and decimal mark are found as for load curves.

    Parameters
    ----------
    path : path
    columns : mapping, optional
        Column names in the file, by the keys of `QUANTITIES` and "ratio".
    load_unit, strain_unit : str, optional
        Units where the file names none.
    width : float, mm, optional
        Width of the arms, by which forces are divided; needed where the loads are forces.
    sheet : str, optional
        Sheet of a workbook.
    decimal, comment, format
        Decimal mark, comment sign and file format, see `TableOptions` and `read_machine_table`.
    yarns : sequence of str
        Yarns along which the file has loads and strains; the table has a column for each.

    Raises
    ------
    InputError
        Columns or units are missing, or a cell is not a ratio.
    """
    path = Path(path)
    names = dict(columns or {})
    for name in names:
        check_one_of(name, (*QUANTITIES, "ratio"), "columns")
    quantities = tuple(name for name in QUANTITIES.values() if name.split()[0] in yarns)
    named_columns = {QUANTITIES.get(name, name): column for name, column in names.items()}
    options = TableOptions(named_columns, quantities, comment, decimal, sheet)
    export = read_machine_table(path, options, format)
    column = {name: export.column(name) for name in (*quantities, "ratio")}
    load_units = _load_units(export, column[f"{yarns[0]} load"], load_unit, width)
    load = _along_yarns(export, column, "load", load_units, load_unit)
    strain = _along_yarns(export, column, "strain", STRAIN_UNITS, strain_unit)
    stated_units = {
        name: load_unit if name.endswith("load") else strain_unit for name in quantities
    }
    source = export.source(column, stated_units, export.notes)
    ratio = _ratios_in_column(export, column["ratio"], path)
    return BiaxialTable(
        path,
        load,
        strain,
        ratio,
        export.table.lines,
        source,
        export.times(),
        name=path.name,
    )


def pair_over_load(warp: BiaxialTable, fill: BiaxialTable) -> BiaxialTable:
    """Return one table of two that hold the readings along one yarn each, at other points.

    At a load ratio both loads rise together, so that readings at equal shares of the largest loads
    belong together; where a yarn carries none, those at equal times. The readings are those along
    the warp; those along the fill are interpolated.

    Parameters
    ----------
    warp, fill : BiaxialTable
        Tables of one loading each, with one column of load and strain.

    Raises
    ------
    InputError
        A load falls, or there is none and no time: it is not said which readings belong together.
    """
    tables = warp, fill
    largest = [float(table.load.max()) for table in tables]
    if min(largest) > LARGEST_OF_UNLOADED * max(largest):
        warp_place, fill_place = map(_shares_of_load, tables)
        words = "at equal shares of the largest loads"
    else:
        warp_place, fill_place = _times_of(tables[int(np.argmin(largest))], tables)
        words = "at equal times, as one direction carries no load"
    # Beyond its readings the fill is not extrapolated.
    is_paired = (warp_place >= fill_place[0]) & (warp_place <= fill_place[-1])
    if not is_paired.any():
        raise InputError(fill.path, "time", f"no reading is of the times of {warp.name}")
    place = warp_place[is_paired]
    fill_load, fill_strain = (
        np.interp(place, fill_place, values[:, 0]) for values in (fill.load, fill.strain)
    )
    words = f"{warp.name}: paired with {fill.name} {words}"
    return replace(
        warp,
        load=np.column_stack([warp.load[is_paired, 0], fill_load]),
        strain=np.column_stack([warp.strain[is_paired, 0], fill_strain]),
        lines=warp.lines[is_paired],
        source=replace(warp.source, notes=(*warp.source.notes, words)),
        time=None,
        partner=fill,
    )


def _shares_of_load(table: BiaxialTable) -> Array:
    """Return the loads (n,) of one yarn over the largest; raise InputError if they fall."""
    shares = table.load[:, 0] / table.load.max()
    if np.diff(shares).min(initial=0.0) < -LARGEST_FALL:
        problem = "the load falls, and the two directions are paired over it: keep one loading"
        raise InputError(table.path, "load", problem)
    return np.asarray(np.maximum.accumulate(shares))


def _times_of(unloaded: BiaxialTable, tables: Sequence[BiaxialTable]) -> list[Array]:
    """Return the times (n,), s, of each table; raise InputError if one has none."""
    times = [table.time for table in tables if table.time is not None]
    if len(times) < len(tables):
        problem = "carries no load over which the two directions could be paired: give both a "
        problem += "column of time, or put both directions into one file (data.files)"
        raise InputError(unloaded.path, "load", problem)
    return times


def _load_units(
    export: MachineTable,
    column: str,
    load_unit: str | None,
    width: float | None,
) -> dict[str, float]:
    """Return the size in N/mm of each unit that the load column may have.

    Units of force are among them if the column is a force, divided by the width (mm) of the arms;
    InputError without a width.
    """
    units = dict(WIDTH_LOAD_UNITS)
    unit = export.units[column] or load_unit or ""
    if scale_of(unit, LOAD_UNITS) is not None:
        if width is None:
            problem = f"{unit} is a force; say the width of the arms, [biaxial] width"
            raise export.error(column, problem)
        units |= {force: scale / width for force, scale in LOAD_UNITS.items()}
    return units


def _along_yarns(
    export: MachineTable,
    column: Mapping[str, str],
    quantity: str,
    units: Mapping[str, float],
    unit: str | None,
) -> Array:
    """Return values (n, 2) of a quantity along warp and fill."""
    channel = Channel(unit=unit)
    values = [
        export.values(name, units, channel, f"{quantity}_unit")
        for key, name in column.items()
        if key.endswith(quantity)
    ]
    return np.column_stack(values)


def _ratios_in_column(export: MachineTable, column: str, path: Path) -> tuple[str, ...] | None:
    """Return the ratio of each row; None where there is no such column."""
    if not column:
        return None
    ratios = []
    for line, cell in zip(export.table.lines, export.table.text(column), strict=True):
        try:
            ratios.append(canonical_ratio(cell))
        except InputError as error:
            raise InputError(path, f"line {line}, column {column!r}", error.problem) from None
    return tuple(ratios)
