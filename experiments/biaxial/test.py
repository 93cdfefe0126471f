"""A biaxial test, as its section describes it, and its models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...files import is_file
from ...meshes.strip_models import PatchModel
from ...readers.sections import beside
from ..keys import named_format
from ..kinds import Place, Reach, Refined
from .data import (
    BiaxialPath,
    BiaxialTable,
    Cycle,
    cycles_of,
    evaluated_paths,
    plain_ratio,
    read_biaxial_table,
)
from .section import BiaxialSection, TablesSection


@dataclass(frozen=True, eq=False)
class BiaxialData:
    """Data of a test: files, their cycles, and the path of each ratio."""

    tables: tuple[BiaxialTable, ...]
    cycles: tuple[tuple[Cycle, ...], ...]
    paths: tuple[BiaxialPath, ...]


def read_biaxial(place: Place, section: BiaxialSection) -> BiaxialData:
    """Read the data of a section; none where a file is missing and not needed."""
    data = section.data
    folder = place.data_folder
    if folder is None:
        folder = beside(place.path.parent, data.folder)
    tables, named = [], []
    for path, field, ratio in _listed(place, data, folder):
        if not is_file(path):
            if not place.need_data:
                return BiaxialData((), (), ())
            raise place.error(field, f"there is no file {path}; --data DIR names another folder")
        tables.append(
            read_biaxial_table(
                path,
                columns={k: v for k, v in data.columns.model_dump().items() if v is not None},
                load_unit=data.load_unit,
                strain_unit=data.strain_unit,
                decimal=data.decimal,
                comment=data.comment,
                format=named_format(place, "data.format", "machine table", data.format),
            )
        )
        named.append(ratio)
    cycles = cycles_of(tables, named)
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
    thinned = tuple(path.thinned(section.points) for path in paths)
    return BiaxialData(tuple(tables), tuple(tuple(own) for own in cycles), thinned)


def _listed(place: Place, data: TablesSection, folder: Path) -> list[tuple[Path, str, str | None]]:
    """Return each file, its key, and the ratio that it is listed for."""
    if isinstance(data.files, list):
        return [(folder / name, f"data.files[{i}]", None) for i, name in enumerate(data.files)]
    listed: list[tuple[Path, str, str | None]] = []
    for key, names in data.files.items():
        ratio = _ratio(place, f"data.files.{key}", key)
        listed += [(folder / name, f"data.files.{key}[{i}]", ratio) for i, name in enumerate(names)]
    return listed


def _ratio(place: Place, field: str, name: str) -> str:
    try:
        return plain_ratio(name)
    except InputError as error:
        raise place.error(field, error.problem) from None


#: Strains below it are none that a law could be fitted over.
LEAST_STRAIN = 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class BiaxialTest:
    """A cruciform loaded along warp and fill. Loads N/mm (kN/m), strains as shares.

    `noise` of one measured strain, None where it is not given.
    """

    name: str
    place: Place
    weight: float
    data: BiaxialData
    section: BiaxialSection
    noise: float | None = None
    kind: str = "biaxial"

    @property
    def reads_files(self) -> bool:
        """Return True: a biaxial test is measured."""
        return True

    @property
    def reach(self) -> Reach:
        """Return the largest strains along warp and fill."""
        return reach_of(self.data.paths)

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, PatchModel]:
        """Return a patch for each ratio, driven by the loads as they were measured.

        There is nothing to refine: one point of the law, one increment a reading.
        """
        thick = self.place.fabric.thickness if thickness is None else thickness
        return {path.ratio: PatchModel(path.load, thick) for path in self.data.paths}

    def settings(self) -> Mapping[str, object]:
        """Return the settings that a result depends on; data count by themselves."""
        return {"weight": self.weight, "noise": self.noise}


def reach_of(paths: Sequence[BiaxialPath]) -> Reach:
    """Return the largest strains along warp and fill; the shear stays unknown."""
    if not paths:
        return Reach()
    ends = np.max([path.strain.max(axis=0) for path in paths], axis=0)
    warp, fill = (float(np.log1p(end)) if end > LEAST_STRAIN else None for end in ends)
    return Reach((warp, fill, None))


def read(section: BiaxialSection, place: Place, name: str) -> BiaxialTest:
    """Read the section of a test, and its files."""
    noise = None if section.noise is None else 0.01 * section.noise
    return BiaxialTest(
        name=name,
        place=place,
        weight=section.weight,
        data=read_biaxial(place, section),
        section=section,
        noise=noise,
    )
