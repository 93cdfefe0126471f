"""Extrapolation of displacements to the next load, to start the search for its equilibrium."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def monotonic_count(levels: Sequence[float], level: float, limit: int) -> int:
    """Return how many of the last levels form a monotonic sequence with the next one.

    levels, level : the loads so far, and the next one. limit : the largest count to return.
    """
    steps = np.sign(np.diff([*levels, level]))[::-1]
    reversals = np.flatnonzero(steps != steps[0])
    return min(limit, int(reversals[0]) if len(reversals) else len(steps))


def straight_on(levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
    """Return the linear extrapolation to `level` of the last two displacements of a path.

    levels, path : loads, and the displacements (n, 3) there; a path of one is not extrapolated.
    """
    if len(path) < 2:
        return path[-1]
    ratio = (level - levels[-1]) / (levels[-1] - levels[-2])
    return np.asarray(path[-1] + ratio * (path[-1] - path[-2]))


def lagrange(x: Array, values: Array, position: float) -> Array:
    """Return the value (nodes, 3) at `position` of the polynomial through k values.

    x, values : the positions (k,) and the values there, (k, nodes, 3).
    """
    weights = [
        math.prod((position - x[b]) / (x[a] - x[b]) for b in range(len(x)) if b != a)
        for a in range(len(x))
    ]
    return np.asarray(np.einsum("a,ank->nk", weights, values))
