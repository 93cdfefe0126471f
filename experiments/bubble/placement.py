"""Coordinate systems of a bubble test, the clamp's rigid motion, and where the rim is.

A "frame" here is one image of the test: a `Frame` with measured points and displacements.

The rim (the clamped edge of the sheet) is found from the rise, the displacement along z, in two
ways. `rim_of_motion` knows the size of the rim and finds its centre: the rise is fitted by a
polynomial times a factor that is zero on the rim. `clamp_of_motion` needs measured points on the
clamp, beyond the rim, and finds centre and size: the edge of the clamp is where points begin to
stand still.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...light_dataclasses import dataclass
from ...readers.frames import Frame
from ...solvers.base import Array

#: A median absolute deviation of a normal distribution, times this, is its standard deviation.
SIGMA_PER_MAD = 1.4826
#: Points further from the centre than this share of the rim's radius count as points of the clamp.
CLAMP_BEGINS = 1.03
#: Fewest measured points on the clamp by which its plane or its motion is fitted.
MIN_CLAMP_POINTS = 12


@dataclass(frozen=True, eq=False)
class Placement:
    """A right-handed coordinate system, given in a parent system (mostly that of the camera).

    Attributes
    ----------
    origin : (3,) array, mm
        Its origin, in coordinates of the parent.
    axes : (3, 3) array
        Its unit vectors x, y, z as rows, in components of the parent.
    """

    origin: Array
    axes: Array

    def coordinates(self, points: Array) -> Array:
        """Return the coordinates in this system of points (..., 3), mm, given in the parent."""
        return (points - self.origin) @ self.axes.T

    def transformed(self, frames: Sequence[Frame]) -> tuple[Frame, ...]:
        """Return images whose points and displacements are given in the parent, in this system."""
        return tuple(
            replace(
                frame,
                points=self.coordinates(frame.points),
                displacement=frame.displacement @ self.axes.T,
            )
            for frame in frames
        )

    def composed_with(self, outer: Placement) -> Placement:
        """Return this system, whose parent is `outer`, as a placement in the parent of `outer`."""
        return Placement(outer.origin + self.origin @ outer.axes, self.axes @ outer.axes)

    @property
    def tilt(self) -> float:
        """Return the angle between the z axes of this system and of its parent, degrees."""
        cosine = np.clip(self.axes[2, 2], -1.0, 1.0)
        return float(np.degrees(np.arccos(cosine)))


def rotation_about_z(angle: float) -> Placement:
    """Return a system with its parent's origin and z axis, turned by an angle (degrees).

    A positive angle turns from the parent's x axis towards its y axis.
    """
    c = np.cos(np.radians(angle))
    s = np.sin(np.radians(angle))
    x_axis = [c, s, 0.0]
    y_axis = [-s, c, 0.0]
    return Placement(np.zeros(3), np.array([x_axis, y_axis, [0.0, 0.0, 1.0]]))


def plane_through(
    points: Array,
    up: Array,
    *,
    max_deviations: float = 4.0,
    rounds: int = 8,
) -> tuple[Placement, float]:
    """Fit a plane through points by least squares, leaving out points that lie far from it.

    Parameters
    ----------
    points : (n, 3) array, mm
        Points in the camera's coordinates; those that are not finite are left out.
    up : (3,) array
        A direction on the side of the plane to which its z axis shall point.
    max_deviations : float
        Points further from the plane than this multiple of the robust deviation are left out.
    rounds : int
        Largest number of times that points are left out and the plane is fitted again.

    Returns
    -------
    placement : Placement
        Coordinate system in the camera's: its origin is the mean of the fitted points, its z axis
        the normal of the plane, its x axis the camera's x axis projected into the plane.
    deviation : float, mm
        Robust standard deviation of the fitted points from the plane (from the median absolute
        deviation).

    Raises
    ------
    InputError
        The points are too few or lie on a line.
    """
    points = points[np.isfinite(points).all(axis=1)]
    is_kept = np.ones(len(points), dtype=bool)
    for _ in range(rounds):
        if is_kept.sum() < 3:
            raise InputError(None, "plane", f"expected three points or more, got {is_kept.sum()}")
        origin = points[is_kept].mean(axis=0)
        _, spread, axes = np.linalg.svd(points[is_kept] - origin, full_matrices=False)
        if spread[1] < 1e-6 * spread[0]:
            raise InputError(None, "plane", "expected points across a surface, got a line")
        distance = (points - origin) @ axes[2]
        deviation = SIGMA_PER_MAD * float(np.median(np.abs(distance[is_kept])))
        is_close = np.abs(distance) <= max(max_deviations * deviation, 1e-9 * spread[0])
        if (is_close == is_kept).all():
            break
        is_kept = is_close
    normal = axes[2] * (1.0 if axes[2] @ up >= 0 else -1.0)
    x = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    if np.linalg.norm(x) < 0.1:  # the normal is nearly along the camera's x: its y is projected
        x = np.array([0.0, 1.0, 0.0]) - normal[1] * normal
    x /= np.linalg.norm(x)
    return Placement(origin, np.stack([x, np.cross(normal, x), normal])), deviation


def line_angle(degrees: float) -> float:
    """Return the angle (degrees) of a line without a sense, reduced to -90 up to below 90."""
    return (degrees + 90.0) % 180.0 - 90.0


def in_all_quarters(points: Array) -> bool:
    """Return whether points lie in all four quadrants of the x-y plane, so all around the centre.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array
        With the centre as origin.
    """
    return len(np.unique(points[:, :2] > 0, axis=0)) == 4


def thinned(rows: NDArray[np.intp], max_count: int) -> NDArray[np.intp]:
    """Return evenly spaced ones of rows (n,), `max_count` at most."""
    return rows[:: max(1, math.ceil(len(rows) / max_count))]


def correlated_points(frame: Frame) -> tuple[Array, Array]:
    """Return positions and displacements, each (n, 3) in mm, of the points where both are finite.

    Elsewhere the image correlation found no match.
    """
    is_correlated = np.isfinite(frame.points).all(axis=1)
    is_correlated &= np.isfinite(frame.displacement).all(axis=1)
    return frame.points[is_correlated], frame.displacement[is_correlated]


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A motion of a rigid body, which takes a position x to `rotation @ x + shift`.

    Attributes
    ----------
    rotation : (3, 3) array
    shift : (3,) array, mm
    point_count : int
        Number of measured points that the motion was fitted to, 0 where none was fitted.
    """

    rotation: Array
    shift: Array
    point_count: int

    @property
    def angle(self) -> float:
        """Return the angle of the rotation about its own axis, degrees."""
        cosine = np.clip((np.trace(self.rotation) - 1) / 2, -1.0, 1.0)
        return float(np.degrees(np.arccos(cosine)))


#: No motion: stands for the motion of a clamp of which too few points were measured.
NO_MOTION = RigidMotion(np.eye(3), np.zeros(3), 0)


def clamp_motion(frame: Frame, clamp: NDArray[np.bool_]) -> RigidMotion:
    """Fit the rigid motion of the clamp from the reference state to an image by least squares.

    Parameters
    ----------
    frame : Frame
        Image whose coordinates have the centre of the rim as origin.
    clamp : (n,) array of bool
        Which points of the image are on the clamp.

    Returns
    -------
    RigidMotion
        `NO_MOTION` where fewer than `MIN_CLAMP_POINTS` points are on the clamp, or not all around.

    References
    ----------
    W. Kabsch, A solution for the best rotation to relate two sets of vectors, Acta
    Crystallographica A 32 (1976), 922-923.
    """
    is_measured = clamp & np.isfinite(frame.displacement).all(axis=1)
    positions = frame.points[is_measured]
    if len(positions) < MIN_CLAMP_POINTS or not in_all_quarters(positions):
        return NO_MOTION
    deformed = positions + frame.displacement[is_measured]
    centre = positions.mean(axis=0)
    deformed_centre = deformed.mean(axis=0)
    u, _, v = np.linalg.svd((deformed - deformed_centre).T @ (positions - centre))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return RigidMotion(rotation, deformed_centre - rotation @ centre, len(positions))


def without_motion(frame: Frame, motion: RigidMotion) -> Frame:
    """Return an image with the rigid motion of the clamp removed from its displacements."""
    deformed = frame.points + frame.displacement
    # The inverse of a rotation is its transpose.
    displacement = (deformed - motion.shift) @ motion.rotation - frame.points
    return replace(frame, displacement=displacement)


#: Positions (n, 2) mm in the plane of the sheet, and rises (n,): mm, or shares where it is said.
RiseSurface = tuple[Array, Array]
#: First and second semi-axis of the rim, mm; equal for a circle.
SemiAxes = tuple[float, float]
#: Powers (i, j) of the terms u^i v^j that multiply the factor 1 - u^2 - v^2, which vanishes at the
#: rim: terms of even and of odd total degree. u, v: coordinates along the semi-axes, 1 at the rim.
EVEN = ((0, 0), (2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
ODD = ((1, 0), (0, 1), (3, 0), (2, 1), (1, 2), (0, 3))
#: Fewest points of an image that is fitted: three for each term, of which one is a shift along z.
MIN_POINTS = 3 * (len(EVEN) + len(ODD) + 1)


@dataclass(frozen=True)
class RimSearch:
    """Settings of the search for the rim; distances from the centre are in shares of its radius."""

    max_frames: int = 4  # number of images used, those of the highest pressures
    max_points: int = 2000  # about the largest number of points used of an image, evenly thinned
    disk: float = 1.02  # points up to this distance from the first guess are on the disk
    near_rim: float = 0.8  # points of the disk beyond this distance determine where the rim is
    around_clamp: float = 1.6  # points beyond this distance do not determine the clamp's edge
    still: float = 0.01  # share of the largest rise: points that rise by less stand still
    sizes: tuple[float, ...] = tuple(np.arange(0.6, 1.55, 0.1).tolist())  # first guesses of scale


SEARCH = RimSearch()


@dataclass(frozen=True)
class Rim:
    """The rim (clamped edge of the sheet) as it was found in the plane of the sheet.

    Attributes
    ----------
    x, y : float, mm
        Centre.
    angle : float, degrees
        Angle of the first semi-axis from x towards y, 0 for a circle.
    error : float, mm
        Standard error of the centre: root of the sum of the variances of x and y.
    turn_error : float, degrees
        Standard error of the angle, 0 where the angle was given.
    scale : float
        Ratio of the semi-axes that were found to those that were given, 1 where only the centre
        was looked for.
    still_count : int
        Number of points beyond the rim that stand still, 0 where the rim was found by the rise.
    """

    x: float
    y: float
    angle: float
    error: float
    turn_error: float = 0.0
    scale: float = 1.0
    still_count: int = 0


def rim_of_motion(
    surfaces: Sequence[RiseSurface],
    semi_axes: SemiAxes,
    start: tuple[float, float] = (0.0, 0.0),
    angle: float | None = None,
) -> Rim:
    """Find centre and turn of a rim of known size: the curve on which the sheet does not rise.

    The rise of every image is fitted by a polynomial times a factor that is zero on the rim, plus
    a constant, the image's shift along z. The odd terms of the polynomial take up asymmetry of the
    sheet, which must not move the rim.

    Parameters
    ----------
    surfaces : sequence of ((n, 2) array, (n,) array), mm
        Positions in the plane of the sheet and rises of each image, by rising pressure; the last
        few are used.
    semi_axes : (float, float), mm
        Semi-axes of the rim.
    start : (float, float), mm
        Guess of the centre, at which the search starts.
    angle : float, degrees, or None
        Angle of the first semi-axis from x towards y; None finds it where the semi-axes differ.

    Returns
    -------
    Rim

    Raises
    ------
    InputError
        Too few points lie on the disk, or they do not come near the rim all around it.
    """
    is_turn_unknown = semi_axes[0] != semi_axes[1] and angle is None
    fixed_angle = 0.0 if angle is None else angle
    first_angle = _long_axis(*surfaces[-1], semi_axes) if is_turn_unknown else fixed_angle
    guess = np.array([*start, first_angle])
    on_disk = [_on_disk(*surface, guess, semi_axes) for surface in surfaces[-SEARCH.max_frames :]]
    terms = partial(_rim_terms, angle=fixed_angle, semi_axes=semi_axes)
    count = 3 if is_turn_unknown else 2
    steps = [semi_axes[0], semi_axes[0], 60.0][:count]
    anywhere = np.full(count, np.inf)
    best, covariance = _fit_outline(on_disk, terms, [guess[:count]], steps, anywhere)
    return Rim(
        x=float(best[0]),
        y=float(best[1]),
        angle=float(best[2]) % 180.0 if is_turn_unknown else fixed_angle,
        error=float(np.sqrt(np.trace(covariance[:2, :2]))),
        turn_error=float(np.sqrt(covariance[2, 2])) if is_turn_unknown else 0.0,
    )


def clamp_of_motion(
    surfaces: Sequence[RiseSurface], semi_axes: SemiAxes, angle: float = 0.0
) -> Rim | None:
    """Find centre and size of the clamp's edge, beyond which measured points stand still.

    The rise of every image is fitted by a polynomial times a factor that is zero from the edge on,
    plus a constant.

    Parameters
    ----------
    surfaces, semi_axes, angle
        As those of `rim_of_motion`; positions have the (guessed) centre of the rim as origin, and
        `semi_axes` are a guess whose ratio is kept.

    Returns
    -------
    Rim or None
        None where too few points around the disk stand still.
    """
    scaled = []
    for surface in surfaces[-SEARCH.max_frames :]:
        points, rise = _around_clamp(*surface, semi_axes, angle)
        if len(rise) < MIN_POINTS or not np.abs(rise).max() > 0:
            return None
        scaled.append((points, rise / np.abs(rise).max()))
    # With too large a size the rise hardly depends on it, and the search would stay there: it
    # starts at the best of several sizes.
    starts = [np.array([0.0, 0.0, size]) for size in SEARCH.sizes]
    reach = np.array([0.5 * semi_axes[1], 0.5 * semi_axes[1], 0.2])
    terms = partial(_clamp_terms, angle=angle, semi_axes=semi_axes)
    steps = [semi_axes[0], semi_axes[0], 1.0]
    best, covariance = _fit_outline(scaled, terms, starts, steps, reach)
    points, rise = scaled[-1]
    x, y, size = best.tolist()
    local = _in_semi_axes(points, np.array([x, y, angle]), semi_axes, size)
    is_on_clamp = np.hypot(*local) > CLAMP_BEGINS
    if is_on_clamp.sum() < MIN_CLAMP_POINTS or not in_all_quarters(local[:, is_on_clamp].T):
        return None
    # Points beyond the edge that do not stand still are not on a clamp.
    level = np.median(rise[is_on_clamp])
    if np.median(np.abs(rise[is_on_clamp] - level)) > SEARCH.still:
        return None
    error = float(np.sqrt(np.trace(covariance[:2, :2])))
    return Rim(
        x,
        y,
        angle,
        error,
        scale=size,
        still_count=int(is_on_clamp.sum()),
    )


def _around_clamp(
    points: Array,
    rise: Array,
    semi_axes: SemiAxes,
    angle: float,
) -> RiseSurface:
    """Return points of an image near enough to the rim to determine the clamp, and their rises.

    Of many points, evenly spaced ones are returned.

    Parameters
    ----------
    points, rise : (n, 2) and (n,) arrays, mm
        Points of the image relative to the centre of the rim, and their rises.
    semi_axes : (float, float), mm
    angle : float, degrees
        Of the first semi-axis.
    """
    local = _in_semi_axes(points, np.array([0.0, 0.0, angle]), semi_axes)
    is_around = np.hypot(*local) < SEARCH.around_clamp
    rows = thinned(np.flatnonzero(is_around), SEARCH.max_points)
    return points[rows], rise[rows]


def _fit_outline(
    surfaces: Sequence[RiseSurface],
    terms: Callable[[Array, Array], Array],
    starts: Sequence[Array],
    steps: Sequence[float],
    reach: Array,
) -> tuple[Array, Array]:
    """Fit the outline whose terms follow the rises best; return it and its covariance matrix.

    Parameters
    ----------
    surfaces : sequence of RiseSurface
        Rises as shares of the largest of each image.
    terms : callable
        Returns, for points (n, 2) and an outline (unknowns,), the terms (n, k) whose linear
        combination is to follow the rises.
    starts : sequence of (unknowns,) array
        Guesses of the outline; the search starts at the best.
    steps : sequence of float
        Typical changes of the unknowns, by which they are scaled.
    reach : (unknowns,) array
        Largest change of each unknown from the start.
    """
    residual = partial(_outline_residual, surfaces=surfaces, terms=terms)
    start = min(starts, key=lambda outline: np.linalg.norm(residual(outline)))
    bounds = start - reach, start + reach
    best = scipy.optimize.least_squares(residual, start, x_scale=steps, bounds=bounds)
    variance = 2 * best.cost / max(len(best.fun) - len(best.x), 1)
    return best.x, variance * np.linalg.pinv(best.jac.T @ best.jac)


def _outline_residual(
    outline: Array, surfaces: Sequence[RiseSurface], terms: Callable[[Array, Array], Array]
) -> Array:
    """Return the rises less the best linear combination of the terms of an outline, as one array.

    Images follow each other, and rises are as shares of the largest of each.
    The amplitudes are found for each image alone, by projection (variable projection).

    Parameters
    ----------
    outline : (unknowns,) array
        The unknowns of `_fit_outline`.
    """
    residuals = []
    for points, rise in surfaces:
        orthogonal, _ = scipy.linalg.qr(terms(points, outline), mode="economic", check_finite=False)
        residuals.append(rise - orthogonal @ (orthogonal.T @ rise))
    return np.concatenate(residuals)


def _rim_terms(
    points: Array,
    outline: Array,
    angle: float,
    semi_axes: SemiAxes,
) -> Array:
    """Return the terms (n, k) of a rim, for points (n, 2).

    `outline` is (x, y), and `angle` holds; or it is (x, y, angle), and `angle` is ignored.
    """
    return _terms(_in_semi_axes(points, np.append(outline, angle)[:3], semi_axes))


def _clamp_terms(
    points: Array,
    outline: Array,
    angle: float,
    semi_axes: SemiAxes,
) -> Array:
    """Return the terms (n, k) of a clamp with outline (x, y, size): zero from its edge on.

    Parameters
    ----------
    points : (n, 2) array, mm
    """
    x, y, size = outline
    local = _in_semi_axes(points, np.array([x, y, angle]), semi_axes, size)
    return _terms(local, is_clamped=True)


def _terms(local: Array, is_clamped: bool = False) -> Array:
    """Return polynomial terms that vanish at the rim, and a constant, (n, k).

    Parameters
    ----------
    local : (2, n) array
        Coordinates u, v along the semi-axes, in semi-axes.
    is_clamped : bool
        Whether the terms are zero beyond the rim, too.
    """
    u, v = local
    factor = 1.0 - u**2 - v**2
    if is_clamped:
        factor = factor.clip(min=0.0)
    powers = [np.ones_like(local)]
    while len(powers) <= max(EVEN[-1]):
        powers.append(powers[-1] * local)
    shapes = [factor * powers[i][0] * powers[j][1] for i, j in (*EVEN, *ODD)]
    return np.array([*shapes, powers[0][0]]).T


def _in_semi_axes(
    points: Array,
    outline: Array,
    semi_axes: SemiAxes,
    size: float = 1.0,
) -> Array:
    """Return coordinates (2, n) along the semi-axes of an outline (x, y, degrees).

    They are in shares of the semi-axes times `size`.

    Parameters
    ----------
    points : (n, 2) array, mm
    """
    c = np.cos(np.radians(outline[2]))
    s = np.sin(np.radians(outline[2]))
    x, y = (points - outline[:2]).T
    u = (c * x + s * y) / semi_axes[0]
    v = (c * y - s * x) / semi_axes[1]
    return np.stack([u, v]) / size


def _long_axis(points: Array, rise: Array, semi_axes: SemiAxes) -> float:
    """Guess the angle (degrees) of the first semi-axis from the second moments of the rise.

    The rise extends further along the longer semi-axis.

    Parameters
    ----------
    points, rise : (n, 2) and (n,) arrays, mm
        Points of the image and their rises.
    semi_axes : (float, float), mm
    """
    weight = np.clip(rise, 0.0, None)
    centre = (weight[:, None] * points).sum(axis=0) / weight.sum()
    x, y = (points - centre).T
    xx = float((weight * (x * x)).sum())
    yy = float((weight * (y * y)).sum())
    xy = float((weight * (x * y)).sum())
    angle = np.degrees(0.5 * np.arctan2(2 * xy, xx - yy))
    return float(angle if semi_axes[0] > semi_axes[1] else angle + 90.0)


def _on_disk(
    points: Array,
    rise: Array,
    outline: Array,
    semi_axes: SemiAxes,
) -> RiseSurface:
    """Return points within the rim, and their rises relative to the largest of them.

    Of many points, evenly spaced ones are returned.

    Parameters
    ----------
    points, rise : (n, 2) and (n,) arrays, mm
        Points of the image and their rises.
    outline : (3,) array
        Centre x, y (mm) and angle of the first semi-axis (degrees).
    semi_axes : (float, float), mm

    Raises
    ------
    InputError
        Points are too few, or do not come near the rim in all eight directions.
    """
    local = _in_semi_axes(points, outline, semi_axes)
    is_on_disk = np.hypot(*local) < SEARCH.disk
    if is_on_disk.sum() < MIN_POINTS:
        problem = f"expected at least {MIN_POINTS} points on the disk, got {int(is_on_disk.sum())}"
        raise InputError(None, "centre", f"{problem}; are the length unit and the radius right?")
    u, v = local[:, is_on_disk & (np.hypot(*local) > SEARCH.near_rim)]
    octant = np.arctan2(v, u) // (np.pi / 4)
    octants = np.unique(octant.astype(int))
    if len(octants) < 8:
        share = f"{1 - SEARCH.near_rim:.0%}"
        problem = f"points come within {share} of the rim in {len(octants)} of 8 directions"
        raise InputError(None, "centre", f"{problem} only; give the centre")
    rows = thinned(np.flatnonzero(is_on_disk), SEARCH.max_points)
    return points[rows], rise[rows] / np.abs(rise[rows]).max()
