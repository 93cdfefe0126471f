"""A biaxial test as its section describes it: its files, their cycles, its models.

Files hold loads per width and strains along both yarns. A cycle begins where the larger load turns
from falling to rising. Small turns are noise or a hold.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from ...errors import InputError, check_one_of
from ...materials.card import State
from ...materials.designers import RATIOS, shares
from ...meshes.strip_models import PatchModel
from ...readers.biaxial import BiaxialTable
from ...readers.histories import LoadHistory, Pace, pace_of, turns
from ...readers.machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from ...readers.quantities import PAIRS
from ...readers.sections import Name, Number, Positive, Section, Size, Weight
from ...readers.units import LOAD_UNITS, STRAIN_UNITS, WIDTH_LOAD_UNITS, scale_of
from ...solvers.base import Array
from ..base import Reach, Refined, SectionTest
from ..sections import Place, listed_files, named_format

#: Ratios that a pair of loads may be taken for.
USUAL_RATIOS = (*RATIOS, "3:1", "1:3", "3:2", "2:3", "4:1", "1:4", "5:1", "1:5")


def plain_ratio(ratio: str) -> str:
    """Return one name for every spelling of a ratio: "2:1" for "2/1", "2.0 : 1" and "4:2"."""
    warp, fill = shares(ratio)
    smallest = min(share for share in (warp, fill) if share > 0)
    multiples = [round(share / smallest, 3) for share in (warp, fill)]
    for factor in range(1, 6):
        scaled = [factor * multiple for multiple in multiples]
        if all(math.isclose(x, round(x), abs_tol=0.005 * factor) for x in scaled):
            return ":".join(f"{round(x)}" for x in scaled)
    return f"{round(warp, 3):g}:{round(fill, 3):g}"


def nearest_ratio(loads: Sequence[float], *, tolerance: float = 4.0) -> str:
    """Return the ratio of loads along warp and fill; their own numbers where none is near.

    Parameters
    ----------
    loads : (2,) sequence
    tolerance : float, degrees
        Between the direction of the loads and that of a ratio.

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


LoadUnit = Literal["kN/m", "N/mm", "N/m", "N/cm", "N/50mm", "N/5cm", "lbf/in", "N", "kN", "lbf"]
StrainUnit = Literal["%", "‰", "mm/mm"]
#: What a table has to hold, and by which key of a project its column is named.
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
) -> BiaxialTable:
    """Read a table; names, units, separator and decimal mark are found as for load curves.

    Parameters
    ----------
    path : path
    columns : mapping, optional
        The file's names of `QUANTITIES` and `ratio`.
    load_unit, strain_unit : str, optional
        Where the file names none.
    width : float, mm, optional
        Of the arms, for forces.
    sheet : str, optional
        Of a workbook.
    decimal, comment, format
        As of `TableOptions` and `read_machine_table`.

    Raises
    ------
    InputError
        Columns or units are missing, or a cell is not a ratio.
    """
    path = Path(path)
    names = dict(columns or {})
    for name in names:
        check_one_of(name, (*QUANTITIES, "ratio"), "columns")
    quantities = tuple(QUANTITIES.values())
    named_columns = {QUANTITIES.get(name, name): column for name, column in names.items()}
    options = TableOptions(named_columns, quantities, comment, decimal, sheet)
    export = read_machine_table(path, options, format)
    column = {name: export.column(name) for name in (*quantities, "ratio")}
    load_units = _load_units(export, column["warp load"], load_unit, width)
    load = _along_yarns(export, column, "load", load_units, load_unit)
    strain = _along_yarns(export, column, "strain", STRAIN_UNITS, strain_unit)
    stated_units = {
        name: load_unit if name.endswith("load") else strain_unit for name in quantities
    }
    source = export.source(column, stated_units, export.notes)
    ratio = _ratios_in_column(export, column["ratio"], path)
    return BiaxialTable(
        path, load, strain, ratio, export.table.lines, source, export.times(), name=path.name
    )


def _load_units(
    export: MachineTable, column: str, load_unit: str | None, width: float | None
) -> dict[str, float]:
    """Return N/mm by unit; forces are among them where the width (mm) of the arms is known."""
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
        export.values(column[f"{yarn} {quantity}"], units, channel, f"{quantity}_unit")
        for yarn in ("warp", "fill")
    ]
    return np.column_stack(values)


def _ratios_in_column(export: MachineTable, column: str, path: Path) -> tuple[str, ...] | None:
    """Return the ratio of each row; None where there is no such column."""
    if not column:
        return None
    ratios = []
    for line, cell in zip(export.table.lines, export.table.text(column), strict=True):
        try:
            ratios.append(plain_ratio(cell))
        except InputError as error:
            raise InputError(path, f"line {line}, column {column!r}", error.problem) from None
    return tuple(ratios)


@dataclass(frozen=True)
class LoadCycle:
    """One cycle of a biaxial test.

    Attributes
    ----------
    ratio : str
    phase : int
        Of consecutive cycles of its ratio, from 1.
    number, count : int
        From 1, in its phase and of all.
    first, last : int
        Rows where the loading begins and is highest.
    """

    ratio: str
    phase: int
    number: int
    count: int
    first: int
    last: int


def find_cycles(load: Array, labels: Sequence[str] | None = None) -> list[LoadCycle]:
    """Find the cycles in the loads of a file.

    Parameters
    ----------
    load : (n, 2) array
        Along warp and fill.
    labels : (n,) sequence of str or None
        Ratio of each row; else it is that of the highest loads of a cycle.
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
            # A prestress has no ratio of its own: what is below it does not count.
            lowest = load[first_row]
            ratio = label or nearest_ratio(load[last_row] - np.minimum(lowest, lowest.min()))
            phase, number = _place_in_phases(ratio, cycles)
            cycles.append(LoadCycle(ratio, phase, number, len(cycles) + 1, first_row, last_row))
    return cycles


def _place_in_phases(ratio: str, cycles: Sequence[LoadCycle]) -> tuple[int, int]:
    """Return phase and number of the next cycle of a ratio."""
    if not cycles:
        return 1, 1
    previous = cycles[-1]
    if previous.ratio == ratio:
        return previous.phase, previous.number + 1
    return previous.phase + 1, 1


def _loadings(
    load: Array, *, smallest_turn: float = 0.2, hold: float = 0.01
) -> list[tuple[int, int]]:
    """Return first and last row of every loading in loads (n,).

    Parameters
    ----------
    load : (n,) array
    smallest_turn : float
        Of the range of loads of a phase: a smaller turn is none.
    hold : float
        Of a cycle's range: how far from its lowest and highest load the loading begins and ends, so
        that holds at the prestress and at the top, in which the fabric creeps, are no part of it.
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


#: Which cycle of a ratio is evaluated: the last of its phase, or by number from 1.
CycleChoice = int | Literal["last"]


@dataclass(frozen=True, eq=False)
class BiaxialPath:
    """The loading of one cycle.

    Attributes
    ----------
    table : BiaxialTable
        The readings it is of.
    cycle : LoadCycle
    cycles : int
        Number of cycles of its phase.
    load : (n, 2) array, N/mm
        Along warp and fill.
    strain : (n, 2) array
        Since the file's beginning.
    """

    table: BiaxialTable
    cycle: LoadCycle
    cycles: int
    load: Array
    strain: Array

    @property
    def larger(self) -> Array:
        """Return the larger load of every row, (n,) N/mm."""
        return np.asarray(self.load.max(axis=1))

    @property
    def ratio(self) -> str:
        return self.cycle.ratio

    @property
    def residual(self) -> Array:
        """Return (2,) strain at the beginning of the loading."""
        return np.asarray(self.strain[0] - self.table.strain[0])

    @property
    def since(self) -> Array:
        """Return (n, 2) strain since the beginning of the loading."""
        return np.asarray(self.strain - self.strain[0])

    def between(self, lowest: float, highest: float) -> BiaxialPath:
        """Return the rows whose larger load (N/mm) lies between two."""
        larger = self.larger
        keep = (larger >= lowest * (1 - 1e-9)) & (larger <= highest * (1 + 1e-9))
        if keep.sum() < 2:
            problem = (
                f"fewer than two rows of ratio {self.ratio} lie between {lowest:g} and "
                f"{highest:g} kN/m; its loading goes from {larger.min():.4g} to {larger.max():.4g}"
            )
            raise InputError(self.table.path, self.table.argument, problem)
        return replace(self, load=self.load[keep], strain=self.strain[keep])

    def thinned(self, max_rows: int) -> BiaxialPath:
        """Return at most so many rows, evenly spread over the larger load, both ends among them."""
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
    """Return the loading of one cycle of each ratio.

    Of a ratio that comes several times, the first phase after the conditioning counts.

    Parameters
    ----------
    tables : sequence of BiaxialTable
    cycles : sequence of sequences of LoadCycle
        Of each table.
    choice : int or "last"
        Which cycle of each ratio.
    conditioning : int
        Number of cycles at the beginning of each file.
    ratios : collection of str or None
        Those that are evaluated; all unless given.

    Returns
    -------
    list of BiaxialPath
        In the order of `RATIOS`, then by name.

    Raises
    ------
    InputError
        A ratio is not there, or has no such cycle.
    """
    paths: dict[str, BiaxialPath] = {}
    for table, cycles_of_table in zip(tables, cycles, strict=True):
        for phase in _phases(cycles_of_table[conditioning:]):
            ratio = phase[0].ratio
            is_evaluated = ratios is None or ratio in ratios
            if is_evaluated and ratio not in paths:
                paths[ratio] = _path_of_phase(table, phase, choice)
    missing = [ratio for ratio in ratios or () if ratio not in paths]
    if missing or not paths:
        measured = ", ".join(dict.fromkeys(c.ratio for of_table in cycles for c in of_table))
        problem = f"no cycle of ratio {', '.join(missing) or 'any'} after the conditioning"
        argument = tables[0].argument.partition("[")[0]
        raise InputError(tables[0].path, argument, f"{problem}; the ratios there: {measured}")
    order = {ratio: k for k, ratio in enumerate(RATIOS)}
    return sorted(paths.values(), key=lambda path: (order.get(path.ratio, len(order)), path.ratio))


def _phases(cycles: Sequence[LoadCycle]) -> Collection[list[LoadCycle]]:
    """Return the cycles phase by phase."""
    phases: dict[int, list[LoadCycle]] = {}
    for cycle in cycles:
        phases.setdefault(cycle.phase, []).append(cycle)
    return phases.values()


def _path_of_phase(
    table: BiaxialTable, phase: Sequence[LoadCycle], choice: CycleChoice
) -> BiaxialPath:
    """Return the loading of one cycle of a phase; InputError if there are fewer cycles."""
    count = len(phase)
    if choice != "last" and choice > count:
        problem = f"ratio {phase[0].ratio} has {count} cycles, number {choice} is asked for"
        raise InputError(table.path, table.argument, problem)
    cycle = phase[-1] if choice == "last" else phase[choice - 1]
    rows = slice(cycle.first, cycle.last + 1)
    return BiaxialPath(table, cycle, count, table.load[rows], table.strain[rows])


FileNames = Annotated[list[str], Field(min_length=1)]
ByRatio = Annotated[dict[str, FileNames], Field(min_length=1)]


def _files(value: Any) -> Any:
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    form: Any = ByRatio if isinstance(value, dict) else FileNames
    return TypeAdapter(form).validate_python(value, strict=True)


class BiaxialColumnsSection(Section):
    """Section [biaxial.data.columns]: the files' own column names."""

    warp_load: str | None = None
    fill_load: str | None = None
    warp_strain: str | None = None
    fill_strain: str | None = None
    ratio: str | None = None


class TablesSection(Section):
    """Section [biaxial.data]: the files, in any order, or those of each ratio."""

    files: Annotated[list[str] | dict[str, list[str]] | None, BeforeValidator(_files)] = None
    folder: str = ""
    format: str | None = None
    columns: BiaxialColumnsSection = BiaxialColumnsSection.model_construct()
    load_unit: LoadUnit | None = None
    strain_unit: StrainUnit | None = None
    decimal: Literal[".", ","] | None = None
    sheet: str | None = None
    comment: str = "#"


class BiaxialSection(Section):
    """Section [[biaxial]]: a cruciform, its loads in kN/m and strains as one test.
    width : of the arms, where files hold forces. range : kN/m of the larger load. cycle : of each
    ratio. conditioning : cycles at the beginning of each file that count for nothing. noise : of
    one measured strain, in %."""

    name: Name | None = None
    weight: Weight = 1.0
    width: Size | None = None
    ratios: Annotated[list[str], Field(min_length=1)] | None = None
    range: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    cycle: Literal["last"] | Annotated[int, Field(ge=1)] = "last"
    conditioning: Annotated[int, Field(ge=0)] = 0
    points: Annotated[int, Field(ge=2, le=10000)] = 50
    noise: Positive | None = None
    data: TablesSection


def read(section: BiaxialSection, place: Place, name: str) -> BiaxialTest:
    """Read the section of a test, and its files; no data where one is missing and not needed."""
    noise = None if section.noise is None else 0.01 * section.noise
    test = BiaxialTest(name=name, place=place, weight=section.weight, section=section, noise=noise)
    tables = measured_tables(section, place)
    if not tables:
        return test
    cycles = [find_cycles(table.load, table.ratio) for table in tables]
    for table, cycles_of_table in zip(tables, cycles, strict=True):
        if not cycles_of_table:
            problem = "no loading: the loads do not rise anywhere"
            raise InputError(table.path, table.argument, problem)
    ratios = None
    if section.ratios is not None:
        ratios = [_ratio(place, f"ratios[{i}]", name) for i, name in enumerate(section.ratios)]
    paths = evaluated_paths(tables, cycles, section.cycle, section.conditioning, ratios)
    if section.range is not None:
        lowest, highest = section.range
        if not 0 <= lowest < highest:
            problem = f"expected [lowest, highest] in kN/m, got [{lowest:g}, {highest:g}]"
            raise place.error("range", problem)
        paths = [path.between(lowest, highest) for path in paths]
    thinned = [path.thinned(section.points) for path in paths]
    return replace(test, tables=tables, cycles=cycles, paths=thinned)


def measured_tables(section: BiaxialSection, place: Place) -> list[BiaxialTable]:
    """Return the readings of each file or array, with their ratios where these are known.

    None where a file is missing and not needed.
    """
    data = section.data
    if place.measured is not None:
        return [_with_plain_ratios(table, place) for table in place.measured]
    if data.files is None:
        if place.need_data:
            raise place.error("data.files", "this key is missing; add it")
        return []
    folder = place.folder(data.folder)
    columns = data.columns.model_dump(exclude_none=True)
    files_by_ratio = data.files if isinstance(data.files, dict) else {None: data.files}
    tables = []
    for path, field, ratio in listed_files(place, folder, files_by_ratio, "data.files"):
        if not place.has(path, field):
            return []
        table = read_biaxial_table(
            path,
            columns=columns,
            load_unit=data.load_unit,
            strain_unit=data.strain_unit,
            width=section.width and section.width * place.scales.length,
            sheet=data.sheet,
            decimal=data.decimal,
            comment=data.comment,
            format=named_format(place, "data.format", "machine table", data.format),
        )
        if ratio is not None:
            plain = _ratio(place, f"data.files.{ratio}", ratio)
            table = replace(table, ratio=(plain,) * len(table.load))
        tables.append(table)
    return tables


def _with_plain_ratios(table: BiaxialTable, place: Place) -> BiaxialTable:
    """Return arrays with one name for every spelling of a ratio."""
    if table.ratio is None:
        return table
    plain = {name: _ratio(place, table.argument, name) for name in dict.fromkeys(table.ratio)}
    return replace(table, ratio=tuple(plain[name] for name in table.ratio))


def _ratio(place: Place, field: str, name: str) -> str:
    with place.naming(field=field):
        return plain_ratio(name)


@dataclass(frozen=True, eq=False, kw_only=True)
class BiaxialTest(SectionTest):
    """A cruciform loaded along warp and fill.

    Attributes
    ----------
    section : BiaxialSection
    tables : sequence of BiaxialTable
        N/mm, strains as shares.
    cycles : sequence of sequences of LoadCycle
        Of each table.
    paths : sequence of BiaxialPath
        The loading of each ratio that is evaluated.
    noise : float or None
        Of one strain.
    """

    section: BiaxialSection
    tables: Sequence[BiaxialTable] = ()
    cycles: Sequence[Sequence[LoadCycle]] = ()
    paths: Sequence[BiaxialPath] = ()
    kind: str = "biaxial"
    reads_files: bool = True

    @property
    def state(self) -> State:
        """Return "conditioned" where a cycle before those that are evaluated was not the first."""
        later = any(path.cycle.count > 1 for path in self.paths)
        return "conditioned" if later else "first loading"

    @property
    def pace(self) -> Pace:
        """Return rate of strain and hold by the files' times, of the larger load and strain."""
        return pace_of(
            LoadHistory(t.path or Path(t.name), t.load.max(axis=1), t.strain.max(axis=1), t.time)
            for t in self.tables
        )

    @property
    def matched(self) -> Mapping[str, BiaxialPath]:
        """Return the paths by ratio."""
        return {path.ratio: path for path in self.paths}

    @property
    def reach(self) -> Reach:
        """Return the largest strains along warp and fill."""
        return reach_of(self.paths)

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, PatchModel]:
        """Return a patch for each ratio, driven by the measured loads: nothing to refine."""
        thick = self.thick(thickness)
        return {path.ratio: PatchModel(path.load, thick) for path in self.paths}

    def settings(self) -> Mapping[str, object]:
        return {"weight": self.weight, "noise": self.noise}


def reach_of(paths: Collection[BiaxialPath], *, smallest_strain: float = 1e-4) -> Reach:
    """Return the largest strains along warp and fill; the shear stays unknown.

    smallest_strain : a law could not be fitted over less.
    """
    if not paths:
        return Reach()
    ends = np.max([path.strain.max(axis=0) for path in paths], axis=0)
    warp, fill = (float(np.log1p(end)) if end > smallest_strain else None for end in ends)
    return Reach((warp, fill, None))
