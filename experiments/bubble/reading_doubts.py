"""Doubts about readings of a bubble: units, exchanged columns, a diameter for the radius."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..doubts import Doubt
from .readings import GaugeReadings, ReadingSeries
from .test import BubbleTest


@dataclass(frozen=True)
class PlausibleReadings:
    """Hold the usual ranges of readings of a bubble; heights are over the radius of the rim."""

    min_height: float = 0.01  # largest height: less is a wrong unit, or no test
    max_height: float = 1.0  # a hemisphere, which only soft membranes exceed
    impossible_height: float = 4.0  # a balloon
    min_correlation: float = 0.5  # rank correlation of height and pressure
    #: Exponent of the height as a power of the pressure: 1/3 for a flat elastic sheet, 1 for a
    #: tense one; above 1 height and pressure are exchanged.
    exponents: tuple[float, float] = (0.1, 1.3)


PLAUSIBLE = PlausibleReadings()


def doubts_of_readings(test: BubbleTest, readings: GaugeReadings) -> list[Doubt]:
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
    return doubts


def _doubts_of_heights(series: ReadingSeries, radius: float) -> Iterator[Doubt]:
    """Yield the doubts about one series of heights."""
    highest = float(series.value.max())
    pressure = series.pressure
    share = highest / radius
    largest = f"the {series.label} is {highest:.4g} mm at most, {share:.2g} of the radius"
    if highest <= 0 or np.corrcoef(pressure, series.value)[0, 1] < -PLAUSIBLE.min_correlation:
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
