"""Centre (and turn) of the rim from the motion of the sheet: where it does not rise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ...errors import InputError

Array = NDArray[np.float64]

#: Even powers (of u, of v) of a shape beside the factor that vanishes at the rim.
EVEN = ((0, 0), (2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
ODD = ((1, 0), (0, 1), (3, 0), (2, 1), (1, 2), (0, 3))
#: Points and frames enough to tell a centre; of more, every so many.
POINTS, FRAMES = 2000, 4
#: Points nearer to the rim than this share of its radius say where it is.
NEAR = 0.8
#: Points up to this share of the radius from a first guess of the centre are taken.
INSIDE = 1.02


@dataclass(frozen=True)
class Rim:
    """The clamped edge in the plane of the sheet.

    x, y : centre, mm. angle : of the first semi-axis from x towards y, degrees (0 for a circle).
    error : standard error of the centre, mm, from the scatter about the shape. turn_error : of an
    angle that was found, degrees; 0 where it was not looked for.
    """

    x: float
    y: float
    angle: float
    error: float
    turn_error: float = 0.0


def rim_of_motion(
    surfaces: Sequence[tuple[Array, Array]],
    semi_axes: tuple[float, float],
    start: tuple[float, float] = (0.0, 0.0),
    angle: float | None = None,
) -> Rim:
    """The rim of known size through which the sheet does not rise.

    The rise of every frame is a polynomial of even and odd terms times a factor that is zero on
    the rim, all about the centre that is looked for, and one constant (the frame's shift along
    z). Odd terms take what the sheet is not symmetric in: they cannot move the rim.

    Parameters
    ----------
    surfaces : reference places (n, 2) mm in the plane and rises (n,) mm along its normal, by rising
        pressure: the last few are taken.
    semi_axes : mm; equal for a circle. start : mm, about where the centre is.
    angle : degrees, of the first semi-axis; found unless given where the axes differ.

    Raises
    ------
    InputError : points that do not come near the rim all around it, too few of them.
    """
    free = semi_axes[0] != semi_axes[1] and angle is None
    fixed = 0.0 if angle is None else angle
    guess = np.array([*start, _long_axis(*surfaces[-1], semi_axes) if free else fixed])
    few = [_on_disk(*one, guess, semi_axes) for one in surfaces[-FRAMES:]]

    def left(place: Array) -> Array:
        at = place if free else np.array([*place, fixed])
        parts = []
        for points, rise in few:
            orthogonal, _ = np.linalg.qr(_terms(*_local(points, at, semi_axes)))
            parts.append(rise - orthogonal @ (orthogonal.T @ rise))
        return np.concatenate(parts)

    count = 3 if free else 2
    scale = [semi_axes[0], semi_axes[0], 60.0][:count]
    best = least_squares(left, guess[:count], x_scale=scale)
    variance = 2 * best.cost / max(len(best.fun) - len(best.x), 1)
    covariance = variance * np.linalg.pinv(best.jac.T @ best.jac)
    error = float(np.sqrt(np.trace(covariance[:2, :2])))
    turn = float(best.x[2]) % 180.0 if free else fixed
    turn_error = float(np.sqrt(covariance[2, 2])) if free else 0.0
    return Rim(float(best.x[0]), float(best.x[1]), turn, error, turn_error)


def _long_axis(points: Array, rise: Array, semi_axes: tuple[float, float]) -> float:
    """About the turn of the first semi-axis, degrees: the rise spreads along the longer one."""
    weight = np.clip(rise, 0.0, None)
    x, y = (points - (weight[:, None] * points).sum(axis=0) / weight.sum()).T
    xx, yy, xy = (float((weight * a).sum()) for a in (x * x, y * y, x * y))
    along = np.degrees(0.5 * np.arctan2(2 * xy, xx - yy))
    return float(along if semi_axes[0] > semi_axes[1] else along + 90.0)


def _local(points: Array, place: Array, semi_axes: tuple[float, float]) -> Array:
    """Coordinates (2, n) about a centre x, y and along axes turned by degrees: 1 on the rim."""
    turn = np.radians(place[2])
    c, s = np.cos(turn), np.sin(turn)
    x, y = (points - place[:2]).T
    return np.stack([(c * x + s * y) / semi_axes[0], (c * y - s * x) / semi_axes[1]])


def _on_disk(
    points: Array, rise: Array, place: Array, semi_axes: tuple[float, float]
) -> tuple[Array, Array]:
    """Some of the points within the rim, and their rises over the largest of them."""
    local = _local(points, place, semi_axes)
    inside = np.hypot(*local) < INSIDE
    least = 3 * (len(EVEN) + len(ODD) + 1)
    if inside.sum() < least:
        problem = f"expected at least {least} points on the disk, got {int(inside.sum())}"
        raise InputError(None, "centre", f"{problem}; are the length unit and the radius right?")
    _all_around(local[:, inside])
    every = slice(None, None, -(-int(inside.sum()) // POINTS))
    rise = rise[inside][every]
    return points[inside][every], rise / np.abs(rise).max()


def _terms(u: Array, v: Array) -> Array:
    factor = 1.0 - u**2 - v**2
    shapes = [factor * u**i * v**j for i, j in (*EVEN, *ODD)]
    return np.stack([*shapes, np.ones_like(u)], axis=1)


def _all_around(local: Array) -> None:
    """Whether points come near the rim in each of eight directions."""
    near = np.hypot(*local) > NEAR
    around = np.unique((np.arctan2(local[1, near], local[0, near]) // (np.pi / 4)).astype(int))
    if len(around) < 8:
        problem = f"points come within {1 - NEAR:.0%} of the rim in {len(around)} of 8 directions"
        raise InputError(None, "centre", f"{problem} only; give the centre")
