"""The apex of a bubble: the shape about its centre, its strain, and its equilibrium."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...readers.fields import DisplacementField
from ...readers.frames import Frame
from ...solvers.base import Array

#: Powers (of x, of y) of the polynomial about the centre, up to a total of four.
POWERS = tuple((i, j) for i in range(5) for j in range(5 - i))


@dataclass(frozen=True, eq=False)
class ApexShape:
    """A polynomial of x and y, in radii, about the centre.

    Attributes
    ----------
    radius : float, mm
    is_fitted : (points,) array of bool
        Which of the given points it was fitted to.
    terms : (n, 15) array
        Powers of the coordinates at those points.
    coefficients : (15, values) array
    """

    radius: float
    is_fitted: NDArray[np.bool_]
    terms: Array
    coefficients: Array

    def at_centre(self, i: int = 0, j: int = 0) -> Array:
        """Return (values,) differentiated i times by x and j times by y (mm), at the centre."""
        factor = factorial(i) * factorial(j)
        coefficient = self.coefficients[POWERS.index((i, j))]
        return np.asarray(factor * coefficient / self.radius ** (i + j))


def apex_shape(
    points: Array, values: Array, radius: float, *, fitted_share: float = 0.5
) -> ApexShape:
    """Fit a polynomial near the rim's centre.

    Parameters
    ----------
    points : (n, 2) array, mm
    values : (n, k) array
        Those that are not finite do not count.
    radius : float, mm
    fitted_share : float
        Points within this share of the radius count.

    Raises
    ------
    InputError
        There are too few points about the centre.
    """
    x = points / radius
    is_central = np.hypot(*x.T) < fitted_share
    is_fitted = np.isfinite(values).all(axis=1) & is_central
    min_points = 2 * len(POWERS)
    if is_fitted.sum() < min_points:
        problem = f"expected {min_points} points about the centre, got {int(is_fitted.sum())}"
        raise InputError(None, "", problem)
    u = x[is_fitted, 0]
    v = x[is_fitted, 1]
    terms = np.stack([u**i * v**j for i, j in POWERS], axis=1)
    coefficients, *_ = np.linalg.lstsq(terms, values[is_fitted], rcond=None)
    return ApexShape(radius, is_fitted, terms, coefficients)


def centre_strain(frame: Frame, radius: float) -> Array:
    """Return the Green-Lagrange strain (2, 2) of the surface at the centre; raises InputError."""
    try:
        shape = apex_shape(frame.points[:, :2], frame.displacement, radius)
    except InputError as error:
        raise InputError(None, "warp", error.problem) from None
    gradient = np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    tangents = np.eye(3)[:2] + gradient
    return np.asarray(0.5 * (tangents @ tangents.T - np.eye(2)))


@dataclass(frozen=True)
class Apex:
    """Equilibrium at the apex of one field without any model: n1 k1 + n2 k2 = p from its shape.

    Attributes
    ----------
    pressure : float, MPa
    height : float, mm
        Rise of the centre.
    curvature : float, 1/mm
        k1 + k2 of the inflated surface; positive where it is a dome.
    force : float, N/mm
        p / (k1 + k2), that of all directions if they are equal; infinite where there is no dome.
    error : float, N/mm
        Of the force by the points' scatter.
    strain : (float, float)
        Logarithmic, along x and y.
    """

    pressure: float
    height: float
    curvature: float
    force: float
    error: float
    strain: tuple[float, float]

    @property
    def stiffness(self) -> float:
        """Return force over mean strain, N/mm; infinite where nothing is strained."""
        mean = 0.5 * (self.strain[0] + self.strain[1])
        return self.force / mean if mean > 0 else float("inf")


def apex_of(field: DisplacementField, radius: float) -> Apex:
    """Return the apex of a field about the centre of a rim of `radius` mm.

    Raises
    ------
    InputError
        There are too few points about the centre.
    """
    reference = field.frame.points
    deformed = reference + field.displacement
    shape = apex_shape(field.points, np.hstack([deformed, reference]), radius)
    tangents = np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    metric = tangents[:, :3] @ tangents[:, :3].T
    reference_metric = tangents[:, 3:] @ tangents[:, 3:].T
    normal = np.cross(tangents[0, :3], tangents[1, :3])
    normal /= np.linalg.norm(normal)
    xx = shape.at_centre(2, 0)[:3] @ normal
    xy = shape.at_centre(1, 1)[:3] @ normal
    yy = shape.at_centre(0, 2)[:3] @ normal
    second_form = np.array([[xx, xy], [xy, yy]])
    curvature = -float(np.trace(np.linalg.solve(metric, second_form)))
    log_stretch = np.log(np.sqrt(np.diag(metric) / np.diag(reference_metric)))
    force = error = float("inf")
    if curvature > 0:
        force = field.pressure / curvature
        error = force * _curvature_error(shape, deformed[shape.is_fitted, 2]) / curvature
    centre = shape.at_centre()
    return Apex(
        pressure=field.pressure,
        height=float(centre[2] - centre[5]),
        curvature=curvature,
        force=force,
        error=error,
        strain=(float(log_stretch[0]), float(log_stretch[1])),
    )


def _curvature_error(shape: ApexShape, heights: Array) -> float:
    """Return the standard error (1/mm) of the curvature by the scatter of heights (n,) mm."""
    residual = heights - shape.terms @ shape.coefficients[:, 2]
    variance = float(residual @ residual) / (len(residual) - len(POWERS))
    inverse = np.linalg.pinv(shape.terms.T @ shape.terms)
    squares = [POWERS.index((2, 0)), POWERS.index((0, 2))]
    spread = np.sqrt(variance * inverse[np.ix_(squares, squares)].sum())
    return float(spread) * 2 / shape.radius**2
