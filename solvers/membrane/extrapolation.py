"""Starts for the next level from the levels before it."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def monotonic_count(levels: Sequence[float], level: float, limit: int) -> int:
    """Return how many of the last levels lie one after the other on the way to the next one."""
    steps = np.sign(np.diff([*levels, level]))[::-1]
    reversals = np.flatnonzero(steps != steps[0])
    return min(limit, int(reversals[0]) if len(reversals) else len(steps))


def straight_on(levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
    """Return the point on the line through the last two of the path; else its last one."""
    if len(path) < 2:
        return path[-1]
    ratio = (level - levels[-1]) / (levels[-1] - levels[-2])
    return np.asarray(path[-1] + ratio * (path[-1] - path[-2]))


def lagrange(x: Array, values: Array, position: float) -> Array:
    """Return the polynomial through `values` (k, nodes, 3) at x (k,), at another position."""
    weights = [
        math.prod((position - x[b]) / (x[a] - x[b]) for b in range(len(x)) if b != a)
        for a in range(len(x))
    ]
    return np.asarray(np.einsum("a,ank->nk", weights, values))
