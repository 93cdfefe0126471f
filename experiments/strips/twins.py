"""Doubts about specimens beside their twins: copies, and specimens unlike those of a direction."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...readers.curves import LoadCurve
from ...solvers.base import Array
from ..doubts import Doubt
from .data import Strip


@dataclass(frozen=True)
class TwinLimits:
    """Limits of differences between specimens, as shares of the largest load of a direction."""

    copy: float = 3e-4  # largest RMS deviation from the median, below which specimens are copies
    odd: float = 0.1  # RMS deviation from the median of all, above which a specimen is odd ...
    times: float = 4.0  # ... if it is as many times the deviation that its twins have
    pair: float = 0.3  # RMS difference of two specimens without a third
    exchanged: float = 0.6  # deviation from another direction over that from its twins


LIMITS = TwinLimits()
#: Strains at which specimens are compared, as shares of that which all of them reach.
PLACES = np.linspace(0.2, 0.98, 40)


def doubts_of_specimens(strips: Mapping[str, Strip]) -> list[Doubt]:
    """Return the doubts about specimens that are alike to the digit, or unlike their twins."""
    doubts = list(_copies([(d, curve) for d, strip in strips.items() for curve in strip.curves]))
    for direction, strip in strips.items():
        if len(strip.curves) > 1:
            doubts += _odd_specimens(direction, strips)
    return doubts


def _copies(curves: Sequence[tuple[str, LoadCurve]]) -> Iterator[Doubt]:
    """Yield the doubt that two specimens hold the same readings."""
    for (direction, first), (other_direction, second) in combinations(curves, 2):
        is_copy = np.array_equal(first.load, second.load)
        if is_copy and np.array_equal(first.elongation, second.elongation):
            text = (
                f"{_name(direction, first)} and {_name(other_direction, second)} hold the same "
                "readings to the last digit: one curve is given twice, and would count as two "
                "specimens without scatter"
            )
            yield Doubt("repeated-specimen", True, text)
            return


def _name(direction: str, curve: LoadCurve) -> str:
    """Return how a curve is called: direction, specimen and file."""
    file = "" if curve.path is None else f" ({curve.path.name})"
    return f"{direction}, {curve.specimen}{file}"


def _odd_specimens(direction: str, strips: Mapping[str, Strip]) -> Iterator[Doubt]:
    """Yield the doubts about specimens of a direction that are unlike their twins, or too alike."""
    strip = strips[direction]
    end = min(float(curve.elongation.max()) for curve in strip.curves) / strip.gauge_length
    loads = _loads_at(strip, end)
    largest = float(np.abs(loads).max())
    if not end > 0 or not largest > 0:
        return
    deviations = np.array([_rms(load - np.median(loads, axis=0)) / largest for load in loads])
    if 0 < deviations.max() < LIMITS.copy:
        text = (
            f"the {len(loads)} specimens of the {direction} differ by {deviations.max():.2%} of "
            "the largest load, and specimens of a fabric by some per cent: is it one curve saved "
            "several times?"
        )
        yield Doubt("repeated-specimen", False, text)
    if len(loads) == 2:
        yield from _odd_pair(direction, strip, _rms(loads[0] - loads[1]) / largest)
        return
    for k in np.flatnonzero(deviations > LIMITS.odd):
        usual = float(np.median(np.delete(deviations, k)))
        if deviations[k] > LIMITS.times * usual:
            name = _name(direction, strip.curves[k])
            distance = deviations[k] * largest
            likeness = _like_other_direction(direction, strips, loads[k], end, distance)
            text = (
                f"{name}: its loads differ by {deviations[k]:.0%} (RMS, of the largest load) from "
                f"those of its {len(loads) - 1} twins, which differ by {usual:.1%}: {likeness}"
                "look at its curve, and leave the file out if it slipped or is mislabelled"
            )
            yield Doubt("odd-specimen", False, text)


def _odd_pair(direction: str, strip: Strip, difference: float) -> Iterator[Doubt]:
    """Yield the doubt about two specimens, without a third, of which nobody knows which is odd."""
    first, second = (_name(direction, curve) for curve in strip.curves)
    if difference > LIMITS.pair:
        text = (
            f"{first} and {second} differ by {difference:.0%} (RMS, of the largest load): one of "
            "them slipped, is mislabelled or has other columns; look at both curves"
        )
        yield Doubt("odd-specimen", False, text)


def _like_other_direction(
    direction: str,
    strips: Mapping[str, Strip],
    load: Array,
    end: float,
    distance: float,
) -> str:
    """Return words that name the direction whose specimens have about this load; "" for none.

    Parameters
    ----------
    load : (places,) array, N
        Loads of the specimen at `PLACES`.
    end : float
        Strain of the gauge that all specimens reach.
    distance : float, N
        RMS deviation of the load from its twins.
    """
    for name, strip in strips.items():
        if name == direction or not strip.curves:
            continue
        if _rms(load - np.median(_loads_at(strip, end), axis=0)) < LIMITS.exchanged * distance:
            return f"it is like those of the {name}, so that labels may be exchanged; "
    return ""


def _loads_at(strip: Strip, end: float) -> Array:
    """Return the loads (specimens, places), N, at shares of a strain `end` of the gauge."""
    strains = end * PLACES
    return np.array(
        [
            np.interp(strains, curve.elongation / strip.gauge_length, curve.load)
            for curve in strip.curves
        ]
    )


def _rms(values: Array) -> float:
    """Return the root of the mean square of values (n,)."""
    return float(np.sqrt(np.mean(values**2)))
