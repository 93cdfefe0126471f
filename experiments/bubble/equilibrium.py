"""Equilibrium at the apex without any model: n1 k1 + n2 k2 = p from the measured shape alone."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...readers.fields import DisplacementField

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


@dataclass(frozen=True)
class Apex:
    """What the shape says at the centre of one field.

    Parameters
    ----------
    pressure : MPa. height : mm, rise of the centre.
    curvature : 1/mm, k1 + k2 of the inflated surface; positive where it is a dome.
    force : N/mm, the membrane force p / (k1 + k2), the same in all directions if the two are equal.
    error : N/mm, standard error of the force from the scatter of the points about a smooth surface.
    strain : logarithmic, along x and along y.
    """

    pressure: float
    height: float
    curvature: float
    force: float
    error: float
    strain: tuple[float, float]

    @property
    def stiffness(self) -> float:
        """Force over the mean of the two strains, N/mm; infinite where nothing is strained."""
        mean = 0.5 * (self.strain[0] + self.strain[1])
        return self.force / mean if mean > 0 else float("inf")


def apex_of(field: DisplacementField, radius: float) -> Apex:
    """The apex of a field about the rim's centre; radius of the rim in mm.

    Raises
    ------
    InputError : too few points about the centre.
    """
    before = field.frame.points
    after = before + field.displacement
    try:
        shape = apex_shape(field.points, np.hstack([after, before]), radius)
    except InputError as error:
        raise InputError(field.path, error.field, error.problem) from None
    left = after[shape.near, 2] - shape.terms @ shape.coefficients[:, 2]
    tangents = np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    metric = tangents[:, :3] @ tangents[:, :3].T
    first = tangents[:, 3:] @ tangents[:, 3:].T
    normal = np.cross(tangents[0, :3], tangents[1, :3])
    normal /= np.linalg.norm(normal)
    second = np.array(
        [
            [shape.at_centre(2, 0)[:3] @ normal, shape.at_centre(1, 1)[:3] @ normal],
            [shape.at_centre(1, 1)[:3] @ normal, shape.at_centre(0, 2)[:3] @ normal],
        ]
    )
    curvature = -float(np.trace(np.linalg.solve(metric, second)))
    variance = float(left @ left) / (len(left) - len(POWERS))
    inverse = np.linalg.pinv(shape.terms.T @ shape.terms)
    both = [POWERS.index((2, 0)), POWERS.index((0, 2))]
    spread = float(np.sqrt(variance * inverse[np.ix_(both, both)].sum())) * 2 / radius**2
    stretch = np.sqrt(np.diag(metric) / np.diag(first))
    strain = float(np.log(stretch[0])), float(np.log(stretch[1]))
    centre = shape.at_centre()
    height = float(centre[2] - centre[5])
    force = doubt = float("inf")
    if curvature > 0:
        force = field.pressure / curvature
        doubt = force * spread / curvature
    return Apex(field.pressure, height, curvature, force, doubt, strain)
