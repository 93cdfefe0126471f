"""A bubble test without a camera, prepared with its readings: the fit's comparison, and doubts."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...inference.comparison import Comparison
from ...inference.objective import Objective
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.disk import Outline
from ...meshes.sampling import SmoothReading
from ...solvers.base import Array
from ..base import MakeSolver, Masks, Weighting
from ..cap import CapEstimate
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from . import BubbleTest, prepared
from .doubts import absolute_pressure
from .nuisance import reading_nuisance
from .prepared import OBJECTIVES, PreparedInflation
from .reading_objective import ReadingObjective, reader_of
from .readings import LIMITS, GaugeReadings, ReadingSeries
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
        central = self._central_heights()
        return None if central is None else prepared.closed_form_of(self.test, *central, law)

    def _central_heights(self) -> tuple[Array, Array] | None:
        """Return pressures (n,), MPa, rising, and mean heights of the centre at them, mm."""
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
        return levels, sums / np.bincount(level_of)

    def data_files(self) -> Sequence[DataFile]:
        """Return the tables that were read."""
        return joined(self.readings.files)

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        doubts = _doubts_of_readings(self.test, self.readings)
        central = self._central_heights()
        if central is not None and not any(doubt.sure for doubt in doubts):
            doubts += absolute_pressure(*central)
            doubts += _doubts_of_modulus(self.test, *central, expected)
        return doubts


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
    #: Radius of the disk over the one that is stated, by the fall of heights from the centre.
    radius_ratio: tuple[float, float] = (0.56, 1.8)
    max_dome: float = 0.6  # largest height, over the radius, of a dome that is about a paraboloid
    #: Largest strain of the apex over that of a cap of its curvature.
    strain_ratio: tuple[float, float] = (0.4, 3.0)
    max_rim: float = 0.3  # height on the rim over that of the apex, at the lowest pressure
    min_reach: float = 0.2  # smallest distance from the centre, over the radius, that shows a fall


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
    doubts += _doubts_of_strain(readings, test.outline)
    if test.height_offset is None:
        doubts += _doubts_of_shape(readings, test.outline)
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


def _doubts_of_strain(readings: GaugeReadings, outline: Outline) -> Iterator[Doubt]:
    """Yield a doubt if the strains of the apex are not those of a cap of the curvatures read."""
    largest: dict[str, list[float]] = {"curvature": [], "strain": []}
    for series in readings.series:
        if series.quantity in largest:
            largest[series.quantity].append(float(np.abs(series.value).max()))
    if not all(largest.values()):
        return
    curvature, strain = (float(np.mean(values)) for values in largest.values())
    # Of a cap of height h = R^2 k / 2, as 2/3 (h / R)^2.
    cap_strain = (outline.dome_radius * curvature) ** 2 / 6
    low, high = PLAUSIBLE.strain_ratio
    if not low < strain / cap_strain < high:
        words = (
            f"the apex strains by {100 * strain:.3g} % where its curvature is {curvature:.3g} "
            f"1/mm, and a cap of that by about {100 * cap_strain:.3g} %: are strain_unit, "
            "curvature_unit, curvature_is and the radius right?"
        )
        is_sure = not low / 10 < strain / cap_strain < 10 * high
        yield Doubt("strain-rise", is_sure, words)


def _doubts_of_shape(readings: GaugeReadings, outline: Outline) -> Iterator[Doubt]:
    """Yield doubts if heights fall from the centre as on another disk, or end above the rim."""
    largest = _dome(readings, outline, np.max)
    least = _dome(readings, outline, np.min)
    if largest is None or least is None or largest.apex > PLAUSIBLE.max_dome * outline.radius:
        return
    low, high = PLAUSIBLE.radius_ratio
    if not low < largest.radius_ratio < high:
        ratio = largest.radius_ratio
        radius = outline.radius
        fall = f"as on a disk of radius {ratio * radius:.3g} mm" if ratio < 100 else "nowhere"
        words = (
            f"the heights fall from the centre {fall}, and the project says {radius:.3g} mm: is "
            "the radius right (not the diameter), and the places of the gauges?"
        )
        yield Doubt("radius", False, words)
    is_constant = low < least.at_rim / max(largest.at_rim, 1e-9) < high
    has_risen = largest.apex > 1.5 * least.apex
    if is_constant and has_risen and least.at_rim > PLAUSIBLE.max_rim * least.apex:
        words = (
            f"the heights end about {least.at_rim:.3g} mm above the rim at the lowest pressure, "
            f"and {largest.at_rim:.3g} mm at the largest: all count from the sheet at rest; "
            "subtract what is read there, or let [bubble.nuisance] height_offset find it"
        )
        yield Doubt("not-zeroed", False, words)


@dataclass(frozen=True)
class Dome:
    """A paraboloid through heights at one pressure, mm: at the apex, and where the rim is."""

    apex: float
    at_rim: float

    @property
    def radius_ratio(self) -> float:
        """Return the radius on which the height is zero over that of the rim."""
        return float(np.sqrt(self.apex / max(self.apex - self.at_rim, 1e-9 * self.apex)))


def _dome(
    readings: GaugeReadings, outline: Outline, chosen: Callable[[Array], float]
) -> Dome | None:
    """Return the dome at the least or the largest pressure; None where too few places tell it."""
    heights = [s for s in readings.series if s.quantity == "height"]
    if not heights:
        return None
    pressure = np.concatenate([s.pressure for s in heights])
    rows = np.abs(pressure / chosen(pressure) - 1) < LIMITS.pressure_scatter
    squares = np.concatenate([outline.share(s.positions) ** 2 for s in heights])[rows]
    height = np.concatenate([s.value - (s.at_rest or 0.0) for s in heights])[rows]
    if np.ptp(squares) < PLAUSIBLE.min_reach**2:
        return None
    slope, apex = np.polyfit(squares, height, 1)
    return Dome(float(apex), float(apex + slope)) if apex > 0 else None


def _doubts_of_modulus(
    test: BubbleTest, pressures: Array, heights: Array, expected: Expected
) -> Iterator[Doubt]:
    """Yield a doubt if heights (n,), mm, of the centre call for a modulus far beyond the bounds."""
    if not expected.moduli:
        return
    law = HypoelasticLaw.linear(1.0, 1.0, 1.0)
    estimate = prepared.closed_form_of(test, pressures, heights, law)
    if estimate is None:
        return
    modulus = (1 - law.nu12) * float(estimate.stress[-1] / estimate.strain[-1])
    beyond_bounds = expected.outside(modulus, ("E1", "E2"))
    if beyond_bounds:
        words = (
            f"the height at {1e3 * pressures[-1]:.4g} kPa calls for a modulus of about "
            f"{beyond_bounds}: are pressure and height in the units that are said, and radius "
            "(not the diameter) and thickness right?"
        )
        yield Doubt("pressure-unit", True, words)


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
