"""Tests of an inflated tube in tension and torsion.

The tube is long and closed, its warp runs along the axis, and its strain is the same everywhere
(`TubeModel`). In torsion only the shear modulus G12 resists, so that a tube determines G12 where
strips and bubbles do not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ...inference.comparison import Comparison
from ...lazy_modules import pandas as pd
from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import TubeModel
from ...readers.frames import FrameSource
from ...readers.sections import Name, Positive, Section, Size, Weight
from ...solvers.base import Array, History
from ..base import (
    Candidate,
    MakeSolver,
    Masks,
    Planning,
    Precision,
    Reach,
    Refined,
    SectionTest,
    Weighting,
)
from ..data_files import DataFile
from ..measured import PERCENT, USUAL_NOISE, MeasuredKind, PreparedWhole, StrainObjective
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
    if not isinstance(table.index, pd.RangeIndex):  # rows are longer than the heading
        if not table.iloc[:, -1].isna().all():
            raise InputError(path, "", "a row has more numbers than the heading has names")
        table = pd.read_csv(path, comment="#", skipinitialspace=True, index_col=False)
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


class TubeObjective(StrainObjective):
    """Residuals of the measured strains, each over its largest value.

    The zero of a strain is not known, so that each strain is compared less its mean over the test.

    Parameters
    ----------
    test : TubeTest
        Test with at least one measured strain.
    weight : float
        Weight of the test in the objective.
    """

    def __init__(self, test: TubeTest, weight: float) -> None:
        (self.model,) = test.models().values()
        self.components = np.flatnonzero(~np.isnan(test.strain).any(axis=0))
        strain = test.strain[:, self.components]
        super().__init__(self.model.loads, strain, None, weight, test.noise)

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the number (n, 1) of each row, over which errors may be correlated."""
        rows = np.arange(1.0, 1 + self.sizes[0])
        return (rows[:, None],) * len(self.sizes)

    @property
    def measured_strain(self) -> Array:
        """Return the measured strains (n, blocks) less their means, a block for each component."""
        return _centred(self.strain)

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, blocks) less their means."""
        return _centred(self.model.strains(history.displacement)[:, self.components])

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives (m, parameters) of the residuals by the parameters.

        Parameters
        ----------
        slope : (n, 4, 3, parameters) array, mm
            Derivatives of the displacements of the patch's corners.
        """
        slopes = self.model.strain_slopes(history.displacement, slope)[:, self.components]
        return self.in_blocks(_centred(slopes))


def _centred(values: Array) -> Array:
    """Return values (n, ...) less their means over the n rows."""
    return values - values.mean(axis=0)


class PreparedTube(PreparedWhole):
    """A tube with its data."""

    objective_is = "sum of the RMS errors of the measured strains over their largest"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | float | None = None
    ) -> tuple[Comparison, ...]:
        """Return the one comparison, each measured strain of equal weight."""
        test = self.test
        count = int((~np.isnan(test.strain).any(axis=0)).sum())
        objective = TubeObjective(test, weighting.of_block(count))
        return (Comparison(test.name, objective.model, make_solver(), objective, contracts=True),)

    finer = comparisons  # there is no mesh

    def data_files(self) -> Sequence[DataFile]:
        """Return the file of loads and strains."""
        path = self.test.path
        if path is None:
            return []
        return [DataFile(path, FrameSource("csv"), len(self.test.loads), {})]


@dataclass(frozen=True)
class CandidateTube:
    """A tube that a plan proposes."""

    radius: float = 100.0  # mm, if the project has no tube
    hoop_share: float = 0.3  # hoop strain of the inflated tube over the law's range
    steps: int = 15  # number of steps of torsion
    independent_values: int = 5  # how many values of a strain count as independent


CANDIDATE = CandidateTube()


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return the candidate test: torsion of an inflated tube up to the shear of the law's range."""
    tubes = [test for test in planning.present if isinstance(test, PreparedTube)]
    make = partial(_twisted, tubes, planning)
    return [Candidate("torsion of a tube", make, planning.noise_is())]


def _twisted(tubes: Sequence[PreparedTube], planning: Planning) -> PreparedTube:
    """Return a tube test, inflated and then twisted, with the strains that the law predicts."""
    radius = tubes[0].test.radius if tubes else CANDIDATE.radius
    law = planning.law
    thickness = planning.place.fabric.thickness
    ends = planning.ends
    pressure = _integral(law, "E2", CANDIDATE.hoop_share * ends[1]) * thickness / radius
    largest_torque = 2 * np.pi * radius**2 * thickness * _integral(law, "G12", ends[2])
    steps = CANDIDATE.steps
    torque = np.linspace(0.0, largest_torque, steps)
    loads = np.column_stack([np.full(steps, pressure), np.zeros(steps), torque])
    model = TubeModel(loads, radius, thickness)
    strain = model.strains(planning.make_solver("membrane").run(model, law).displacement)
    noise = planning.noise
    if not noise:
        usual = Precision(PERCENT * USUAL_NOISE, 1.0, CANDIDATE.independent_values)
        noise = usual.for_values(steps)
    test = TubeTest(
        name="torsion of a tube",
        place=planning.place,
        weight=1.0,
        radius=radius,
        loads=loads,
        strain=strain,
        noise=noise / PERCENT,
    )
    return PreparedTube(test)


def _integral(law: HypoelasticLaw, name: str, end: ArrayLike) -> float:
    """Return the stress (MPa) at strain `end`: the integral of the modulus `name` over strain."""
    strain = np.linspace(0.0, float(np.asarray(end)), 50)
    return float(np.trapezoid(law.modulus(name, strain), strain))


class TubeKind(MeasuredKind):
    """An inflated tube in tension and torsion."""

    name = "tube"
    title = "an inflated tube in tension and torsion"
    section = TubeSection
    folder_key = "folder"
    prepared = PreparedTube
    read = staticmethod(read)
    candidates = staticmethod(candidates)


KIND = TubeKind()
