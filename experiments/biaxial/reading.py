"""From a section of a biaxial test and its files to the paths that are evaluated."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...data.biaxial.cycles import Cycle
from ...data.biaxial.paths import BiaxialPath, cycles_of, evaluated_paths
from ...data.biaxial.ratios import plain_ratio
from ...data.biaxial.table import BiaxialTable, read_biaxial_table
from ...errors import InputError
from ...reading import is_file
from ...sections import beside
from ..base import Place
from ..formats import named_format
from .section import BiaxialSection, TablesSection


@dataclass(frozen=True, eq=False)
class BiaxialData:
    """All that was read: files, their cycles, and the path of each ratio, as it is evaluated."""

    tables: tuple[BiaxialTable, ...]
    cycles: tuple[tuple[Cycle, ...], ...]
    paths: tuple[BiaxialPath, ...]


def read_biaxial(place: Place, section: BiaxialSection) -> BiaxialData:
    """The data of a section; none where a file is not there and none is needed.

    Raises
    ------
    InputError : naming the project and the key, or the data file.
    """
    data = section.data
    folder = place.data_folder
    if folder is None:
        folder = beside(place.path.parent, data.folder)
    tables, named = [], []
    for path, field, ratio in _listed(place, data, folder):
        if not is_file(path):
            if not place.need_data:
                return BiaxialData((), (), ())
            problem = f"there is no file {path}; --data DIR names another folder"
            raise place.error(field, problem)
        tables.append(_table(place, data, path))
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
    """Each file, its key, and the ratio that it is listed for."""
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


def _table(place: Place, data: TablesSection, path: Path) -> BiaxialTable:
    return read_biaxial_table(
        path,
        columns={k: v for k, v in data.columns.model_dump().items() if v is not None},
        load_unit=data.load_unit,
        strain_unit=data.strain_unit,
        decimal=data.decimal,
        comment=data.comment,
        format=named_format(place, "data.format", "machine table", data.format),
    )
