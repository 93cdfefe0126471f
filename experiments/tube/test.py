"""Read a test of an inflated tube from its section of a project and its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from ...errors import InputError
from ...lazy_modules import pandas as pd
from ...meshes.strip_models import TubeModel
from ...readers.sections import Name, Positive, Section, Size, Weight
from ...solvers.base import Array
from ..base import Reach, Refined, SectionTest
from ..measured import PERCENT
from ..sections import Place

#: Columns of a file, with their factor to base units: loads (to MPa, N and N mm), and strains (to
#: shares, and twist in rad/mm), of which at least one is needed.
LOADS = {"pressure_kPa": 1e-3, "force_N": 1.0, "torque_Nm": 1e3}
STRAINS = {"axial_percent": 0.01, "hoop_percent": 0.01, "twist_deg_per_m": np.pi / 180e3}
PART = "tube"


class TubeSection(Section):
    """Section [[tube]]: an inflated tube pulled and twisted; noise of one strain, in %."""

    name: Name | None = None
    weight: Weight = 1.0
    diameter: Size
    file: str
    folder: str = ""
    noise: Positive | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class TubeTest(SectionTest):
    """A test of an inflated tube that is pulled and twisted, with its data.

    Attributes
    ----------
    radius : float, mm
        Radius of the tube.
    loads : (n, 3) array
        Gauge pressure (MPa), axial force (N) and torque (N mm), see `TubeModel`.
    strain : (n, 3) array
        Axial strain, hoop strain, and radius times twist per length; each from any zero, NaN in
        columns that were not measured.
    path : Path, optional
        File of loads and strains.
    """

    setting_names: ClassVar[tuple[str, ...]] = ("weight", "noise", "radius")

    radius: float
    loads: Array
    strain: Array
    path: Path | None = None
    kind: str = "tube"
    reads_files: bool = True

    @property
    def reach(self) -> Reach:
        """Return the largest shear of the wall.

        Axial and hoop strain are unknown, because the tube was inflated before the data begin.
        """
        shear = self.strain[:, 2]
        if not len(shear) or np.isnan(shear).any():
            return Reach()
        largest = float(np.abs(shear).max())
        return Reach((None, None, largest or None))

    def models(
        self,
        thickness: float | None = None,
        refined: Refined = "elements",
        factor: float = 1.0,
    ) -> Mapping[str, TubeModel]:
        """Return the one model of the tube, which has no mesh to refine."""
        return {PART: TubeModel(self.loads, self.radius, self.thick(thickness))}


def read(section: TubeSection, place: Place, name: str) -> TubeTest:
    """Read a tube test from its section and its file.

    Parameters
    ----------
    section : TubeSection
    place : Place
        Place of the section in its project, with folders, units and messages.
    name : str
        Name of the test.

    Raises
    ------
    InputError
        The file lacks columns, or has unknown columns or cells that are not finite numbers.
    """
    radius = 0.5 * section.diameter * place.scales.length
    path = place.folder(section.folder) / section.file
    noise = None if section.noise is None else section.noise / PERCENT
    # Columns as in `TubeTest`: pressure (MPa), axial force (N), torque (N mm); none without a file.
    loads = np.empty((0, 3))
    strain = np.empty((0, 3))
    if place.has(path, "file"):
        loads, strain = _read_loads_and_strains(path, radius)
    return TubeTest(
        name=name,
        place=place,
        weight=section.weight,
        radius=radius,
        loads=loads,
        strain=strain,
        noise=noise,
        path=path,
    )


def _read_loads_and_strains(path: Path, radius: float) -> tuple[Array, Array]:
    """Return loads (n, 3) and strains (n, 3) of a file."""
    table = _read_table(path)
    unmeasured = np.full(len(table), np.nan)
    loads = [scale * table[name].to_numpy(float) for name, scale in LOADS.items()]
    strain = [
        scale * table[name].to_numpy(float) if name in table else unmeasured
        for name, scale in STRAINS.items()
    ]
    strain[2] = radius * strain[2]
    return np.stack(loads, axis=1), np.stack(strain, axis=1)


def _read_table(path: Path) -> pd.DataFrame:
    """Return the table of a file; InputError for missing or unknown columns, or bad numbers."""
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(path, "", f"is not a CSV table: {reason}") from None
    _check_columns(path, [str(name) for name in table])
    for name in table:
        numbers = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
        if len(numbers) < 2 or not np.isfinite(numbers).all():
            raise InputError(path, str(name), "expected two or more rows of finite numbers")
    return table


def _check_columns(path: Path, columns: Sequence[str]) -> None:
    """Raise InputError for a table that lacks a load or any strain, or has other columns."""
    missing = [name for name in LOADS if name not in columns]
    if missing:
        raise InputError(path, missing[0], f"is missing; columns are: {', '.join(LOADS)}")
    if not set(STRAINS) & set(columns):
        raise InputError(path, "columns", f"expected one at least of {', '.join(STRAINS)}")
    known_columns = {*LOADS, *STRAINS}
    unknown = [name for name in columns if name not in known_columns]
    if unknown:
        names = ", ".join(sorted(known_columns))
        raise InputError(path, unknown[0], f"is no column here; known: {names}")
