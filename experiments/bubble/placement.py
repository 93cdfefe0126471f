"""Coordinates of frames: placements, a plane through points, the rigid motion of a clamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...readers.frames import Frame
from ...solvers.base import Array

#: A median absolute deviation of a normal distribution, times this, is its standard deviation.
SIGMA_PER_MAD = 1.4826
#: The clamp begins at this share of the rim's radius, and so many of its points are needed.
CLAMP_BEGINS = 1.03
MIN_CLAMP_POINTS = 12


@dataclass(frozen=True, eq=False)
class Placement:
    """A right-handed coordinate system in another one, here mostly that of the camera.

    Attributes
    ----------
    origin : (3,) array, mm
    axes : (3, 3) array
        Unit vectors x, y, z as rows.
    """

    origin: Array
    axes: Array

    def coordinates(self, points: Array) -> Array:
        """Return points (..., 3) mm of the outer coordinates in these."""
        return np.asarray((points - self.origin) @ self.axes.T)

    def transformed(self, frames: Sequence[Frame]) -> tuple[Frame, ...]:
        """Return frames of the outer coordinates in these."""
        return tuple(
            replace(
                frame,
                points=self.coordinates(frame.points),
                displacement=np.asarray(frame.displacement @ self.axes.T),
            )
            for frame in frames
        )

    def within(self, outer: Placement) -> Placement:
        """Return this placement, which is in the coordinates of `outer`, in those around it."""
        return Placement(outer.origin + self.origin @ outer.axes, self.axes @ outer.axes)

    @property
    def tilt(self) -> float:
        """Return the angle between the two z axes, degrees."""
        cosine = np.clip(self.axes[2, 2], -1.0, 1.0)
        return float(np.degrees(np.arccos(cosine)))


def rotation_about_z(angle: float) -> Placement:
    """Return the same plane and origin, x turned by an angle (degrees) from x towards y."""
    c = np.cos(np.radians(angle))
    s = np.sin(np.radians(angle))
    x_axis = [c, s, 0.0]
    y_axis = [-s, c, 0.0]
    return Placement(np.zeros(3), np.array([x_axis, y_axis, [0.0, 0.0, 1.0]]))


def plane_through(
    points: Array, up: Array, *, max_deviations: float = 4.0, rounds: int = 8
) -> tuple[Placement, float]:
    """Fit a plane through points, leaving out those that are far from it.

    Parameters
    ----------
    points : (n, 3) array, mm
    up : (3,) array
        The z axis is on its side.
    max_deviations : float
        Points further from the plane than this many robust deviations do not count.
    rounds : int
        Of leaving out, at most.

    Returns
    -------
    placement : Placement
        Its origin is the mean of the points that count, its z the normal, its x the camera's x
        laid into the plane.
    deviation : float, mm
        Robust deviation of the points from the plane.

    Raises
    ------
    InputError
        The points are too few or lie on a line.
    """
    points = points[np.isfinite(points).all(axis=1)]
    counts = np.ones(len(points), dtype=bool)
    for _ in range(rounds):
        if counts.sum() < 3:
            raise InputError(None, "plane", f"expected three points or more, got {counts.sum()}")
        origin = points[counts].mean(axis=0)
        _, spread, axes = np.linalg.svd(points[counts] - origin, full_matrices=False)
        if spread[1] < 1e-6 * spread[0]:
            raise InputError(None, "plane", "expected points across a surface, got a line")
        distance = (points - origin) @ axes[2]
        deviation = SIGMA_PER_MAD * float(np.median(np.abs(distance[counts])))
        is_close = np.abs(distance) <= max(max_deviations * deviation, 1e-9 * spread[0])
        if (is_close == counts).all():
            break
        counts = is_close
    normal = axes[2] * (1.0 if axes[2] @ up >= 0 else -1.0)
    x = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    if np.linalg.norm(x) < 0.1:  # the camera looks along its own x
        x = np.array([0.0, 1.0, 0.0]) - normal[1] * normal
    x /= np.linalg.norm(x)
    return Placement(origin, np.stack([x, np.cross(normal, x), normal])), deviation


def line_angle(degrees: float) -> float:
    """Return the angle of a line, which repeats after 180 degrees: from -90 to below 90."""
    return (degrees + 90.0) % 180.0 - 90.0


def in_all_quarters(points: Array) -> bool:
    """Return whether points (n, 2 or 3) about the centre lie in all four quarters of its plane."""
    return len(np.unique(points[:, :2] > 0, axis=0)) == 4


def correlated_points(frame: Frame) -> tuple[Array, Array]:
    """Return positions (n, 3) and displacements (n, 3) mm where both were correlated."""
    is_correlated = np.isfinite(frame.points).all(axis=1)
    is_correlated &= np.isfinite(frame.displacement).all(axis=1)
    return frame.points[is_correlated], frame.displacement[is_correlated]


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A motion of a rigid body: position -> rotation @ position + shift.

    Attributes
    ----------
    rotation : (3, 3) array
    shift : (3,) array, mm
    points : int
        Number of points that it was fitted to.
    """

    rotation: Array
    shift: Array
    points: int

    @property
    def angle(self) -> float:
        """Return the angle of the rotation, degrees."""
        cosine = np.clip((np.trace(self.rotation) - 1) / 2, -1.0, 1.0)
        return float(np.degrees(np.arccos(cosine)))


UNKNOWN = RigidMotion(np.eye(3), np.zeros(3), 0)


def clamp_motion(frame: Frame, clamp: NDArray[np.bool_]) -> RigidMotion:
    """Fit the rigid motion of the clamp by least squares.

    Parameters
    ----------
    frame : Frame
    clamp : (n,) array of bool
        Which points of the frame are on the clamp.

    Returns
    -------
    RigidMotion
        `UNKNOWN` where too few points around the disk are on the clamp.

    References
    ----------
    W. Kabsch, A solution for the best rotation to relate two sets of vectors, Acta
    Crystallographica A 32 (1976), 922-923.
    """
    is_measured = clamp & np.isfinite(frame.displacement).all(axis=1)
    positions = frame.points[is_measured]
    if len(positions) < MIN_CLAMP_POINTS or not in_all_quarters(positions):
        return UNKNOWN
    deformed = positions + frame.displacement[is_measured]
    centre = positions.mean(axis=0)
    deformed_centre = deformed.mean(axis=0)
    u, _, v = np.linalg.svd((deformed - deformed_centre).T @ (positions - centre))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return RigidMotion(rotation, deformed_centre - rotation @ centre, len(positions))


def without_motion(frame: Frame, motion: RigidMotion) -> Frame:
    """Return the frame as a clamp that did not move would show it."""
    deformed = frame.points + frame.displacement
    # The inverse of a rotation is its transpose.
    displacement = (deformed - motion.shift) @ motion.rotation - frame.points
    return replace(frame, displacement=displacement)
