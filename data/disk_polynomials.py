"""Smooth functions over a disk, through scattered values: polynomials of a total degree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]

#: Points a coefficient needs at least.
LEAST_POINTS = 2


@dataclass(frozen=True, eq=False)
class DiskPolynomial:
    """A polynomial of x and y, of several values at once.

    Parameters
    ----------
    radius : mm, of the disk; degree : in x and y together.
    coefficients : (terms, values) of products of Legendre polynomials.
    rms : (values,) of the values less the polynomial, at the points it was fitted to.
    """

    radius: float
    degree: int
    coefficients: Array
    rms: Array

    def at(self, points: Array) -> Array:
        """Values (n, values) at points (n, 2) mm."""
        return np.asarray(_terms(points / self.radius, self.degree) @ self.coefficients)


def fit_disk_polynomial(points: Array, values: Array, radius: float, degree: int) -> DiskPolynomial:
    """Least squares.

    Parameters
    ----------
    points : (n, 2) mm. values : (n, k).
    radius : mm, of the disk. degree : in x and y together.

    Raises
    ------
    InputError : too few points for the degree, or points that leave it undetermined.
    """
    terms = _terms(points / radius, degree)
    count = terms.shape[1]
    if len(points) < LEAST_POINTS * count:
        problem = f"{len(points)} points are too few for degree {degree}"
        raise InputError(None, "degree", f"{problem}: expected {LEAST_POINTS * count} or more")
    solution = np.linalg.lstsq(terms, values, rcond=1e-10)
    coefficients, rank = np.asarray(solution[0], dtype=np.float64), int(solution[2])
    if rank < count:
        problem = f"the points do not determine a polynomial of degree {degree}; take a lower one"
        raise InputError(None, "degree", problem)
    left = values - terms @ coefficients
    rms = np.sqrt(np.mean(left**2, axis=0))
    return DiskPolynomial(radius, degree, coefficients, rms)


def _terms(places: Array, degree: int) -> Array:
    """(n, terms) at places (n, 2) in radii."""
    x, y = (legendre.legvander(places[:, axis], degree) for axis in (0, 1))
    return np.column_stack([x[:, a] * y[:, d - a] for d in range(degree + 1) for a in range(d + 1)])
