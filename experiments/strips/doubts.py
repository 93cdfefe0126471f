"""Doubts about load curves of strips: wrong units, preload, failure, swapped directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..kinds import Doubt, Expected
from .data import Strip

Array = NDArray[np.float64]

#: Strains at the end of a curve: no coated fabric ends below or above.
LEAST_END, MOST_END = 0.002, 1.5
#: Of the largest load: more than that at no elongation is a preload, or a zero that is not one.
PRELOAD = 0.05
#: Of the elongation: where a curve is taken to begin.
BEGINNING = 0.01
#: Of the largest load: a fall below while the strip is pulled further is a failure.
FAILED = 0.7
#: Of the end strain: where the modulus of a curve is taken.
SLOPE_AT = 0.5
#: The modulus along the yarns whose bounds a direction's curve can be held against.
ALONG = {"warp": "E1", "fill": "E2"}
#: How much stiffer than the warp the fill must be to be taken for it.
STIFFER = 1.15


def doubts_of_strips(
    strips: Mapping[str, Strip], width: float, thickness: float, expected: Expected
) -> Sequence[Doubt]:
    """Return the doubts about the strips of a test, by direction; widths and thickness mm."""
    found: list[Doubt] = []
    for direction, strip in strips.items():
        for name, elongation, load in curves_of(strip):
            what = f"{direction}, {name}" if name else direction
            found += _end(what, elongation[-1] / strip.gauge_length)
            found += _preload(what, elongation, load)
            found += _failure(what, elongation, load, strip.elongation)
            if direction in ALONG and expected.moduli:
                modulus = _modulus(strip, elongation, load, width * thickness)
                found += _load_unit(what, modulus, expected, ALONG[direction])
    return [*found, *_swapped(strips, width * thickness, expected)]


def curves_of(strip: Strip) -> list[tuple[str, Array, Array]]:
    """Return name, elongation and load of every specimen, else of the polynomial."""
    if strip.curves:
        return [(curve.specimen, curve.elongation, curve.load) for curve in strip.curves]
    if strip.polynomial is None:
        return []
    elongation = np.linspace(0.0, strip.elongation, 50)
    return [("", elongation, strip.polynomial(elongation))]


def _end(what: str, strain: float) -> list[Doubt]:
    """Doubt a final strain that shows percent, metres or a wrong gauge length."""
    if LEAST_END < strain < MOST_END:
        return []
    text = (
        f"{what}: the curve ends at an elongation of {strain:.3g} gauge lengths: is it a length in "
        "the unit that is said (not percent, not a strain), and is the gauge length right?"
    )
    return [Doubt("elongation-unit", True, text)]


def _preload(what: str, elongation: Array, load: Array) -> list[Doubt]:
    """Doubt a load where nothing is elongated yet."""
    largest, end = float(load.max()), float(elongation.max())
    first = load[np.abs(elongation) <= BEGINNING * end]
    if not first.size:  # the curve begins where the strip is elongated already
        return []
    level = float(np.median(first)) / largest if largest > 0 else 0.0
    if abs(level) < PRELOAD:
        return []
    text = (
        f"{what}: the load is {level * largest:.3g} N ({level:.0%} of the largest) where the curve "
        "begins: a preload, or a zero that was not set; begin the elongation where the load does"
    )
    return [Doubt("preload", False, text)]


def _failure(what: str, elongation: Array, load: Array, end: float) -> list[Doubt]:
    """Doubt rows after the strip broke, within the range that is fitted."""
    largest, row = 0.0, None
    for i, (u, f) in enumerate(zip(elongation, load, strict=True)):
        if u > end * (1 + 1e-9):
            break
        largest = max(largest, float(f))
        if f < FAILED * largest and u > SLOPE_AT * end:
            row = i
            break
    if row is None:
        return []
    text = (
        f"{what}: the load falls from {largest:.3g} to {load[row]:.3g} N at an elongation of "
        f"{elongation[row]:.3g} mm: rows after failure; cut them off, or say a shorter final_length"
    )
    return [Doubt("after-failure", True, text)]


def _modulus(strip: Strip, elongation: Array, load: Array, area: float) -> float:
    """Return secant modulus (MPa) at half of the end strain."""
    strain = np.log1p(np.clip(elongation / strip.gauge_length, -0.9, None))
    at = SLOPE_AT * float(strain.max())
    near = np.argsort(np.abs(strain - at))[:5]
    value = np.median(load[near] / np.where(strain[near] > 0, strain[near], np.nan))
    return float(value) / area if np.isfinite(value) else float("nan")


def _load_unit(what: str, modulus: float, expected: Expected, name: str) -> list[Doubt]:
    """Doubt a modulus that shows kN, N/m, or a wrong width or thickness."""
    far = expected.outside(modulus, [name])
    if not far:
        return []
    text = (
        f"{what}: load over strain is a modulus of about {far}: are load and elongation in the "
        "units that are said, and are width and thickness right?"
    )
    return [Doubt("load-unit", True, text)]


def _swapped(strips: Mapping[str, Strip], area: float, expected: Expected) -> list[Doubt]:
    """Doubt a fill that is stiffer where the bounds have the warp stiffer."""
    if not set(ALONG) <= set(strips) or not expected.moduli or not expected.warp_is_stiffer:
        return []
    moduli = {}
    for direction in ALONG:
        strip = strips[direction]
        values = [_modulus(strip, u, f, area) for _, u, f in curves_of(strip)]
        moduli[direction] = float(np.median(values)) if values else float("nan")
    warp, fill = moduli["warp"], moduli["fill"]
    if not fill > STIFFER * warp:
        return []
    text = (
        f"the fill's modulus is about {fill:.3g} MPa, the warp's {warp:.3g} MPa, and the bounds "
        "have the warp stiffer: warp and fill seem to be swapped"
    )
    return [Doubt("swapped", False, text)]
