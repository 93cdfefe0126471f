"""The tangent modulus of one increment at one integration point, compiled: both forms of the law.

`limits` says which form it is. Polynomials: (3,), the ends of the strain range (eps1, eps2,
gamma12). Tri-linear: (9,), the same and then the two breaks of eps1, of eps2 and of gamma12;
breaks at or beyond an end are never reached (`law.UNLIMITED`), so that the ends say nothing more.

A component is 0 (E1 of eps1), 1 (E2 of eps2) or 2 (G12 of gamma12, even in it); the four
coefficients of its modulus begin at beta[8 - 4 component].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..caching import compiled

Array = NDArray[np.float64]

#: An increment of strain so small that only rounding tells its modulus from that at a point.
TINY = 1e-12


@compiled()
def _held(end: float, component: int, x: float) -> tuple[float, bool]:
    """x (its size, for shear) held to [0, end], and whether that changed it."""
    size = abs(x) if component == 2 else x
    held = min(max(size, 0.0), end)
    return held, held != size


@compiled()
def _cubic(beta: Array, end: float, component: int, x: float) -> tuple[float, float]:
    """Modulus at the strain x, and half its slope there."""
    first = 8 - 4 * component
    held, changed = _held(end, component, x)
    value = ((beta[first] * held + beta[first + 1]) * held + beta[first + 2]) * held
    value += beta[first + 3]
    if changed:
        return value, 0.0
    slope = (3.0 * beta[first] * held + 2.0 * beta[first + 1]) * held + beta[first + 2]
    return value, -0.5 * slope if component == 2 and x < 0.0 else 0.5 * slope


@compiled()
def _way_below(at: float, component: int, x: float, x_old: float) -> float:
    """Part of the way from x_old to x that is below a break (for shear: in size)."""
    if component == 2:
        return (min(max(x, -at), at) - min(max(x_old, -at), at)) / (x - x_old)
    return (min(x, at) - min(x_old, at)) / (x - x_old)


@compiled()
def _shares(limits: Array, component: int, x: float, x_old: float) -> tuple[float, float, float]:
    """Parts of the way from x_old to x below, between and beyond the breaks; their sum is 1."""
    a, b = limits[3 + 2 * component], limits[4 + 2 * component]
    if abs(x - x_old) < TINY:
        middle = 0.5 * (x + x_old)
        size = abs(middle) if component == 2 else middle
        if size <= a:
            return 1.0, 0.0, 0.0
        return (0.0, 1.0, 0.0) if size <= b else (0.0, 0.0, 1.0)
    below = _way_below(a, component, x, x_old)
    within = _way_below(b, component, x, x_old)
    return below, within - below, 1.0 - within


@compiled()
def _mean(beta: Array, limits: Array, component: int, x: float, x_old: float) -> float:
    first = 8 - 4 * component
    below, between, beyond = _shares(limits, component, x, x_old)
    return below * beta[first + 3] + between * beta[first + 2] + beyond * beta[first + 1]


@compiled()
def increment_modulus(
    beta: Array, limits: Array, component: int, x: float, x_old: float
) -> tuple[float, float, float]:
    """Modulus for the increment from x_old to x, and its derivatives by x and by x_old.

    A polynomial is taken at the midpoint. A modulus that jumps there would make the stress
    jump with the strain, and Newton's iteration stall: a tri-linear one is the mean over the
    increment, (F(x) - F(x_old))/(x - x_old) with F its integral, which is continuous in x and
    gives the exact stress of a bar in any number of increments.
    """
    if len(limits) == 3:
        value, half = _cubic(beta, limits[component], component, 0.5 * (x + x_old))
        return value, half, half
    mean = _mean(beta, limits, component, x, x_old)
    change = x - x_old
    if abs(change) < TINY:
        return mean, 0.0, 0.0
    ahead = (_mean(beta, limits, component, x, x) - mean) / change
    behind = (mean - _mean(beta, limits, component, x_old, x_old)) / change
    return mean, ahead, behind


@compiled()
def by_coefficients(limits: Array, h: Array, h_old: Array, row: Array) -> None:
    """Write row (12,): derivative of the increment's moduli by each of their own coefficients."""
    for component in range(3):
        first = 8 - 4 * component
        if len(limits) == 3:
            middle = 0.5 * (h[component] + h_old[component])
            x, _ = _held(limits[component], component, middle)
            row[first], row[first + 1], row[first + 2], row[first + 3] = x * (x * x), x * x, x, 1.0
        else:
            below, between, beyond = _shares(limits, component, h[component], h_old[component])
            row[first], row[first + 1] = 0.0, beyond
            row[first + 2], row[first + 3] = between, below
