"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from ...errors import InputError
from ...lazy_modules import LazyFunction
from ...materials.card import State
from ...meshes.strip_models import PatchModel
from ...readers.histories import LoadHistory, Pace, pace_of
from ...readers.machine_tables import BiaxialTable
from ...readers.sections import Name, Number, Positive, Section, Size, Weight
from ..base import Reach, Refined, SectionTest
from ..measured import MeasuredKind
from ..sections import FileNames, Place, TableFilesSection, listed_files, named_format
from .paths import (
    YARNS,
    BiaxialPath,
    LoadCycle,
    LoadUnit,
    StrainUnit,
    canonical_ratio,
    evaluated_paths,
    find_cycles,
    pair_over_load,
    read_biaxial_table,
)

ByRatio = Annotated[dict[str, FileNames], Field(min_length=1)]
Share = Annotated[float, Field(gt=0.1, le=1.5)]


def _files(value: Any) -> Any:
    """Return the files of a section, by ratio or in a list, checked."""
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


class TablesSection(TableFilesSection):
    """Section [biaxial.data]: the files as a list in any order, or as lists by load ratio.

    `pairs` lists two files by load ratio: the readings along the warp, and those along the fill.
    """

    files: Annotated[list[str] | dict[str, list[str]] | None, BeforeValidator(_files)] = None
    pairs: dict[str, Annotated[list[str], Field(min_length=2, max_length=2)]] | None = None
    columns: BiaxialColumnsSection = BiaxialColumnsSection.model_construct()
    load_unit: LoadUnit | None = None
    strain_unit: StrainUnit | None = None


class BiaxialSection(Section):
    """Section [[biaxial]]: one biaxial test of a cruciform.

    Attributes
    ----------
    name, weight
        Name of the test, and weight of its error in the objective.
    width
        Width of the arms, where the files hold forces.
    load_share
        Share of the measured loads that reaches the field where strains are measured, along warp
        and fill or the same for both.
    load_share_deviation
        Standard deviation of that share.
    ratios
        Load ratios that are evaluated; all unless given.
    range
        Lowest and highest load (kN/m, the larger of warp and fill) of the rows that are evaluated.
    cycle
        Cycle of each ratio that is evaluated: "last", or its number from 1.
    conditioning
        Number of cycles at the beginning of each file that are not evaluated.
    points
        Largest number of rows of a path.
    noise
        Standard deviation of one measured strain, in %.
    data
        Files and their columns and units.
    """

    name: Name | None = None
    weight: Weight = 1.0
    width: Size | None = None
    load_share: Share | Annotated[list[Share], Field(min_length=2, max_length=2)] | None = None
    load_share_deviation: Annotated[float, Field(gt=0, le=0.3)] | None = None
    ratios: Annotated[list[str], Field(min_length=1)] | None = None
    range: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    cycle: Literal["last"] | Annotated[int, Field(ge=1)] = "last"
    conditioning: Annotated[int, Field(ge=0)] = 0
    points: Annotated[int, Field(ge=2, le=10000)] = 50
    noise: Positive | None = None
    data: TablesSection


def read(section: BiaxialSection, place: Place, name: str) -> BiaxialTest:
    """Read a test from its section and its files.

    Parameters
    ----------
    section : BiaxialSection
    place : Place
        Place of the section in its project, with folders, units and messages.
    name : str
        Name of the test.

    Returns
    -------
    BiaxialTest
        Without data where a file is missing and the place does not need data.

    Raises
    ------
    InputError
        A file cannot be read, its loads do not rise, or a ratio or range is not in the data.
    """
    noise = None if section.noise is None else 0.01 * section.noise
    test = BiaxialTest(
        name=name,
        place=place,
        weight=section.weight,
        section=section,
        noise=noise,
    )
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
        ratios = [
            _checked_ratio(place, f"ratios[{i}]", name) for i, name in enumerate(section.ratios)
        ]
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
    """Return the table of each file or array, with the ratio of each row where it is known.

    The list is empty where a file is missing and the place does not need data.
    """
    if place.measured is not None:
        tables = [_with_canonical_ratios(table, place) for table in place.measured]
    else:
        tables = _listed_tables(section, place)
    share = np.array(1.0 if section.load_share is None else section.load_share)
    return [replace(table, load=share * table.load) for table in tables]


def _listed_tables(section: BiaxialSection, place: Place) -> list[BiaxialTable]:
    """Return the tables of listed files, or pairs of them; none if one is missing unneeded."""
    data = section.data
    key = "data.files" if data.pairs is None else "data.pairs"
    names_by_ratio = _names_by_ratio(data, place)
    listed = listed_files(place, place.folder(data.folder), names_by_ratio, key)
    if not listed or not all([place.has(path, field) for path, field, _ in listed]):
        return []
    read_table = partial(
        read_biaxial_table,
        columns=data.columns.model_dump(exclude_none=True),
        load_unit=data.load_unit,
        strain_unit=data.strain_unit,
        width=section.width and section.width * place.scales.length,
        sheet=data.sheet,
        decimal=data.decimal,
        comment=data.comment,
        format=named_format(place, "data.format", "machine table", data.format),
    )
    tables = []
    count = 1 if data.pairs is None else 2
    for first in range(0, len(listed), count):
        (path, _, ratio), *partner = listed[first : first + count]
        if partner:
            fill = read_table(partner[0][0], yarns=YARNS[1:])
            table = pair_over_load(read_table(path, yarns=YARNS[:1]), fill)
        else:
            table = read_table(path)
        if ratio is not None:
            canonical = _checked_ratio(place, f"{key}.{ratio}", ratio)
            table = replace(table, ratio=(canonical,) * len(table.load))
        tables.append(table)
    return tables


def _names_by_ratio(data: TablesSection, place: Place) -> dict[Any, list[str]]:
    """Return the listed files by load ratio, None where it is not said; empty if none need be."""
    if data.files is not None and data.pairs is not None:
        raise place.error("data.pairs", "expected either 'files' or 'pairs'")
    if data.pairs is not None:
        if not data.pairs:
            raise place.error("data.pairs", "expected the two files of one ratio at least")
        return data.pairs
    if data.files is None:
        if place.need_data:
            raise place.error("data.files", "this key is missing; add it")
        return {}
    return data.files if isinstance(data.files, dict) else {None: data.files}


def _with_canonical_ratios(table: BiaxialTable, place: Place) -> BiaxialTable:
    """Return a table of arrays whose ratios have their canonical spelling."""
    if table.ratio is None:
        return table
    canonical = {
        name: _checked_ratio(place, table.argument, name) for name in dict.fromkeys(table.ratio)
    }
    return replace(table, ratio=tuple(canonical[name] for name in table.ratio))


def _checked_ratio(place: Place, field: str, name: str) -> str:
    """Return the canonical spelling of a ratio ("2:1" for "4:2"); errors name the key `field`."""
    with place.errors_name(field=field):
        return canonical_ratio(name)


@dataclass(frozen=True, eq=False, kw_only=True)
class BiaxialTest(SectionTest):
    """A biaxial test of a cruciform, with its data where there are any.

    Attributes
    ----------
    section : BiaxialSection
        Section that describes the test.
    tables : sequence of BiaxialTable
        Loads (N/mm) and strains (0.01 is 1 %) of each file.
    cycles : sequence of sequences of LoadCycle
        Load cycles of each table, in the same order.
    paths : sequence of BiaxialPath
        Loading branch of each ratio that is evaluated.
    noise : float or None
        Standard deviation of one strain (0.01 is 1 %), where the section gives it.
    """

    section: BiaxialSection
    tables: Sequence[BiaxialTable] = ()
    cycles: Sequence[Sequence[LoadCycle]] = ()
    paths: Sequence[BiaxialPath] = ()
    kind: str = "biaxial"
    reads_files: bool = True

    @property
    def state(self) -> State:
        """Return "conditioned" if any evaluated cycle is not the first of its file."""
        later = any(path.cycle.number_in_file > 1 for path in self.paths)
        return "conditioned" if later else "first loading"

    @property
    def pace(self) -> Pace:
        """Return the pace of the test, from the larger load and larger strain over time."""
        return pace_of(
            LoadHistory(
                table.path or Path(table.name),
                table.load.max(axis=1),
                table.strain.max(axis=1),
                table.time,
            )
            for table in self.tables
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
        """Return a homogeneous patch for each ratio, driven by the measured loads.

        `thickness` (mm) replaces that of the fabric; there is no mesh to refine.
        """
        thick = self.thick(thickness)
        return {path.ratio: PatchModel(path.load, thick) for path in self.paths}


def reach_of(paths: Collection[BiaxialPath], *, smallest_strain: float = 1e-4) -> Reach:
    """Return the largest log strains along warp and fill that paths reach; shear is unknown.

    Strains up to `smallest_strain` are too small to fit a law over, and count as unknown.
    """
    if not paths:
        return Reach()
    ends = np.max([path.strain.max(axis=0) for path in paths], axis=0)
    warp, fill = (float(np.log1p(end)) if end > smallest_strain else None for end in ends)
    return Reach((warp, fill, None))


class BiaxialKind(MeasuredKind):
    """A cruciform loaded along warp and fill in several ratios."""

    name = "biaxial"
    title = "a cruciform loaded along warp and fill in several ratios"
    section = BiaxialSection
    folder_key = "data.folder"
    doubts = ("strain-unit", "load-unit", "ratio", "modulus", "swapped")
    prepared = LazyFunction(f"{__name__}.prepared", "PreparedBiaxial")
    read = staticmethod(read)
    candidates = LazyFunction(f"{__name__}.prepared", "candidates")


KIND = BiaxialKind()
