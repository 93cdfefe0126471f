"""Doubts about load curves of strips: wrong units, preload, failure, swapped directions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

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
    moduli: dict[str, list[float]] = {}
    for direction, strip in strips.items():
        for name, elongation, load in curves_of(strip):
            what = f"{direction}, {name}" if name else direction
            found += _of_curve(what, strip, elongation, load)
            if direction not in ALONG or not expected.moduli:
                continue
            modulus = _modulus(strip, elongation, load, width * thickness)
            moduli.setdefault(direction, []).append(modulus)
            if far := expected.outside(modulus, [ALONG[direction]]):
                text = (
                    f"{what}: load over strain is a modulus of about {far}: are load and "
                    "elongation in the units that are said, and are width and thickness right?"
                )
                found.append(Doubt("load-unit", True, text))
    if set(ALONG) <= set(strips) and expected.moduli and expected.warp_is_stiffer:
        warp, fill = (float(np.median(moduli.get(d) or np.nan)) for d in ALONG)
        if fill > STIFFER * warp:
            text = (
                f"the fill's modulus is about {fill:.3g} MPa, the warp's {warp:.3g} MPa, and the "
                "bounds have the warp stiffer: warp and fill seem to be swapped"
            )
            found.append(Doubt("swapped", False, text))
    return found


def curves_of(strip: Strip) -> list[tuple[str, Array, Array]]:
    """Return name, elongation and load of every specimen, else of the polynomial."""
    if strip.curves:
        return [(curve.specimen, curve.elongation, curve.load) for curve in strip.curves]
    if strip.polynomial is None:
        return []
    elongation = np.linspace(0.0, strip.elongation, 50)
    return [("", elongation, strip.polynomial(elongation))]


def _of_curve(what: str, strip: Strip, elongation: Array, load: Array) -> Iterator[Doubt]:
    """Yield doubts about one curve: units of elongation, a preload, rows after failure."""
    strain = elongation[-1] / strip.gauge_length
    if not LEAST_END < strain < MOST_END:
        text = (
            f"{what}: the curve ends at an elongation of {strain:.3g} gauge lengths: is it a length"
            " in the unit that is said (not percent, not a strain), and is the gauge length right?"
        )
        yield Doubt("elongation-unit", True, text)
    largest, end = float(load.max()), float(elongation.max())
    # A curve may begin where the strip is elongated already.
    first = load[np.abs(elongation) <= BEGINNING * end]
    level = float(np.median(first)) / largest if first.size and largest > 0 else 0.0
    if abs(level) >= PRELOAD:
        text = (
            f"{what}: the load is {level * largest:.3g} N ({level:.0%} of the largest) where the "
            "curve begins: a preload, or a zero that was not set; begin the elongation where the "
            "load does"
        )
        yield Doubt("preload", False, text)
    largest, end = 0.0, strip.elongation
    for u, f in zip(elongation, load, strict=True):
        if u > end * (1 + 1e-9):
            break
        largest = max(largest, float(f))
        if f < FAILED * largest and u > SLOPE_AT * end:
            text = (
                f"{what}: the load falls from {largest:.3g} to {f:.3g} N at an elongation of "
                f"{u:.3g} mm: rows after failure; cut them off, or say a shorter final_length"
            )
            yield Doubt("after-failure", True, text)
            break


def _modulus(strip: Strip, elongation: Array, load: Array, area: float) -> float:
    """Return secant modulus (MPa) at half of the end strain."""
    strain = np.log1p(np.clip(elongation / strip.gauge_length, -0.9, None))
    at = SLOPE_AT * float(strain.max())
    near = np.argsort(np.abs(strain - at))[:5]
    value = np.median(load[near] / np.where(strain[near] > 0, strain[near], np.nan))
    return float(value) / area if np.isfinite(value) else float("nan")
