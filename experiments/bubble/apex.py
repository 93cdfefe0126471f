"""The apex of a bubble: shape, strain and membrane equilibrium at its centre, without a model."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...light_dataclasses import dataclass
from ...readers.fields import DisplacementField
from ...readers.frames import Frame
from ...solvers.base import Array

#: Powers (i, j) of the terms x^i y^j of the polynomial about the centre, i + j up to four.
POWERS = tuple((i, j) for i in range(5) for j in range(5 - i))


@dataclass(frozen=True, eq=False)
class ApexShape:
    """A polynomial of degree four fitted to values at points about the centre.

    Attributes
    ----------
    radius : float, mm
        Radius of the rim; the polynomial's variables are x / radius and y / radius.
    is_fitted : (points,) array of bool
        Which of the given points it was fitted to.
    terms : (n, 15) array
        Values of the terms (`POWERS`) at the n fitted points.
    coefficients : (15, values) array
        A column for each fitted quantity, in its unit.
    """

    radius: float
    is_fitted: NDArray[np.bool_]
    terms: Array
    coefficients: Array

    def at_centre(self, i: int = 0, j: int = 0) -> Array:
        """Return the i-th derivative by x (mm), j-th by y, of each quantity at the centre.

        It is a (values,) array; i = j = 0 returns the values themselves.
        """
        factor = factorial(i) * factorial(j)
        coefficient = self.coefficients[POWERS.index((i, j))]
        return factor * coefficient / self.radius ** (i + j)


def apex_shape(
    points: Array,
    values: Array,
    radius: float,
    *,
    fitted_share: float = 0.5,
) -> ApexShape:
    """Fit a polynomial of degree four to values near the rim's centre by least squares.

    Parameters
    ----------
    points : (n, 2) array, mm
        Positions with the rim's centre as origin.
    values : (n, k) array
        k quantities at the points; points with one that is not finite are left out.
    radius : float, mm
        Radius of the rim.
    fitted_share : float
        Points nearer to the centre than this share of the radius are fitted.

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
    """Return the Green-Lagrange strain (2, 2) of a sheet that was flat, at the rim's centre.

    `frame` has the rim's centre as origin; `radius` of the rim in mm. Raise InputError where there
    are too few points about the centre.
    """
    try:
        shape = apex_shape(frame.points[:, :2], frame.displacement, radius)
    except InputError as error:
        raise InputError(None, "warp", error.problem) from None
    gradient = np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    tangents = np.eye(3)[:2] + gradient
    return 0.5 * (tangents @ tangents.T - np.eye(2))


@dataclass(frozen=True)
class Apex:
    """Membrane equilibrium at the apex of a measured field, without any model.

    The membrane forces n1, n2 (N/mm) and the principal curvatures k1, k2 (1/mm) of the inflated
    surface balance the pressure p: n1 k1 + n2 k2 = p.

    Attributes
    ----------
    pressure : float, MPa
    height : float, mm
        Rise (displacement along z) of the centre.
    curvature : float, 1/mm
        k1 + k2, positive where the surface is a dome.
    force : float, N/mm
        p / (k1 + k2), the membrane force if it is equal in all directions; infinite where the
        surface is no dome.
    error : float, N/mm
        Standard error of the force by the scatter of the points' heights.
    strain : (float, float)
        Logarithmic strains along x and along y.
    """

    pressure: float
    height: float
    curvature: float
    force: float
    error: float
    strain: tuple[float, float]

    @property
    def stiffness(self) -> float:
        """Return force over the mean of the two strains, N/mm; infinite unless that is positive."""
        mean = 0.5 * (self.strain[0] + self.strain[1])
        return self.force / mean if mean > 0 else float("inf")


def apex_of(field: DisplacementField, radius: float) -> Apex:
    """Return shape, strain and membrane force of a measured field at the centre of the rim.

    Parameters
    ----------
    field : DisplacementField
        Field with the rim's centre as origin.
    radius : float, mm
        Radius of the rim.

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
    """Return the standard error (1/mm) of the curvature k1 + k2.

    It follows from the scatter of the heights (n,), mm, of the fitted points about the shape.
    """
    residual = heights - shape.terms @ shape.coefficients[:, 2]
    variance = float(residual @ residual) / (len(residual) - len(POWERS))
    inverse = np.linalg.pinv(shape.terms.T @ shape.terms)
    squares = [POWERS.index((2, 0)), POWERS.index((0, 2))]
    spread = np.sqrt(variance * inverse[np.ix_(squares, squares)].sum())
    return float(spread) * 2 / shape.radius**2
