"""Increments of a membrane's analysis: their records, and extrapolation to the next load."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .membrane import Membrane


class IncrementRecord:
    """Record of a membrane's increments.

    Attributes
    ----------
    path : (increments, nodes, 3) ndarray, mm
        Displacements.
    forces : (increments, nodes, 3) ndarray, N
        Residuals, which are the reactions at unknowns that are held.
    low, high : (3,) ndarray
        Extremes of the log strains eps1, eps2, gamma12 so far, zero included.
    """

    def __init__(self, membrane: Membrane, count: int) -> None:
        self.membrane = membrane
        self.path = np.zeros((count, *membrane.reference.shape))
        self.forces = np.zeros((count, *membrane.reference.shape))
        self.low = np.zeros(3)
        self.high = np.zeros(3)

    def accept(self, i: int, u: NDArray[np.float64]) -> None:
        """Accept the equilibrium u (n, 3) mm as the end of increment i, and record it."""
        self.membrane.accept()
        self.path[i] = u
        self.forces[i] = self.membrane.residual.reshape(u.shape)
        strain = self.membrane.strain_old[..., :3]
        np.minimum(self.low, strain.min(axis=(0, 1)), out=self.low)
        np.maximum(self.high, strain.max(axis=(0, 1)), out=self.high)


def load_labels(levels: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Return loads in words, each as its number and the unit.

    Parameters
    ----------
    levels : (n,) array
        Loads in this unit.
    """
    return tuple(f"{level:.4g} {unit}" for level in levels.tolist())


Array = NDArray[np.float64]


def monotonic_count(levels: Sequence[float], level: float, limit: int) -> int:
    """Return how many of the last levels form a monotonic sequence with the next one.

    Parameters
    ----------
    levels, level
        The loads so far, and the next one.
    limit : int
        The largest count to return.
    """
    steps = np.sign(np.diff([*levels, level]))[::-1]
    reversals = np.flatnonzero(steps != steps[0])
    return min(limit, int(reversals[0]) if len(reversals) else len(steps))


def straight_on(levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
    """Return the linear extrapolation to `level` of the last two displacements of a path.

    Parameters
    ----------
    levels, path
        Loads, and the displacements (n, 3) there; a path of one is not extrapolated.
    """
    if len(path) < 2:
        return path[-1]
    ratio = (level - levels[-1]) / (levels[-1] - levels[-2])
    return path[-1] + ratio * (path[-1] - path[-2])


def lagrange(x: Array, values: Array, position: float) -> Array:
    """Return the value (nodes, 3) at `position` of the polynomial through k values.

    Parameters
    ----------
    x, values : array
        The positions (k,) and the values there, (k, nodes, 3).
    """
    weights = [
        math.prod((position - x[b]) / (x[a] - x[b]) for b in range(len(x)) if b != a)
        for a in range(len(x))
    ]
    return np.einsum("a,ank->nk", weights, values)
