"""Fit a law to measured bending of inflated cylinders: section [[bending]], data, comparison."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...errors import SolverFailure
from ...inference.comparison import Comparison
from ...inference.objective import NoiseIs
from ...readers.sections import Positive, Weight
from ...solvers.base import Array, History
from ..base import MakeSolver, Masks, Weighting
from ..cylinder.test import PART, BentSection, CylinderTest
from ..cylinder.test import read as read_cylinder
from ..measured import MeasuredKind, PreparedWhole
from ..sections import Place
from ..strips.load_objective import LoadObjective

#: Number of frames of a bending, unless the section gives it.
FRAMES = 12


@dataclass(frozen=True)
class AssumedNoise:
    """Noise of measured loads where the section does not give it."""

    share: float = 0.02  # standard deviation of one load, over the largest load
    independent_values: float = 5.0  # how many of all loads are independent


NOISE = AssumedNoise()


class BendingSection(BentSection):
    """Section [[bending]]: a [[cylinder]] whose measured loads are fitted.

    `weight` is that of its error in the objective, `noise` the standard deviation of one load in N.
    """

    weight: Weight = 1.0
    noise: Positive | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class BendingTest(CylinderTest):
    """A cylinder with measured loads that a fit matches.

    `noise` is the standard deviation of one load (N), where the section gives it.
    """

    setting_names: ClassVar[tuple[str, ...]] = (*CylinderTest.setting_names, "weight", "noise")
    kind: str = "bending"

    @property
    def points(self) -> tuple[Array, Array]:
        """Return deflection (n,) mm and load (n,) N of the readings of all repetitions.

        Readings at or below zero deflection and beyond the last frame are left out.
        """
        if not self.measured:
            return np.empty(0), np.empty(0)
        deflection = np.concatenate([curve.deflection for curve in self.measured])
        load = np.concatenate([curve.load for curve in self.measured])
        is_matched = (deflection > 0) & (deflection <= self.deflections[-1] * (1 + 1e-9))
        return deflection[is_matched], load[is_matched]


def read(section: BendingSection, place: Place, name: str) -> BendingTest:
    """Read a bending test from its section and its measured loads.

    Parameters
    ----------
    section : BendingSection
    place : Place
        Place of the section in its project, with folders, units and messages.
    name : str
        Name of the test.

    Raises
    ------
    InputError
        If there are no measured loads, or fewer than two up to the last deflection.
    """
    if not section.measured.files:
        problem = (
            "this key is missing; without measured loads a cylinder is predicted: [[cylinder]]"
        )
        raise place.error("measured.files", problem)
    cylinder = read_cylinder(section, place, name)
    ends = [float(curve.deflection[-1]) for curve in cylinder.measured]
    if section.deflection is None and section.deflections is None and ends:
        end = max(ends)
        frames = section.frames or FRAMES
        cylinder = replace(cylinder, deflections=tuple(np.linspace(0.0, end, frames + 1)[1:]))
    fitted = {"kind": "bending", "weight": section.weight, "noise": section.noise}
    test = BendingTest(**vars(cylinder) | fitted)
    largest = float(np.abs(test.points[1]).max(initial=0.0))
    if cylinder.measured and not (len(test.points[0]) > 1 and largest > 0):
        end = test.deflections[-1] / place.scales.length
        problem = f"expected two or more loads between 0 and the last deflection, {end:g}"
        raise place.error("measured.files", problem)
    return test


class BendingObjective(LoadObjective):
    """Residuals of the loads on the collar, in which the model's frame 0 is the inflated cylinder.

    Parameters
    ----------
    test : BendingTest
        Test with measured loads.
    weighting : Weighting
        Weight of the test in the objective.
    """

    def __init__(self, test: BendingTest, weighting: Weighting) -> None:
        deflection, load = test.points
        largest = float(np.abs(load).max(initial=0.0))
        noise = test.noise
        noise_is: NoiseIs = "given"
        correlated_count = 1.0
        if noise is None:
            noise = NOISE.share * largest
            noise_is = "assumed"
            correlated_count = len(load) / NOISE.independent_values
        super().__init__(
            test.deflections,
            deflection,
            load,
            unit_error=largest if weighting.relative else 1.0,
            weight=weighting.weight,
            least_noise=noise,
            noise_is=noise_is,
            correlated_count=correlated_count,
        )
        self.sample = np.insert(self.sample, 0, 0.0, axis=1)

    def modelled(self, history: History) -> Array:
        """Return the model's loads (n,) N; SolverFailure where it ended early.

        A cylinder may buckle before the last measured deflection, of which strips know nothing:
        loads that the model does not reach cannot be compared.
        """
        if len(history.load) < self.sample.shape[1]:
            raise SolverFailure(history.early or "the bending ended early", "membrane")
        return super().modelled(history)


class PreparedBending(PreparedWhole):
    """A bending test with its data, ready to be compared with a model."""

    objective_is = "RMS error of the collar's load, N"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return the one comparison of measured and modelled loads."""
        model = self.test.models()[PART]
        objective = BendingObjective(self.test, weighting)
        # Wrinkles come and go, and tubes snap: an unstable frame is no reason to refuse a law.
        return (Comparison(self.test.name, model, make_solver(), objective, must_be_stable=False),)

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the comparison on a mesh whose edges are divided by a factor."""
        (comparison,) = self.comparisons(make_solver, weighting)
        model = self.test.models(None, "elements", factor)[PART]
        return (replace(comparison, model=model),)


class BendingKind(MeasuredKind):
    """An inflated cylinder in bending whose loads are fitted."""

    name = "bending"
    title = "an inflated cylinder in bending, with measured loads that a fit matches"
    section = BendingSection
    folder_key = "measured.folder"
    prepared = PreparedBending
    read = staticmethod(read)


KIND = BendingKind()
