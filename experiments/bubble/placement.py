"""Placements of the test's coordinates in the camera's, planes, clamp motions, shapes at the apex.

Frames are moved from one coordinate system into the other; `apex_shape` is the polynomial about the
centre from which strain and curvature follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import factorial

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.disk import Outline
from ...readers.frames import Frame

Array = NDArray[np.float64]

#: Points further from the plane than this many robust deviations do not count.
FAR = 4.0
ROUNDS = 20
#: A median absolute deviation of a normal distribution in standard deviations.
MAD = 1.4826
#: Points from this share of the rim's radius on are on the clamp, and so many of them are needed.
BEYOND, LEAST = 1.03, 12
#: Points within this share of the radius determine the shape about the centre.
WITHIN = 0.5
#: Powers of the polynomial, each up to a total of four.
POWERS = tuple((i, j) for i in range(5) for j in range(5 - i))


@dataclass(frozen=True, eq=False)
class Placement:
    """A right-handed frame: `origin` (3,) mm and unit `axes` (3, 3), rows x, y, z, in the camera's.

    Raises ValueError for axes that are not orthonormal and right-handed.
    """

    origin: Array
    axes: Array

    def __post_init__(self) -> None:
        square = np.allclose(self.axes @ self.axes.T, np.eye(3), atol=1e-9)
        if not square or np.linalg.det(self.axes) < 0:
            raise ValueError("expected right-handed, orthonormal axes")

    def places(self, points: Array) -> Array:
        """Return points (..., 3) of the camera's frame in the test's."""
        return np.asarray((points - self.origin) @ self.axes.T)

    def applied(self, frame: Frame) -> Frame:
        """Return the frame in the test's coordinates."""
        displacement = np.asarray(frame.displacement @ self.axes.T)
        return replace(frame, points=self.places(frame.points), displacement=displacement)

    def after(self, first: Placement) -> Placement:
        """Return the one placement that is `first` and then this."""
        return Placement(first.origin + self.origin @ first.axes, self.axes @ first.axes)

    @property
    def tilt(self) -> float:
        """Return the angle between the two z axes, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.axes[2, 2], -1.0, 1.0))))


def turned(angle: float) -> Placement:
    """Return the same plane and origin, x turned by `angle` degrees from x towards y."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return Placement(np.zeros(3), np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def shifted(x: float, y: float, z: float = 0.0) -> Placement:
    """Return the same axes with the origin moved."""
    return Placement(np.array([x, y, z], dtype=float), np.eye(3))


def all_applied(placement: Placement, frames: Sequence[Frame]) -> tuple[Frame, ...]:
    """Return every frame in the test's coordinates."""
    return tuple(placement.applied(frame) for frame in frames)


def plane_through(points: Array, up: Array) -> tuple[Placement, float]:
    """Fit a plane through points (n, 3); return it and their robust deviation from it in mm.

    Its origin is the mean of the points that count, its z the normal on the side of `up` (3,), its
    x the camera's x laid into the plane. Raises InputError for fewer than three points, and for
    points on a line.
    """
    points = points[np.isfinite(points).all(axis=1)]
    kept = np.ones(len(points), dtype=bool)
    for _ in range(ROUNDS):
        if kept.sum() < 3:
            raise InputError(None, "plane", f"expected three points or more, got {kept.sum()}")
        origin = points[kept].mean(axis=0)
        _, spread, axes = np.linalg.svd(points[kept] - origin, full_matrices=False)
        if spread[1] < 1e-6 * spread[0]:
            raise InputError(None, "plane", "expected points across a surface, got a line")
        distance = (points - origin) @ axes[2]
        deviation = MAD * float(np.median(np.abs(distance[kept])))
        now = np.abs(distance) <= max(FAR * deviation, 1e-9 * spread[0])
        if (now == kept).all():
            break
        kept = now
    normal = axes[2] * (1.0 if axes[2] @ up >= 0 else -1.0)
    x = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    if np.linalg.norm(x) < 0.1:  # the camera looks along its own x
        x = np.array([0.0, 1.0, 0.0]) - normal[1] * normal
    x /= np.linalg.norm(x)
    return Placement(origin, np.stack([x, np.cross(normal, x), normal])), deviation


def line_angle(degrees: float) -> float:
    """Return the angle of a line, which repeats after 180 degrees: from -90 to below 90."""
    return (degrees + 90.0) % 180.0 - 90.0


def axes_angle(degrees: float) -> float:
    """Return the angle of two axes at right angles, which repeats after 90: -45 to below 45."""
    return (degrees + 45.0) % 90.0 - 45.0


def in_all_quarters(points: NDArray[np.float64]) -> bool:
    """Return whether points (n, 2 or 3) about the centre lie in all four quarters of its plane."""
    return len(np.unique(points[:, :2] > 0, axis=0)) == 4


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A motion of a rigid body: place -> turn @ place + shift, mm.

    left : RMS of what is not rigid, mm. points : on which it was found; 0 where it is unknown.
    """

    turn: Array
    shift: Array
    left: float
    points: int

    @property
    def angle(self) -> float:
        """Return the angle of the turn, degrees."""
        return float(np.degrees(np.arccos(np.clip((np.trace(self.turn) - 1) / 2, -1.0, 1.0))))


UNKNOWN = RigidMotion(np.eye(3), np.zeros(3), float("nan"), 0)


def clamp_points(points: Array, outline: Outline) -> NDArray[np.bool_]:
    """Return which of the points (n, 3), about the rim's centre in its plane, are beyond it."""
    return outline.share(points[:, :2]) > BEYOND


def clamp_motion(frame: Frame, clamp: NDArray[np.bool_]) -> RigidMotion:
    """Return the rigid motion of the clamp's points; `UNKNOWN` where too few are all around.

    The turn is the nearest rotation (Kabsch 1976) of the displaced points onto the reference.
    """
    whole = clamp & np.isfinite(frame.displacement).all(axis=1)
    before = frame.points[whole]
    if len(before) < LEAST or not in_all_quarters(before):
        return UNKNOWN
    after = before + frame.displacement[whole]
    middle_before, middle_after = before.mean(axis=0), after.mean(axis=0)
    u, _, v = np.linalg.svd((after - middle_after).T @ (before - middle_before))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    shift = middle_after - turn @ middle_before
    rest = after - before @ turn.T - shift
    return RigidMotion(turn, shift, float(np.sqrt((rest**2).sum(axis=1).mean())), len(before))


def without(frame: Frame, motion: RigidMotion) -> Frame:
    """Return the frame as a clamp that did not move would show it."""
    after = frame.points + frame.displacement
    still = (after - motion.shift) @ motion.turn  # the inverse of a rotation is its transpose
    return replace(frame, displacement=still - frame.points)


@dataclass(frozen=True, eq=False)
class ApexShape:
    """A polynomial of x and y about the centre, of several values at once.

    radius : mm, the unit of places. near : (points,) which of those given it was fitted to.
    terms : (near, 15) powers at those points. coefficients : (15, values).
    """

    radius: float
    near: NDArray[np.bool_]
    terms: Array
    coefficients: Array

    def at_centre(self, i: int = 0, j: int = 0) -> Array:
        """Return (values,) differentiated i times by x and j times by y (mm), at the centre."""
        factor = factorial(i) * factorial(j)
        solution = self.coefficients[POWERS.index((i, j))]
        return np.asarray(factor * solution / self.radius ** (i + j))


def apex_shape(points: Array, values: Array, radius: float) -> ApexShape:
    """Fit a polynomial to the finite values (n, k) near the centre; raises InputError for too few.

    points : (n, 2) mm about the centre. radius : of the rim, mm.
    """
    x = points / radius
    near = np.isfinite(values).all(axis=1) & (np.hypot(*x.T) < WITHIN)
    if near.sum() < 2 * len(POWERS):
        problem = f"expected {2 * len(POWERS)} points about the centre, got {int(near.sum())}"
        raise InputError(None, "", problem)
    terms = np.stack([x[near, 0] ** i * x[near, 1] ** j for i, j in POWERS], axis=1)
    solution, *_ = np.linalg.lstsq(terms, values[near], rcond=None)
    return ApexShape(radius, near, terms, solution)
