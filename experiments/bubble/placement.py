"""Coordinate systems of a bubble test, a plane fitted through points, the clamp's rigid motion.

A "frame" here is one image of the test: a `Frame` with measured points and displacements.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
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
