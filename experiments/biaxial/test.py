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
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, TypeAdapter

from ...errors import InputError, check_one_of
from ...materials.card import State
from ...materials.designers import RATIOS, shares
from ...meshes.strip_models import PatchModel
from ...readers.frames import FrameSource
from ...readers.histories import LoadHistory, Pace, pace_of, turns
from ...readers.machine_tables import Channel, TableOptions, read_machine_table
from ...readers.quantities import PAIRS
from ...readers.sections import Name, Number, Positive, Section, Size, Weight
from ...readers.units import LOAD_UNITS, STRAIN_UNITS, WIDTH_LOAD_UNITS, scale_of
from ...solvers.base import Array
from ..base import Reach, Refined, SectionTest
from ..sections import Place, listed_files, named_format

#: Ratios that a pair of loads may be taken for.
KNOWN = (*RATIOS, "3:1", "1:3", "3:2", "2:3", "4:1", "1:4", "5:1", "1:5")
#: Degrees between the direction of a pair of loads and that of a ratio: no more than it.
NEAR = 4.0


def plain_ratio(ratio: str) -> str:
    """Return one name for every spelling of a ratio: "2:1" for "2/1", "2.0 : 1" and "4:2"."""
    warp, fill = shares(ratio)
    least = min(x for x in (warp, fill) if x > 0)
    whole = [round(x / least, 3) for x in (warp, fill)]
    for factor in range(1, 6):
        if all(math.isclose(factor * x, round(factor * x), abs_tol=0.005 * factor) for x in whole):
            return ":".join(f"{round(factor * x)}" for x in whole)
    return ":".join(f"{x:g}" for x in (round(warp, 3), round(fill, 3)))


def nearest_ratio(loads: Sequence[float]) -> str:
    """Return the ratio of loads along warp and fill; their own numbers where none is near.
    >>> nearest_ratio([30.0, 14.8]), nearest_ratio([25.0, 0.5])
    ('2:1', '1:0')"""
    warp, fill = (max(x, 0.0) for x in loads)
    own = math.degrees(math.atan2(fill, warp))
    angles = {name: math.degrees(math.atan2(*shares(name)[::-1])) for name in KNOWN}
    best = min(KNOWN, key=lambda name: abs(angles[name] - own))
    if abs(angles[best] - own) <= NEAR or not max(warp, fill) > 0:
        return best
    larger = max(warp, fill)
    return f"{warp / larger:.2g}:{fill / larger:.2g}"


LoadUnit = Literal["kN/m", "N/mm", "N/m", "N/cm", "N/50mm", "N/5cm", "lbf/in", "N", "kN", "lbf"]
StrainUnit = Literal["%", "‰", "mm/mm"]
#: What a table has to hold, and by which key of a project its column is named.
QUANTITIES: Mapping[str, str] = {name.replace(" ", "_"): name for name in PAIRS}


@dataclass(frozen=True, eq=False)
class BiaxialTable:
    """Rows of a file: loads (n, 2) N/mm, strains (n, 2) along warp and fill, (n,) ratios; s."""

    path: Path
    load: Array
    strain: Array
    ratio: tuple[str, ...] | None
    lines: NDArray[np.intp]
    source: FrameSource
    time: Array | None = None


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
    columns : the file's own names of `QUANTITIES` and `ratio`. load_unit, strain_unit : where the
    file names none. width : mm of the arms, for forces. sheet : of a workbook."""
    path = Path(path)
    named = dict(columns or {})
    for name in named:
        check_one_of(name, (*QUANTITIES, "ratio"), "columns")
    asked = {QUANTITIES.get(name, name): column for name, column in named.items()}
    wanted = tuple(QUANTITIES.values())
    options = TableOptions(asked, wanted, comment, decimal, sheet)
    found = read_machine_table(path, options, format)
    column = {name: found.column(name) for name in (*wanted, "ratio")}
    loads = dict(WIDTH_LOAD_UNITS)
    own = found.units[column["warp load"]] or load_unit or ""
    if scale_of(own, LOAD_UNITS) is not None:
        if width is None:
            problem = f"{own} is a force; say the width of the arms, [biaxial] width"
            raise found.error(column["warp load"], problem)
        loads |= {unit: scale / width for unit, scale in LOAD_UNITS.items()}
    load, strain = (
        np.column_stack([
            found.values(column[f"{yarn} {kind}"], units, Channel(unit=unit), f"{kind}_unit")
            for yarn in ("warp", "fill")
        ])
        for kind, units, unit in (
            ("load", loads, load_unit), ("strain", STRAIN_UNITS, strain_unit),
        )
    )  # fmt: skip
    units_asked = {name: load_unit if name.endswith("load") else strain_unit for name in wanted}
    source = found.source(column, units_asked, found.notes)
    ratio = None
    if column["ratio"]:
        cells = found.table.text(column["ratio"])
        lines = found.table.lines
        names = []
        for line, cell in zip(lines, cells, strict=True):
            try:
                names.append(plain_ratio(cell))
            except InputError as error:
                at = f"line {line}, column {column['ratio']!r}"
                raise InputError(path, at, error.problem) from None
        ratio = tuple(names)
    time = found.times()
    return BiaxialTable(path, load, strain, ratio, found.table.lines, source, time)


#: Of the range of loads of a phase: a smaller turn is none.
TURN = 0.2
#: Of a cycle's range: how far from its lowest and highest load the loading begins and ends, so
#: that holds at the prestress and at the top, in which the fabric creeps, are no part of it.
HOLD = 0.01


@dataclass(frozen=True)
class LoadCycle:
    """One cycle, `number` (from 1) of a phase of consecutive ones of its ratio, `count` of all.
    first, last : rows where the loading begins and is highest."""

    ratio: str
    phase: int
    number: int
    count: int
    first: int
    last: int


def find_cycles(load: Array, labels: Sequence[str] | None = None) -> list[LoadCycle]:
    """Return the cycles in loads (n, 2) along warp and fill; their ratio by (n,) labels or tops."""
    larger = np.asarray(load).max(axis=1)
    known: Sequence[str | None] = [None] * len(larger) if labels is None else list(labels)
    turns = [i for i in range(1, len(known)) if known[i] != known[i - 1]]
    cycles: list[LoadCycle] = []
    for start, stop in pairwise([0, *turns, len(larger)]):
        label = known[start] if stop > start else None
        for first, last in _loadings(larger[start:stop]):
            # A prestress has no ratio of its own: what is below it does not count.
            own = np.asarray(load[start + first])
            ratio = label or nearest_ratio(load[start + last] - np.minimum(own, own.min()))
            phase = 1
            number = 1
            if cycles:
                old = cycles[-1]
                same = old.phase, old.number + 1
                phase, number = same if old.ratio == ratio else (old.phase + 1, 1)
            cycles.append(
                LoadCycle(ratio, phase, number, len(cycles) + 1, start + first, start + last)
            )
    return cycles


def _loadings(s: Array) -> list[tuple[int, int]]:
    """Return first and last row of every loading in loads (n,)."""
    rows = turns(s, 0.0, 0.0, TURN)
    found = []
    for low, high in zip(rows[::2], rows[1::2], strict=False):
        hold = HOLD * (s[high] - s[low])
        first = low + int(np.flatnonzero(s[low : high + 1] <= s[low] + hold)[-1])
        last = first + int(np.flatnonzero(s[first : high + 1] >= s[high] - hold)[0])
        found.append((first, last))
    return found


#: Which cycle of a ratio is evaluated: the last of its phase, or by number from 1.
Which = int | Literal["last"]


@dataclass(frozen=True, eq=False)
class BiaxialPath:
    """The loading (n, 2) N/mm, strains since the file's beginning, of one cycle of `cycles`."""

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
            raise InputError(self.table.path, "", problem)
        return replace(self, load=self.load[keep], strain=self.strain[keep])

    def thinned(self, most: int) -> BiaxialPath:
        """Return at most so many rows, evenly spread over the larger load, both ends among them."""
        if len(self.load) <= most:
            return self
        larger = np.maximum.accumulate(self.larger)
        wanted = np.linspace(larger[0], larger[-1], most)
        rows = np.unique(np.clip(np.searchsorted(larger, wanted), 0, len(larger) - 1))
        rows[-1] = len(larger) - 1
        return replace(self, load=self.load[rows], strain=self.strain[rows])


def evaluated_paths(
    tables: Sequence[BiaxialTable],
    cycles: Sequence[Sequence[LoadCycle]],
    which: Which = "last",
    conditioning: int = 0,
    ratios: Collection[str] | None = None,
) -> list[BiaxialPath]:
    """Return the loading of one cycle of each ratio, in the order of `RATIOS`, then by name.
    Of a ratio that comes several times, the first phase after the conditioning counts. conditioning
    : cycles at the beginning of each file. ratios : those wanted; all unless given."""
    found: dict[str, BiaxialPath] = {}
    for table, own in zip(tables, cycles, strict=True):
        phases: dict[int, list[LoadCycle]] = {}
        for cycle in own[conditioning:]:
            phases.setdefault(cycle.phase, []).append(cycle)
        for same in phases.values():
            ratio = same[0].ratio
            if ratio in found or (ratios is not None and ratio not in ratios):
                continue
            if which != "last" and which > len(same):
                problem = f"ratio {ratio} has {len(same)} cycles, number {which} is asked for"
                raise InputError(table.path, "", problem)
            chosen = same[-1] if which == "last" else same[which - 1]
            rows = slice(chosen.first, chosen.last + 1)
            load = table.load[rows]
            strain = table.strain[rows]
            found[ratio] = BiaxialPath(table, chosen, len(same), load, strain)
    missing = [ratio for ratio in ratios or () if ratio not in found]
    if missing or not found:
        there = ", ".join(dict.fromkeys(c.ratio for own in cycles for c in own))
        problem = f"no cycle of ratio {', '.join(missing) or 'any'} after the conditioning"
        raise InputError(tables[0].path, "", f"{problem}; the ratios there: {there}")
    order = {ratio: k for k, ratio in enumerate(RATIOS)}
    return sorted(found.values(), key=lambda p: (order.get(p.ratio, len(order)), p.ratio))


FileNames = Annotated[list[str], Field(min_length=1)]
ByRatio = Annotated[dict[str, FileNames], Field(min_length=1)]


def _files(given: Any) -> Any:
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    kind: Any = ByRatio if isinstance(given, dict) else FileNames
    return TypeAdapter(kind).validate_python(given, strict=True)


class BiaxialColumnsSection(Section):
    """Section [biaxial.data.columns]: the files' own column names."""

    warp_load: str | None = None
    fill_load: str | None = None
    warp_strain: str | None = None
    fill_strain: str | None = None
    ratio: str | None = None


class TablesSection(Section):
    """Section [biaxial.data]: the files, in any order, or those of each ratio."""

    files: Annotated[list[str] | dict[str, list[str]], BeforeValidator(_files)]
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
    data = section.data
    folder = place.folder(section.data.folder)
    columns = data.columns.model_dump(exclude_none=True)
    said = data.files if isinstance(data.files, dict) else {None: data.files}
    tables = []
    named = []
    for path, field, ratio in listed_files(place, folder, said, "data.files"):
        if not place.has(path, field):
            return test
        tables.append(
            read_biaxial_table(
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
        )
        named.append(ratio and _ratio(place, f"data.files.{ratio}", ratio))
    cycles = [
        find_cycles(table.load, table.ratio if ratio is None else [ratio] * len(table.load))
        for table, ratio in zip(tables, named, strict=True)
    ]
    if [] in cycles:
        path = tables[cycles.index([])].path
        raise InputError(path, "", "no loading: the loads do not rise anywhere")
    wanted = None
    if section.ratios is not None:
        wanted = [_ratio(place, f"ratios[{i}]", name) for i, name in enumerate(section.ratios)]
    paths = evaluated_paths(tables, cycles, section.cycle, section.conditioning, wanted)
    if section.range is not None:
        lowest, highest = section.range
        if not 0 <= lowest < highest:
            problem = f"expected [lowest, highest] in kN/m, got [{lowest:g}, {highest:g}]"
            raise place.error("range", problem)
        paths = [path.between(lowest, highest) for path in paths]
    thinned = [path.thinned(section.points) for path in paths]
    return replace(test, tables=tables, cycles=cycles, paths=thinned)


def _ratio(place: Place, field: str, name: str) -> str:
    with place.naming(field=field):
        return plain_ratio(name)


#: Strains below it are none that a law could be fitted over.
LEAST_STRAIN = 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class BiaxialTest(SectionTest):
    """A cruciform loaded along warp and fill: N/mm, strains as shares; noise of one strain.
    tables : the files; cycles : of each; paths : the loading of each ratio that is evaluated."""

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
            LoadHistory(t.path, t.load.max(axis=1), t.strain.max(axis=1), t.time)
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


def reach_of(paths: Collection[BiaxialPath]) -> Reach:
    """Return the largest strains along warp and fill; the shear stays unknown."""
    if not paths:
        return Reach()
    ends = np.max([path.strain.max(axis=0) for path in paths], axis=0)
    warp, fill = (float(np.log1p(end)) if end > LEAST_STRAIN else None for end in ends)
    return Reach((warp, fill, None))
