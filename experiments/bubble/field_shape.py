"""The shape of a measured displacement field: its apex, smooth polynomials, and axes of symmetry.

Nothing here needs a model.

The field of an inflated disk is symmetric about warp and fill. In polar coordinates about the
centre, with the angle counted from the warp, the Fourier series of the radial displacement u_r and
of the rise u_z have cosines only, that of the tangential displacement u_theta has sines only. The
shape of the sheet before the test, which need not be symmetric, changes displacements much alike at
every pressure: the lowest image is subtracted from high ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from math import factorial

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from ...errors import InputError
from ...light_dataclasses import dataclass
from ...meshes.mesh import strain_of_tangents
from ...readers.fields import DisplacementField
from ...readers.frames import Frame
from ...solvers.base import Array
from .placement import correlated_points

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


#: Fewest points of which the strain is computed: of an inflated disk, polynomials of degree 7 give
#: it to 0.1 % of strain (RMS), those of degree 4 to 0.5 %.
MIN_STRAIN_POINTS = 192


@dataclass(frozen=True, eq=False)
class SmoothField:
    """A least-squares fit of displacements by products of Legendre polynomials of x and y.

    Attributes
    ----------
    positions : (n, 2) array, mm
        Positions of the displacements that were fitted.
    size : float, mm
        Largest absolute coordinate of the positions; polynomials are of x / size and y / size.
    amplitudes : (terms, k) array, mm
        Coefficients of the products, for each of k columns: the components of a displacement.
    """

    positions: Array
    size: float
    amplitudes: Array

    @classmethod
    def through(
        cls,
        positions: Array,
        values: Array,
        *,
        max_degree: int = 8,
        points_per_term: int = 3,
    ) -> SmoothField:
        """Fit displacements at positions by least squares.

        Parameters
        ----------
        positions : (n, 2) array, mm
        values : (n, k) array, mm
        max_degree : int
            Degree in x, and in y; it is lower where there are few points.
        points_per_term : int
            Fewest points for each product of polynomials.
        """
        size = float(np.abs(positions).max())
        degree = min(max_degree, math.isqrt(len(positions) // points_per_term) - 1)
        shapes = _shapes(positions / size, (max(degree, 1) + 1) ** 2)
        amplitudes, *_ = np.linalg.lstsq(shapes, values, rcond=1e-6)
        return cls(positions, size, np.asarray(amplitudes))

    def shapes(self, positions: Array) -> Array:
        """Return the products of polynomials, (n, terms), at positions (n, 2), mm."""
        return _shapes(positions / self.size, len(self.amplitudes))

    @property
    def values(self) -> Array:
        """Return the field, (n, k) mm, at the positions."""
        return self.shapes(self.positions) @ self.amplitudes

    def growth(self, shift: Array) -> Array:
        """Return the change of the field, (n, 3) mm, from positions less a shift to positions.

        Parameters
        ----------
        shift : (2,) array, mm
        """
        difference = self.shapes(self.positions) - self.shapes(self.positions - shift)
        return difference @ self.amplitudes

    def slopes(self, shift: Array | float = 0.0, step: float = 1e-4) -> tuple[Array, Array]:
        """Return the derivatives by x and by y, (n, k) each, at the positions less a shift.

        Parameters
        ----------
        shift : (2,) array, mm, or 0
        step : float
            Step of the central differences, as a share of the size.
        """
        scaled = (self.positions - shift) / self.size
        count = len(self.amplitudes)
        by_x, by_y = (
            (_shapes(scaled + change, count) - _shapes(scaled - change, count))
            @ self.amplitudes
            / (2 * step * self.size)
            for change in step * np.eye(2)
        )
        return by_x, by_y


def smooth_strains(
    positions: Array,
    heights: Array,
    displacements: Sequence[Array],
    warp: Array | None = None,
) -> list[Array]:
    """Return the log strain of a sheet that smooth polynomials through displacements have.

    Parameters
    ----------
    positions : (n, 2) array, mm
    heights : (n,) array, mm
        Heights z of the sheet before the test.
    displacements : sequence of (n, 3) arrays, mm
        Several fields, each of which is differentiated in the same way.
    warp : (3,) array, optional
        Direction of the warp; x unless given.

    Returns
    -------
    list of (n, 3) arrays
        eps1 along the warp, eps2 along the fill, and the engineering shear gamma12 of each field.
    """
    smooth = SmoothField.through(positions, np.column_stack([heights, *displacements]))
    all_slopes = np.stack(smooth.slopes(), axis=-1)
    first_rows = np.arange(1, 1 + 3 * len(displacements), 3)
    height_slope, *slopes = np.split(all_slopes, first_rows, axis=1)
    tangents = np.tile(np.eye(3, 2), (len(positions), 1, 1))
    tangents[:, 2] = height_slope[:, 0]
    return [strain_of_tangents(tangents, tangents + slope, warp) for slope in slopes]


def _shapes(scaled: Array, terms: int) -> Array:
    """Return products of Legendre polynomials, (n, terms), at points.

    Parameters
    ----------
    scaled : (n, 2) array
        Coordinates from -1 to 1.
    """
    x, y = (legvander(coordinate, math.isqrt(terms) - 1) for coordinate in scaled.T)
    products = x[:, :, None] * y[:, None]
    return products.reshape(len(scaled), -1)


def tilt_rotation(degrees: Array) -> tuple[Array, tuple[Array, Array]]:
    """Return the rotation of a tilt about x and y, and its derivatives by both angles.

    Parameters
    ----------
    degrees : (2,) array
        Angles about x and about y.

    Returns
    -------
    rotation : (3, 3) array
        Matrix that rotates about y first, then about x.
    derivatives : two (3, 3) arrays, 1/degree
        By the angle about x, and by that about y.
    """
    c, b = np.cos(np.radians(degrees))
    s, a = np.sin(np.radians(degrees))
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    about_y = np.array([[b, 0, a], [0, 1, 0], [-a, 0, b]])
    by_x = np.array([[0, 0, 0], [0, -s, -c], [0, c, -s]])
    by_y = np.array([[-a, 0, b], [0, 0, 0], [-b, 0, -a]])
    degree = np.pi / 180
    return about_x @ about_y, (degree * by_x @ about_y, degree * about_x @ by_y)


#: Harmonics of the angle about the centre; those by which the axes of symmetry are found.
HARMONICS = (0, 1, 2, 3, 4)
TELLING_HARMONICS = (2, 4)
#: Radii (shares of the rim's) at which amplitudes are compared; angles of axes that are tried.
RADII = np.linspace(0.1, 0.9, 9)
ANGLES = np.radians(np.arange(0.0, 90.0, 0.05))


@dataclass(frozen=True)
class SymmetrySettings:
    """Which images and points determine the axes, and how many parts show their scatter."""

    low_share: float = 0.7  # images that rise by more than this share of the last one are used
    max_frames: int = 6  # largest number of images used, those of the highest pressures
    max_parts: int = 4  # largest number of parts of the points whose axes are compared
    min_points_of_part: int = 120  # fewest points of a part, about four for each fitted term
    min_share: float = 0.01  # of the largest asymmetry: a component with less has no axes to show


SYMMETRY = SymmetrySettings()


@dataclass(frozen=True)
class Axes:
    """Two perpendicular axes of symmetry of a displacement field.

    Attributes
    ----------
    angle : float, degrees
        Angle of one of the axes from x towards y, 0 to 90.
    error : float, degrees
        Standard error of the angle: its scatter between images and between parts of the points
        together, or, if larger, its scatter between the components of the displacement.
    clarity : float
        How clearly the axes stand out: 1 - (asymmetry about these axes) / (asymmetry about the
        worst axes). 1 where the field is symmetric about these axes, 0 where no axes are better
        than others.
    """

    angle: float
    error: float
    clarity: float

    @property
    def misalignment(self) -> float:
        """Return the smallest angle (degrees) by which the axes are turned from x and y.

        It is from -45 to below 45, positive from x towards y.
        """
        return (self.angle + 45.0) % 90.0 - 45.0


def symmetry_axes(frames: Sequence[Frame], radius: float) -> Axes:
    """Find the axes about which the displacement fields of images are most symmetric.

    Parameters
    ----------
    frames : sequence of Frame
        Images with the rim's centre as origin, by rising pressure.
    radius : float, mm
        Radius of the rim.

    Returns
    -------
    Axes
    """
    asymmetries = _asymmetries(frames, radius)
    total = asymmetries.sum(axis=(0, 1))
    best = float(ANGLES[np.argmin(total)])
    # All images share the noise of the one that is subtracted, so their scatter does not show it;
    # the scatter between parts of the points does.
    error = _scatter(asymmetries.sum(axis=1), best)
    fewest_points = min(len(frame.points) for frame in frames)
    count = min(SYMMETRY.max_parts, fewest_points // SYMMETRY.min_points_of_part)
    if count > 1:
        parts = [_asymmetries(frames, radius, slice(k, None, count)) for k in range(count)]
        by_part = np.array([part.sum(axis=(0, 1)) for part in parts])
        error = float(np.hypot(error, _scatter(by_part, best)))
    largest = float(total.max())
    # A sheet that is not symmetric, say ridged, turns the axes of u_r, u_theta and u_z apart. One
    # that rises alike all around has none in u_z.
    by_component = asymmetries.sum(axis=0)
    has_axes = by_component.max(axis=1) > SYMMETRY.min_share * largest
    error = max(error, _scatter(by_component[has_axes], best))
    clarity = 1.0 - float(total.min()) / largest if largest > 0 else 0.0
    return Axes(float(np.degrees(best)), error, clarity)


def _asymmetries(frames: Sequence[Frame], radius: float, rows: slice = slice(None)) -> Array:
    """Return asymmetries (images, 3, angles), mm^2, of the high images less the lowest one.

    They are those of u_r, u_theta and u_z about axes at each of `ANGLES`.

    Parameters
    ----------
    rows : slice
        The points used.
    """
    frames = [
        replace(frame, points=frame.points[rows], displacement=frame.displacement[rows])
        for frame in frames
    ]
    rises = [float(np.nanmax(frame.displacement[:, 2])) for frame in frames]
    highest_low = SYMMETRY.low_share * rises[-1]
    low = [frame for frame, rise in zip(frames, rises, strict=True) if rise <= highest_low]
    high = [frame for frame, rise in zip(frames, rises, strict=True) if rise > highest_low]
    reference = harmonics(low[0], radius) if low else 0.0
    high = high[-SYMMETRY.max_frames :]
    return np.array([_asymmetry(harmonics(frame, radius) - reference) for frame in high])


def _scatter(asymmetries: Array, best: float) -> float:
    """Return the standard error (degrees) of the angle of the axes, from its scatter.

    Parameters
    ----------
    asymmetries : (samples, angles) array
        Each with the asymmetry about axes at `ANGLES`.
    best : float
        Angle of all samples together, radians. Angles that differ by 90 degrees are equal.
    """
    angles = ANGLES[np.argmin(asymmetries, axis=1)]
    count = len(angles)
    if count < 2:
        return 0.0
    deviation = np.angle(np.exp(4j * (angles - best))) / 4
    return float(np.degrees(np.sqrt((deviation**2).sum() / (count - 1) / count)))


def harmonics(frame: Frame, radius: float) -> Array:
    """Return the Fourier amplitudes of an image's displacements around the centre.

    Parameters
    ----------
    frame : Frame
        Image with the rim's centre as origin.
    radius : float, mm
        Radius of the rim.

    Returns
    -------
    (3, 5, 2, 9) array, mm
        Amplitudes by component (u_r, u_theta, u_z), harmonic (`HARMONICS`), cosine or sine, and
        radius (`RADII`).
    """
    points, displacement = correlated_points(frame)
    x, y = points[:, :2].T / radius
    r = np.hypot(x, y)
    angle = np.arctan2(y, x)
    is_on_disk = (r > 1e-6) & (r < 1.0)
    r = r[is_on_disk]
    angle = angle[is_on_disk]
    u_x, u_y, u_z = displacement[is_on_disk].T
    c = np.cos(angle)
    s = np.sin(angle)
    polar = np.stack([c * u_x + s * u_y, c * u_y - s * u_x])
    amplitudes = np.empty((3, len(HARMONICS), 2, len(RADII)))
    around = [wave(k * angle) for k in HARMONICS for wave in (np.cos, np.sin)]
    for quantity, values in enumerate([*polar, u_z]):
        is_planar = quantity < 2
        radial = np.concatenate([_radial(r, k, is_planar) for k in HARMONICS for _ in range(2)])
        radial = radial.reshape(len(around), 3, -1)
        terms = (radial * np.array(around)[:, None]).reshape(-1, len(r))
        solution, *_ = np.linalg.lstsq(terms.T, values, rcond=1e-10)
        coefficients = solution.reshape(len(HARMONICS), 2, 3)
        for k in HARMONICS:
            amplitudes[quantity, k] = coefficients[k] @ _radial(RADII, k, is_planar)
    return amplitudes


def _radial(r: Array, k: int, is_planar: bool) -> Array:
    """Return the three lowest powers (3, n) of the radius r that a smooth field has in harmonic k.

    Parameters
    ----------
    r : (n,) array
        Distances from the centre over the rim's radius.
    is_planar : bool
        Whether the component is u_r or u_theta, whose powers are others than those of u_z.
    """
    lowest = abs(k - 1) if is_planar and k else k + (1 if is_planar else 0)
    return np.stack([r ** (lowest + 2 * i) for i in range(3)])


def _asymmetry(profile: Array) -> Array:
    """Return how far u_r, u_theta, u_z are asymmetric about axes at `ANGLES`: (3, angles), mm^2.

    It is the sum over radii and harmonics of the squared amplitudes of the wrong kind (sines of u_r
    and u_z, cosines of u_theta), weighted by the radius.

    Parameters
    ----------
    profile : array
        Amplitudes as of `harmonics`.
    """
    total = np.zeros((3, len(ANGLES)))
    for k in TELLING_HARMONICS:
        cosine = np.cos(k * ANGLES)[:, None]
        sine = np.sin(k * ANGLES)[:, None]
        for quantity in range(3):
            a, b = profile[quantity, k]
            odd = b * cosine - a * sine if quantity != 1 else a * cosine + b * sine
            total[quantity] += (RADII * odd**2).sum(axis=1)
    return total


def folded(field: DisplacementField) -> DisplacementField:
    """Return a field of the full disk with all its points mirrored into the quarter x, y >= 0."""
    sign = np.where(field.points < 0, -1.0, 1.0)
    displacement = field.displacement.copy()
    displacement[:, :2] *= sign
    return replace(field, points=np.abs(field.points), displacement=displacement)


def mirrored(field: DisplacementField) -> DisplacementField:
    """Return a field of the quarter x, y >= 0 mirrored to the full disk.

    A field with points outside of this quarter is returned as it is.
    """
    if (field.points < -1e-9).any():
        return field
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    points = np.concatenate([field.points * (sx, sy) for sx, sy in signs])
    displacement = np.concatenate([field.displacement * (sx, sy, 1) for sx, sy in signs])
    _, rows = np.unique(np.round(points, 6), axis=0, return_index=True)
    return replace(
        field,
        points=points[rows],
        displacement=displacement[rows],
        z=None if field.z is None else np.tile(field.z, 4)[rows],
        sigma=None if field.sigma is None else np.tile(field.sigma, 4)[rows],
    )
