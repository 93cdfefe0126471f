"""An inflated tube in tension and torsion: section [[tube]], data, comparison, candidates.

A long closed tube, warp along it, with the same strain everywhere (`TubeModel`): torsion shears the
wall as nothing but G12 resists, so that a tube tells G12 where strips and bubbles do not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

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
from ..base import MakeSolver, Masks, Reach, Refined, SectionTest, Weighting
from ..data_files import DataFile
from ..measured import PERCENT, USUAL_NOISE, MeasuredKind, PreparedWhole, StrainObjective
from ..planning import Candidate, Planning, Precision
from ..sections import Place

#: Columns of a file: loads, in MPa, N and N mm per unit; strains, of which one is enough.
LOADS = {"pressure_kPa": 1e-3, "force_N": 1.0, "torque_Nm": 1e3}
STRAINS = {"axial_percent": 0.01, "hoop_percent": 0.01, "twist_deg_per_m": np.pi / 180e3}
PART = "tube"


@dataclass(frozen=True)
class CandidateTube:
    """A tube that a plan proposes."""

    radius: float = 100.0  # mm, without a tube in the project
    hoop_share: float = 0.3  # hoop strain of the inflated tube over the law's range
    steps: int = 15  # of torsion
    independent_values: int = 5  # values of a strain that are taken to be independent


CANDIDATE = CandidateTube()


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
    """An inflated tube that is pulled and twisted.

    Parameters
    ----------
    radius : float
        mm.
    loads : (n, 3) array
        As of `TubeModel`.
    strain : (n, 3) array
        Along, around, radius times twist, from any zero; NaN in columns that are not measured.
    path : Path, optional
        File of loads and strains.
    """

    radius: float
    loads: Array
    strain: Array
    path: Path | None = None
    kind: str = "tube"
    reads_files: bool = True

    @property
    def reach(self) -> Reach:
        """Return the largest shear of lines along the tube; other strains begin before the data."""
        if not len(self.strain) or np.isnan(self.strain[:, 2]).any():
            return Reach()
        return Reach((None, None, float(np.abs(self.strain[:, 2]).max()) or None))

    def models(
        self,
        thickness: float | None = None,
        refined: Refined = "elements",
        factor: float = 1.0,
    ) -> Mapping[str, TubeModel]:
        """Return the one model: nothing to refine."""
        return {PART: TubeModel(self.loads, self.radius, self.thick(thickness))}

    def settings(self) -> Mapping[str, object]:
        """Return everything but names and measurements."""
        return {"weight": self.weight, "noise": self.noise, "radius": self.radius}


def read(section: TubeSection, place: Place, name: str) -> TubeTest:
    """Read the section of a test, and its file.

    Raises
    ------
    InputError
        If the file lacks columns, or has unknown ones or other than finite numbers.
    """
    radius = 0.5 * section.diameter * place.scales.length
    path = place.folder(section.folder) / section.file
    noise = None if section.noise is None else section.noise / PERCENT
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
    """Return the table of a file; InputError for missing or unknown columns, and no numbers."""
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"is not a CSV table: {str(error).splitlines()[0]}") from None
    names = {*LOADS, *STRAINS}
    if missing := [name for name in LOADS if name not in table]:
        raise InputError(path, missing[0], f"is missing; columns are: {', '.join(LOADS)}")
    if not set(STRAINS) & set(table.columns):
        raise InputError(path, "columns", f"expected one at least of {', '.join(STRAINS)}")
    if unknown := [str(name) for name in table if name not in names]:
        raise InputError(path, unknown[0], f"is no column here; known: {', '.join(sorted(names))}")
    for name in table:
        numbers = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
        if len(numbers) < 2 or not np.isfinite(numbers).all():
            raise InputError(path, str(name), "expected two or more rows of finite numbers")
    return table


class TubeObjective(StrainObjective):
    """Residuals of each measured strain over its largest.

    The zero of a strain is not known: strains are compared about their means.

    Parameters
    ----------
    test : TubeTest
        With at least one measured strain.
    weight : float
        Of the test in the objective.
    """

    def __init__(self, test: TubeTest, weight: float) -> None:
        self.model = next(iter(test.models().values()))
        self.columns = np.flatnonzero(~np.isnan(test.strain).any(axis=0))
        super().__init__(self.model.loads, test.strain[:, self.columns], None, weight, test.noise)

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the numbers of the rows: neighbours err as one."""
        return (np.arange(1.0, 1 + self.sizes[0])[:, None],) * len(self.sizes)

    @property
    def measured(self) -> Array:
        """Return what was measured (n, blocks) about its mean."""
        return _centred(self.strain)

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, blocks) about their means."""
        return _centred(self.model.strains(history.displacement)[:, self.columns])

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives of the residuals by the parameters."""
        slopes = self.model.strain_slopes(history.displacement, slope)[:, self.columns]
        return self.in_blocks(_centred(slopes))


def _centred(values: Array) -> Array:
    """Return values (n, ...) about their means."""
    return np.asarray(values - values.mean(axis=0))


class PreparedTube(PreparedWhole):
    """A tube with its data."""

    objective_is = "sum of the RMS errors of the measured strains over their largest"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | float | None = None
    ) -> tuple[Comparison, ...]:
        """Return the one comparison, each measured strain of equal weight."""
        test = self.test
        count = int((~np.isnan(test.strain).any(axis=0)).sum())
        weight = weighting.weight / count if weighting.relative else 1.0
        objective = TubeObjective(test, weight)
        return (Comparison(test.name, objective.model, make_solver(), objective, contracts=True),)

    finer = comparisons  # there is no mesh

    def data_files(self) -> Sequence[DataFile]:
        """Return the file of loads and strains."""
        path = self.test.path
        if path is None:
            return []
        return [DataFile(path, FrameSource("csv"), len(self.test.loads), {})]


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return torsion of an inflated tube, up to the shear that the law is known for."""
    tubes = [test for test in planning.present if isinstance(test, PreparedTube)]
    noise_is = "assumed" if planning.noise is None else "given"
    return [Candidate("torsion of a tube", partial(_twisted, tubes, planning), noise_is)]


def _twisted(tubes: Sequence[PreparedTube], planning: Planning) -> PreparedTube:
    """Return a tube that is inflated, then twisted, with the strains that the law gives."""
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
        noise = usual.at(steps)
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
    """Return the stress (MPa) that a modulus gives up to a strain."""
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
