"""Measured bending of inflated cylinders in a fit: section [[bending]], data, comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, cast

import numpy as np
from pydantic import Field

from ...errors import SolverFailure
from ...inference.comparison import Comparison, NoiseIs
from ...readers.sections import Positive
from ...solvers.base import History
from .. import kinds
from ..cylinder.reading import read as read_cylinder
from ..cylinder.section import BentSection
from ..cylinder.test import PART, CylinderTest
from ..kinds import Array, MakeSolver, Masks, Place, Weighting
from ..measured import MeasuredKind, PreparedWhole
from ..strips.prepared import LoadObjective

#: Frames of a bending, unless the section says otherwise.
FRAMES = 12
#: Noise of one load: of the largest, unless given; values that are taken to be independent.
NOISE, INDEPENDENT = 0.02, 5.0


class BendingSection(BentSection):
    """Section [[bending]]: a [[cylinder]] whose measured loads are fitted; noise of one, in N."""

    weight: Annotated[float, Field(ge=0, le=1e6)] = 1.0
    noise: Positive | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class BendingTest(CylinderTest):
    """A cylinder with measured loads; noise : of one load, N."""

    kind: str = "bending"

    @property
    def points(self) -> tuple[Array, Array]:
        """Return deflection (n,) mm and load (n,) N of all repetitions, up to the last frame."""
        every = [(c.deflection, c.load) for c in self.measured] or [(np.empty(0), np.empty(0))]
        way, load = (np.concatenate(own) for own in zip(*every, strict=True))
        inside = (way > 0) & (way <= self.deflections[-1] * (1 + 1e-9))
        return way[inside], load[inside]

    def settings(self) -> Mapping[str, object]:
        return {**super().settings(), "weight": self.weight, "noise": self.noise}


def read(section: BendingSection, place: Place, name: str) -> BendingTest:
    """Read the section of a test, and its loads; refuse one without any."""
    if not section.measured.files:
        problem = (
            "this key is missing; without measured loads a cylinder is predicted: [[cylinder]]"
        )
        raise place.error("measured.files", problem)
    cylinder = read_cylinder(section, place, name)
    ends = [float(curve.deflection[-1]) for curve in cylinder.measured]
    if section.deflection is None and section.deflections is None and ends:
        end, frames = max(ends), section.frames or FRAMES
        cylinder = replace(cylinder, deflections=tuple(np.linspace(0.0, end, frames + 1)[1:]))
    own = {"kind": "bending", "weight": section.weight, "noise": section.noise}
    test = BendingTest(**vars(cylinder) | own)
    largest = float(np.abs(test.points[1]).max(initial=0.0))
    if cylinder.measured and not (len(test.points[0]) > 1 and largest > 0):
        end = test.deflections[-1] / place.scales.length
        problem = f"expected two or more loads between 0 and the last deflection, {end:g}"
        raise place.error("measured.files", problem)
    return test


class BendingObjective(LoadObjective):
    """Residuals of the collar's loads; frame 0 is the inflated cylinder."""

    def __init__(self, test: BendingTest, weighting: Weighting) -> None:
        way, load = test.points
        largest = float(np.abs(load).max(initial=0.0))
        noise, noise_is, alike = test.noise, cast(NoiseIs, "given"), 1.0
        if noise is None:
            noise, noise_is, alike = NOISE * largest, "assumed", len(load) / INDEPENDENT
        scale = largest if weighting.relative else 1.0
        super().__init__(
            test.deflections, way, load, scale, weighting.weight, noise, noise_is, alike
        )
        self.sample = np.insert(self.sample, 0, 0.0, axis=1)

    def modelled(self, history: History) -> Array:
        if len(history.load) < self.sample.shape[1]:
            raise SolverFailure(history.early or "the bending ended early", "membrane")
        return super().modelled(history)


class PreparedBending(PreparedWhole):
    """A bent cylinder with its loads."""

    objective_is = "RMS error of the collar's load, N"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        model, objective = self.test.models()[PART], BendingObjective(self.test, weighting)
        # Wrinkles come and go, and tubes snap: an unstable frame is no reason to refuse a law.
        return (Comparison(self.test.name, model, make_solver(), objective, must_be_stable=False),)

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        (own,) = self.comparisons(make_solver, weighting)
        return (replace(own, model=self.test.models(what="elements", factor=factor)[PART]),)

    def data_files(self) -> Sequence[kinds.DataFile]:
        return self.test.data_files()


class Bending(MeasuredKind):
    """An inflated cylinder in bending whose loads are fitted."""

    name = "bending"
    title = "an inflated cylinder in bending, with measured loads that a fit matches"
    section = BendingSection
    folder_key = "measured.folder"
    prepared = PreparedBending
    read = staticmethod(read)


KIND = Bending()
