"""What the four published bars would carry if a program read the law otherwise.

Usage: bench_bars.py. End stresses in MPa beside Marc's, for the ways of getting a hypoelastic
law wrong that docs/how-to/marc.md lists: closed forms of a bar of constant tangent moduli of its
log strain, but for the moduli at the ends of 100 increments.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bubblefit.solvers.bars import BARS, INCREMENTS, Bar
from scipy.integrate import quad

Modulus = Callable[[float], float]


def integral(modulus: Modulus, end: float, measure: Callable[[float], float]) -> float:
    """Of a modulus that is looked up by a measure of the log strain."""
    return float(quad(lambda strain: modulus(measure(strain)), 0.0, end)[0])


def at_ends(modulus: Modulus, end: float) -> float:
    """Of the modulus at the end of each increment."""
    pulled = np.log1p(np.expm1(end) * np.arange(INCREMENTS + 1) / INCREMENTS)
    return float(
        sum(modulus(e) * step for e, step in zip(pulled[1:], np.diff(pulled), strict=True))
    )


READINGS: dict[str, Callable[[Modulus, float], float]] = {
    "the law": lambda modulus, end: integral(modulus, end, lambda e: e),
    "secant, not tangent moduli": lambda modulus, end: modulus(end) * end,
    "of engineering strain": lambda modulus, end: integral(modulus, end, np.expm1),
    "of Green-Lagrange strain": lambda modulus, end: integral(
        modulus, end, lambda e: 0.5 * float(np.expm1(2 * e))
    ),
    "modulus at the end of an increment": at_ends,
    "stress is nominal": lambda modulus, end: integral(modulus, end, lambda e: e) / np.exp(end),
}


def main() -> None:
    heads = "".join(f"{f'{bar.model} {bar.direction}':>14s}" for bar in BARS)
    print(f"{'MPa':36s}{heads}")
    print(f"{'published':36s}" + "".join(f"{bar.stress:14.3f}" for bar in BARS))
    for words, reading in READINGS.items():
        stresses = [reading(modulus_of(bar), np.log1p(bar.elongation)) for bar in BARS]
        print(f"{words:36s}" + "".join(f"{stress:14.3f}" for stress in stresses))


def modulus_of(bar: Bar) -> Modulus:
    """Of the log strain, MPa."""
    return lambda strain: 1e3 * float(np.polyval(bar.modulus[::-1], strain))


if __name__ == "__main__":
    main()
