"""A smooth surface about the centre of a sheet: what its values and slopes are there."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]

#: Points within this share of the radius tell the shape about the centre.
WITHIN = 0.5
#: Powers of the polynomial, each up to a total of four.
POWERS = tuple((i, j) for i in range(5) for j in range(5 - i))


@dataclass(frozen=True, eq=False)
class ApexShape:
    """A polynomial of x and y about the centre, of several values at once.

    Parameters
    ----------
    radius : mm, in which places are counted. near : (points,) which of those given it goes through.
    terms : (near, 15) powers at those points. coefficients : (15, values).
    """

    radius: float
    near: NDArray[np.bool_]
    terms: Array
    coefficients: Array

    def at_centre(self, i: int = 0, j: int = 0) -> Array:
        """(values,) or their derivative, i times by x and j times by y (mm), at the centre."""
        factor = factorial(i) * factorial(j)
        solution = self.coefficients[POWERS.index((i, j))]
        return np.asarray(factor * solution / self.radius ** (i + j))


def apex_shape(points: Array, values: Array, radius: float) -> ApexShape:
    """Least squares through the values near the centre that are finite.

    Parameters
    ----------
    points : (n, 2) mm about the centre. values : (n, k). radius : of the rim, mm.

    Raises
    ------
    InputError : too few points about the centre.
    """
    x = points / radius
    near = np.isfinite(values).all(axis=1) & (np.hypot(*x.T) < WITHIN)
    if near.sum() < 2 * len(POWERS):
        problem = f"expected {2 * len(POWERS)} points about the centre, got {int(near.sum())}"
        raise InputError(None, "", problem)
    terms = np.stack([x[near, 0] ** i * x[near, 1] ** j for i, j in POWERS], axis=1)
    solution, *_ = np.linalg.lstsq(terms, values[near], rcond=None)
    return ApexShape(radius, near, terms, solution)
