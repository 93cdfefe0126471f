"""A biaxial test, as its section describes it, and its models."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from ...errors import InputError
from ...materials.card import State
from ...meshes.strip_models import PatchModel
from ...readers.histories import LoadHistory, Pace, pace_of
from ...readers.sections import Length, Name, Number, Positive, Section
from ..kinds import Place, Reach, Refined, SectionTest, listed_files, named_format
from .data import (
    BiaxialPath,
    BiaxialTable,
    Cycle,
    LoadUnit,
    StrainUnit,
    evaluated_paths,
    find_cycles,
    plain_ratio,
    read_biaxial_table,
)

FileNames = Annotated[list[str], Field(min_length=1)]
ByRatio = Annotated[dict[str, FileNames], Field(min_length=1)]


def _files(given: Any) -> Any:
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    kind: Any = ByRatio if isinstance(given, dict) else FileNames
    return TypeAdapter(kind).validate_python(given, strict=True)


class ColumnsSection(Section):
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
    columns: ColumnsSection = ColumnsSection()
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
    weight: Annotated[float, Field(ge=0, le=1e6)] = 1.0
    width: Length | None = None
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
    data, folder = section.data, place.folder(section.data.folder)
    columns = data.columns.model_dump(exclude_none=True)
    said = data.files if isinstance(data.files, dict) else {None: data.files}
    tables, named = [], []
    for path, field, ratio in listed_files(place, folder, said, "data.files"):
        if not place.has(path, field):
            return test
        tables.append(
            read_biaxial_table(
                path, columns=columns, load_unit=data.load_unit, strain_unit=data.strain_unit,
                width=section.width and section.width * place.scales.length, sheet=data.sheet,
                decimal=data.decimal, comment=data.comment,
                format=named_format(place, "data.format", "machine table", data.format),
            )
        )  # fmt: skip
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
    cycles: Sequence[Sequence[Cycle]] = ()
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
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
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
