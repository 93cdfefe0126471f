"""Evaluate curves of load over deflection: stiffness, knee, limit point; compare with measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...meshes.cylinder_model import CurveReading
from ...readers.bending import BendingCurve
from ...solvers.base import Array

#: Relative difference of deflections up to which they count as equal.
ROUNDING = 1e-9


@dataclass(frozen=True)
class CurveCriteria:
    """Criteria that define stiffness, knee, limit point and straightness of a curve."""

    stiffness_frames: int = 3  # least number of frames whose slope is the initial stiffness
    knee_slope: float = 0.5  # slope at the knee over the stiffness
    knee_positions: int = 20  # number of slopes in each stretch of deflection `slope_over`
    limit_fall: float = 0.005  # least fall of the load after a limit point, over the largest load
    straight_share: float = 0.5  # load up to which straightness counts, over that at the knee
    #: Shares of the reference load between which the secant stiffness is taken to compare with
    #: measured curves, whose first newtons are friction of rig and wall.
    secant_from: float = 0.1
    secant_to: float = 0.35


CRITERIA = CurveCriteria()
#: Properties, besides loads, that are compared with measured curves. They differ from stiffness and
#: knee of `BendingMeasures`, which count from zero load.
CURVE_PROPERTIES = ("secant stiffness", "secant knee", "limit point")


class CurvePoint(NamedTuple):
    """A point of a curve: deflection in mm, load in N."""

    deflection: float
    load: float


def initial_stiffness(d: Array, load: Array, over: float) -> float | None:
    """Return the slope of the straight line through the first frames.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    over : float
        Deflection up to which frames count, mm; at least three frames count.

    Returns
    -------
    float or None
        Stiffness, N/mm; None for a single frame.
    """
    count = max(int((d <= over * (1 + ROUNDING)).sum()), CRITERIA.stiffness_frames)
    if len(d) < 2:
        return None
    return float(np.polyfit(d[:count], load[:count], 1)[0])


def secant_stiffness(d: Array, load: Array, reference: float) -> float | None:
    """Return the slope of the curve between two shares of a reference load (`CurveCriteria`).

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    reference : float
        Deflection, mm, whose load is the reference load.

    Returns
    -------
    float or None
        Secant stiffness, N/mm; None where the load does not rise.
    """
    reference_load = float(np.interp(reference, d, load))
    rising = np.maximum.accumulate(load)
    shares = CRITERIA.secant_from, CRITERIA.secant_to
    low, high = (float(np.interp(share * reference_load, rising, d)) for share in shares)
    if not (reference_load > 0 and high > low):
        return None
    return (CRITERIA.secant_to - CRITERIA.secant_from) * reference_load / (high - low)


def knee_point(
    d: Array,
    load: Array,
    stiffness: float | None,
    over: float,
) -> CurvePoint | None:
    """Return the knee of a curve: the first point where its slope is half of a stiffness.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    stiffness : float or None
        Stiffness that the slope is compared with, N/mm.
    over : float
        Length of deflection over which a slope is taken, mm.

    Returns
    -------
    CurvePoint or None
        None where the slope does not fall so far, without a positive stiffness, or where the curve
        is shorter than twice `over`.
    """
    half = 0.5 * over
    if stiffness is None or not stiffness > 0 or d[-1] < 2 * over:
        return None
    count = round(CRITERIA.knee_positions * (d[-1] / over - 1)) + 1
    positions = np.linspace(half, d[-1] - half, max(2, count))
    slope = (np.interp(positions + half, d, load) - np.interp(positions - half, d, load)) / over
    knee_slope = CRITERIA.knee_slope * stiffness
    softer = np.flatnonzero(slope <= knee_slope)
    if not len(softer):
        return None
    i = int(softer[0])
    deflection = float(positions[i])
    if i:
        share = (slope[i - 1] - knee_slope) / (slope[i - 1] - slope[i])
        deflection = float(positions[i - 1] + share * (positions[i] - positions[i - 1]))
    return CurvePoint(deflection, float(np.interp(deflection, d, load)))


def limit_point(d: Array, load: Array) -> CurvePoint | None:
    """Return the limit point: that of the largest load if the load falls after it, else None.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    """
    top = int(np.argmax(load))
    if not load[top:].min() < (1 - CRITERIA.limit_fall) * load[top]:
        return None
    return CurvePoint(float(d[top]), float(load[top]))


def loads_at(d: Array, load: Array, places: Mapping[str, float]) -> dict[str, float | None]:
    """Return the load (N) at named deflections; None at those not reached.

    Parameters
    ----------
    d : (n,) array, mm
        Deflections of the curve, from the unloaded tube.
    load : (n,) array, N
    places : mapping of str to float, mm
        The deflections by name.
    """
    end = d[-1] * (1 + ROUNDING)
    return {
        name: float(np.interp(place, d, load)) if place <= end else None
        for name, place in places.items()
    }


def straightness(d: Array, load: Array, knee_load: float) -> tuple[float, float] | None:
    """Return how straight a curve is up to half of the load at its knee.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    knee_load : float
        Load at the knee, or the largest load, N.

    Returns
    -------
    r_squared, largest_deviation : float
        R^2 of a straight line through the frames up to that load, and their largest deviation from
        it over their last load. None is returned for fewer than four frames.
    """
    higher_frames = np.flatnonzero(load > CRITERIA.straight_share * knee_load)
    count = int(higher_frames[0]) if len(higher_frames) else len(d)
    if count < CRITERIA.stiffness_frames + 1:
        return None
    x = d[:count]
    y = load[:count]
    deviation = y - np.polyval(np.polyfit(x, y, 1), x)
    total = float(((y - y.mean()) ** 2).sum())
    if not total > 0:
        return None
    r_squared = 1.0 - float((deviation**2).sum()) / total
    return r_squared, float(np.abs(deviation).max() / y[-1])


@dataclass(frozen=True)
class MeasuredComparison:
    """Properties of a predicted curve beside the mean of those of the measured repetitions.

    Parameters
    ----------
    reference : float
        Deflection, mm, whose load is the reference load of the secant stiffness.
    pairs : mapping of str to (float, float) or None
        Predicted and measured value of the secant stiffness (N/mm), and of the loads (N) at the
        secant knee (where the slope is half of that stiffness), at the limit point, and at each
        place ("load at PLACE"). None where any of the curves has no such value.
    """

    reference: float
    pairs: Mapping[str, tuple[float, float] | None]

    @property
    def ratios(self) -> Mapping[str, float | None]:
        """Return predicted over measured value of each property."""
        return {name: pair and pair[0] / pair[1] for name, pair in self.pairs.items()}


def against_measured(
    reading: CurveReading,
    d: Array,
    load: Array,
    measured: Sequence[BendingCurve],
) -> MeasuredComparison | None:
    """Compare a predicted curve with measured repetitions, property by property.

    Parameters
    ----------
    reading : CurveReading
        Deflections at which loads are compared, and the length over which slopes are taken.
    d, load : (frames,) arrays
        Predicted deflection in mm and load in N.
    measured : sequence of BendingCurve
        Measured repetitions; without any, None is returned.
    """
    if not measured:
        return None
    curves = [(d, load), *((c.deflection, c.load) for c in measured)]
    reached = min(float(x[-1]) for x, _ in curves)
    labelled = {f"load at {name}": place for name, place in reading.places.items()}
    places = {n: place for n, place in labelled.items() if place <= reached * (1 + ROUNDING)}
    reference = max(places.values(), default=reached)
    predicted, *repetitions = (
        _compared_values(x, y, reference, reading.slope_over) | loads_at(x, y, places)
        for x, y in curves
    )
    pairs: dict[str, tuple[float, float] | None] = dict.fromkeys([*CURVE_PROPERTIES, *labelled])
    for name, value in predicted.items():
        pairs[name] = _predicted_and_mean(value, [values[name] for values in repetitions])
    return MeasuredComparison(reference, pairs)


def _predicted_and_mean(
    predicted: float | None, measured: Sequence[float | None]
) -> tuple[float, float] | None:
    """Return a predicted value and the mean of the measured ones; None where one is missing."""
    readings = [value for value in measured if value is not None]
    if predicted is None or len(readings) < len(measured):
        return None
    return predicted, float(np.mean(readings))


def _compared_values(
    d: Array,
    load: Array,
    reference: float,
    slope_over: float,
) -> dict[str, float | None]:
    """Return the values of `CURVE_PROPERTIES` of one curve, by name.

    Parameters
    ----------
    d, load : (n,) array
        Deflections (mm) and loads (N) of the curve.
    reference : float, mm
        Deflection to which the secant stiffness is taken.
    slope_over : float, mm
        Range of deflections over which slopes are taken.
    """
    stiffness = secant_stiffness(d, load, reference)
    knee = knee_point(d, load, stiffness, slope_over)
    limit = limit_point(d, load)
    values = stiffness, knee and knee.load, limit and limit.load
    return dict(zip(CURVE_PROPERTIES, values, strict=True))
