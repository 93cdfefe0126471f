"""A bubble test without a camera, prepared with its readings: the fit's comparison, and doubts."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...inference.comparison import Comparison
from ...inference.objective import Objective
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.sampling import SmoothReading
from ..base import MakeSolver, Masks, Weighting
from ..cap import CapEstimate
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from . import BubbleTest, prepared
from .nuisance import reading_nuisance
from .prepared import OBJECTIVES, PreparedInflation
from .reading_objective import ReadingObjective, reader_of
from .readings import GaugeReadings, ReadingSeries
from .sheet import FLAT, MeasuredSheet

#: Largest distance of a gauge that reads the apex from the centre, as a share of the radius.
CENTRAL = 0.03
#: Quads of the mesh with which moduli are estimated before a fit.
COARSE_QUADS = 108


@dataclass(frozen=True, eq=False)
class PreparedReadings(PreparedInflation):
    """A bubble test with its readings of heights, curvatures or strains.

    Attributes
    ----------
    test : BubbleTest
        Its data are `GaugeReadings`.
    """

    test: BubbleTest
    sheet: MeasuredSheet = FLAT

    @property
    def readings(self) -> GaugeReadings:
        """Return the readings of the test."""
        assert isinstance(self.test.data, GaugeReadings)
        return self.test.data

    @property
    def objective_is(self) -> str:
        return OBJECTIVES[self.test.objective]

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return the number of the specimen of each reading; empty for a single specimen."""
        numbers = np.concatenate([series.specimens for series in self.readings.series])
        return {self.test.name: numbers.tolist()} if len(np.unique(numbers)) > 1 else {}

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return the one comparison of all readings; none if masks keep no reading."""
        test = self.test
        series = self._masked_series((masks or {}).get(test.name))
        if not series:
            return ()
        model = self.model
        weight = weighting.of_block(len(series))
        scaling = "e" if weighting.relative else test.objective
        reading = SmoothReading.of(model.mesh)
        readers = [reader_of(s, test.pressures, reading) for s in series]
        noise = dict(self.readings.noise)
        if test.noise is not None:
            noise["height"] = test.noise
        objective = ReadingObjective(readers, scaling, weight, noise)
        objective.is_exchangeable = test.outline.round and all(
            s.quantity == "height" and not s.positions.any() for s in series
        )
        nuisance = reading_nuisance(test, model, objective)
        return (Comparison(test.name, model, make_solver(), objective, nuisance, stage=2),)

    def _masked_series(self, mask: NDArray[np.bool_] | None) -> list[ReadingSeries]:
        """Return the series with the readings that a mask keeps, without empty ones.

        `mask` (n,) is over the readings of all series, one after the other; None keeps all.
        """
        series = self.readings.series
        if mask is None:
            return list(series)
        ends = np.cumsum([len(s.value) for s in series])[:-1]
        masked = zip(series, np.split(mask, ends), strict=True)
        return [s.subset(rows) for s, rows in masked if rows.any()]

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return the comparison on a coarse mesh: no shape is measured that could be balanced."""
        (comparison,) = self.comparisons(make_solver, Weighting())
        quad_ratio = COARSE_QUADS / len(comparison.model.mesh.quads)
        return (self.refined(comparison, min(1.0, quad_ratio**0.5)),)

    def objective_on(self, model: BubbleModel, comparison: Comparison) -> Objective:
        objective = copy.copy(comparison.objective)
        assert isinstance(objective, ReadingObjective)
        reading = SmoothReading.of(model.mesh)
        objective.readers = tuple(replace(r, reading=reading) for r in objective.readers)
        return objective

    def closed_form(self, law: HypoelasticLaw) -> CapEstimate | None:
        """Return the estimate by mean heights of the centre; None where there are none."""
        pressures = []
        heights = []
        for series in self.readings.series:
            distances = np.linalg.norm(series.positions, axis=1)
            is_central = distances <= CENTRAL * self.test.outline.dome_radius
            if series.quantity == "height":
                pressures.append(series.pressure[is_central])
                heights.append(series.value[is_central])
        if not pressures:
            return None
        levels, level_of = np.unique(np.concatenate(pressures), return_inverse=True)
        sums = np.bincount(level_of, np.concatenate(heights), len(levels))
        return prepared.closed_form_of(self.test, levels, sums / np.bincount(level_of), law)

    def data_files(self) -> Sequence[DataFile]:
        """Return the tables that were read."""
        return joined(self.readings.files)

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        return _doubts_of_readings(self.test, self.readings)


def prepare(
    test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver
) -> PreparedReadings | prepared.PreparedBubble:
    """Return a bubble test with its readings, or with its fields, see `prepared.prepare`."""
    if isinstance(test.data, GaugeReadings):
        return PreparedReadings(test)
    return prepared.prepare(test, law, make_solver)


@dataclass(frozen=True)
class PlausibleReadings:
    """Hold the usual ranges of readings of a bubble; heights are over the radius of the rim."""

    min_height: float = 0.01  # largest height: less is a wrong unit, or no test
    max_height: float = 1.0  # a hemisphere, which only soft membranes exceed
    impossible_height: float = 4.0  # a balloon
    max_height_at_rest: float = 0.02  # over the largest: more is a gauge that was not zeroed
    min_correlation: float = 0.5  # rank correlation of height and pressure
    #: Exponent of the height as a power of the pressure: 1/3 for a flat elastic sheet, 1 for a
    #: tense one; above 1 height and pressure are exchanged.
    exponents: tuple[float, float] = (0.1, 1.3)


PLAUSIBLE = PlausibleReadings()


def _doubts_of_readings(test: BubbleTest, readings: GaugeReadings) -> list[Doubt]:
    """Return the doubts about the readings of a test.

    Parameters
    ----------
    test : BubbleTest
    readings : GaugeReadings
    """
    doubts: list[Doubt] = []
    for series in readings.series:
        if series.quantity == "height":
            doubts += _doubts_of_heights(series, test.outline.radius)
            if test.height_offset is None:
                doubts += _doubts_of_zero(series)
    left_out = max((series.left_out for series in readings.series), default=0)
    if left_out and test.inflation == 1:
        words = (
            f"{left_out} readings under pressure are left out: they are of a release or of another "
            "inflation, if rows are in order of time; put them in order, or choose by inflation = N"
        )
        doubts.append(Doubt("left-out", False, words))
    return doubts


def _doubts_of_zero(series: ReadingSeries) -> Iterator[Doubt]:
    """Yield a doubt if heights without pressure are not zero."""
    height = series.at_rest or 0.0
    if abs(height) > PLAUSIBLE.max_height_at_rest * float(np.abs(series.value).max()):
        words = (
            f"the {series.label} is {height:.3g} mm without pressure: all count from the sheet at "
            "rest; subtract it, or let [bubble.nuisance] height_offset find it"
        )
        yield Doubt("not-zeroed", False, words)


def _doubts_of_heights(series: ReadingSeries, radius: float) -> Iterator[Doubt]:
    """Yield the doubts about one series of heights."""
    highest = float(series.value.max())
    pressure = series.pressure
    share = highest / radius
    largest = f"the {series.label} is {highest:.4g} mm at most, {share:.2g} of the radius"
    correlation = 0.0
    if np.ptp(pressure) * np.ptp(series.value) > 0:  # not so of a single reading
        correlation = np.corrcoef(pressure, series.value)[0, 1]
    if highest <= 0 or correlation < -PLAUSIBLE.min_correlation:
        words = f"the {series.label} falls with the pressure: turn its sign, or exchange columns"
        yield Doubt("height-falls", True, words)
        return
    if not PLAUSIBLE.min_height <= share <= PLAUSIBLE.impossible_height:
        yield Doubt("height-unit", True, f"{largest}: is the unit of length right, and the radius?")
    elif share > PLAUSIBLE.max_height:
        words = f"{largest}, more than a hemisphere: is a diameter given for the radius?"
        yield Doubt("radius", False, words)
    is_rising = series.value > 0.05 * highest
    if is_rising.sum() < 3 or np.ptp(np.log(pressure[is_rising])) < 0.5:
        return
    exponent = float(np.polyfit(np.log(pressure[is_rising]), np.log(series.value[is_rising]), 1)[0])
    low, high = PLAUSIBLE.exponents
    if not low <= exponent <= high:
        words = (
            f"the {series.label} grows with the {exponent:.2g}th power of the pressure, a sheet's "
            "with the third root to the first: are height and pressure exchanged?"
        )
        yield Doubt("exchanged", True, words)
