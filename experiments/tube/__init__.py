"""An inflated tube in tension and torsion: section [[tube]], data, comparison, candidates.

A long closed tube, warp along it, with the same strain everywhere (`TubeModel`): torsion shears the
wall as nothing but G12 resists, so that a tube tells G12 where strips and bubbles do not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from ...errors import InputError
from ...files import pandas as pd
from ...inference.comparison import Comparison
from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import TubeModel
from ...readers.frames import FrameSource
from ...readers.sections import Length, Name, Positive, Section
from ...solvers.base import History
from .. import kinds
from ..kinds import Array, MakeSolver, Masks, Place, Planning, Reach, SectionTest, Weighting
from ..measured import PERCENT, USUAL_NOISE, MeasuredKind, PreparedWhole, StrainObjective

#: Columns of a file: loads, in MPa, N and N mm per unit; strains, of which one is enough.
LOADS = {"pressure_kPa": 1e-3, "force_N": 1.0, "torque_Nm": 1e3}
STRAINS = {"axial_percent": 0.01, "hoop_percent": 0.01, "twist_deg_per_m": np.pi / 180e3}
PART = "tube"
#: Of a candidate: radius in mm, hoop strain over the law's range, loads, and values of a strain
#: that are taken to be independent.
RADIUS, INFLATED, STEPS, INDEPENDENT = 100.0, 0.3, 15, 5


class TubeSection(Section):
    """Section [[tube]]: an inflated tube pulled and twisted; noise of one strain, in %."""

    name: Name | None = None
    weight: Annotated[float, Field(ge=0, le=1e6)] = 1.0
    diameter: Length
    file: str
    folder: str = ""
    noise: Positive | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class TubeTest(SectionTest):
    """Loads (n, 3) as of `TubeModel`, and strains (n, 3) along, around, radius times twist.

    Strains from any zero; NaN in columns that are not measured.
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
        self, thickness: float | None = None, what: kinds.Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, TubeModel]:
        """Return the one model: nothing to refine."""
        return {PART: TubeModel(self.loads, self.radius, self.thick(thickness))}

    def settings(self) -> Mapping[str, object]:
        return {"weight": self.weight, "noise": self.noise, "radius": self.radius}


def read(section: TubeSection, place: Place, name: str) -> TubeTest:
    """Read the section of a test, and its file."""
    radius = 0.5 * section.diameter * place.scales.length
    path = place.folder(section.folder) / section.file
    noise = None if section.noise is None else section.noise / PERCENT
    loads, strain = np.empty((0, 3)), np.empty((0, 3))
    if place.has(path, "file"):
        loads, strain = _columns(path, radius)
    return TubeTest(
        name=name, place=place, weight=section.weight, radius=radius, loads=loads, strain=strain,
        noise=noise, path=path,
    )  # fmt: skip


def _columns(path: Path, radius: float) -> tuple[Array, Array]:
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"is not a CSV table: {str(error).splitlines()[0]}") from None
    known = {*LOADS, *STRAINS}
    if lacking := [name for name in LOADS if name not in table]:
        raise InputError(path, lacking[0], f"is missing; columns are: {', '.join(LOADS)}")
    if not set(STRAINS) & set(table.columns):
        raise InputError(path, "columns", f"expected one at least of {', '.join(STRAINS)}")
    if strange := [str(name) for name in table if name not in known]:
        raise InputError(path, strange[0], f"is no column here; known: {', '.join(sorted(known))}")
    for name in table:
        numbers = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
        if len(numbers) < 2 or not np.isfinite(numbers).all():
            raise InputError(path, str(name), "expected two or more rows of finite numbers")
    none = np.full(len(table), np.nan)
    loads = [scale * table[name].to_numpy(float) for name, scale in LOADS.items()]
    strain = [s * table[n].to_numpy(float) if n in table else none for n, s in STRAINS.items()]
    strain[2] = radius * strain[2]
    return np.stack(loads, axis=1), np.stack(strain, axis=1)


class TubeObjective(StrainObjective):
    """Residuals of each measured strain over its largest.

    The zero of a strain is not known: strains are compared about their means.
    """

    def __init__(self, test: TubeTest, weight: float) -> None:
        self.model = next(iter(test.models().values()))
        self.read = np.flatnonzero(~np.isnan(test.strain).any(axis=0))
        super().__init__(self.model.loads, test.strain[:, self.read], None, weight, test.noise)

    @property
    def places(self) -> tuple[Array, ...]:
        """Return the numbers of the rows: neighbours err as one."""
        return (np.arange(1.0, 1 + self.sizes[0])[:, None],) * len(self.sizes)

    @property
    def measured(self) -> Array:
        """Return what was measured (n, blocks) about its mean."""
        return _centred(self.strain)

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, blocks) about their means."""
        return _centred(self.model.strains(history.displacement)[:, self.read])

    def jacobian(self, history: History, slope: Array) -> Array:
        own = self.model.strain_slopes(history.displacement, slope)[:, self.read]
        return self.in_blocks(_centred(own))


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=0))


class PreparedTube(PreparedWhole):
    """A tube with its data."""

    objective_is = "sum of the RMS errors of the measured strains over their largest"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | float | None = None
    ) -> tuple[Comparison, ...]:
        test = self.test
        count = int((~np.isnan(test.strain).any(axis=0)).sum())
        weight = weighting.weight / count if weighting.relative else 1.0
        objective = TubeObjective(test, weight)
        return (Comparison(test.name, objective.model, make_solver(), objective, contracts=True),)

    finer = comparisons  # there is no mesh

    def data_files(self) -> Sequence[kinds.DataFile]:
        own = self.test.path
        count = len(self.test.loads)
        return [] if own is None else [kinds.DataFile(own, FrameSource("csv"), count, {})]


def candidates(planning: Planning) -> Sequence[kinds.Candidate]:
    """Return torsion of an inflated tube, up to the shear that the law is known for."""
    own = [test for test in planning.present if isinstance(test, PreparedTube)]
    noise_is = "assumed" if planning.noise is None else "given"
    return [kinds.Candidate("torsion of a tube", partial(_twisted, own, planning), noise_is)]


def _twisted(own: Sequence[PreparedTube], planning: Planning) -> PreparedTube:
    """Return a tube that is inflated, then twisted, with the strains that the law gives."""
    radius = own[0].test.radius if own else RADIUS
    law, thick, ends = planning.law, planning.place.fabric.thickness, planning.ends
    pressure = _integral(law, "E2", INFLATED * ends[1]) * thick / radius
    torque = 2 * np.pi * radius**2 * thick * _integral(law, "G12", ends[2])
    turns = np.linspace(0.0, torque, STEPS)
    loads = np.column_stack([np.full(STEPS, pressure), np.zeros(STEPS), turns])
    model = TubeModel(loads, radius, thick)
    strain = model.strains(planning.make_solver("membrane").run(model, law).displacement)
    noise = planning.noise or kinds.Precision(PERCENT * USUAL_NOISE, 1.0, INDEPENDENT).at(STEPS)
    test = TubeTest(
        name="torsion of a tube", place=planning.place, weight=1.0, radius=radius, loads=loads,
        strain=strain, noise=noise / PERCENT,
    )  # fmt: skip
    return PreparedTube(test)


def _integral(law: HypoelasticLaw, name: str, end: ArrayLike) -> float:
    """Return the stress (MPa) that a modulus gives up to a strain."""
    strain = np.linspace(0.0, float(np.asarray(end)), 50)
    return float(np.trapezoid(law.modulus(name, strain), strain))


class Tube(MeasuredKind):
    """An inflated tube in tension and torsion."""

    name = "tube"
    title = "an inflated tube in tension and torsion"
    section = TubeSection
    folder_key = "folder"
    prepared = PreparedTube
    read = staticmethod(read)
    candidates = staticmethod(candidates)


KIND = Tube()
