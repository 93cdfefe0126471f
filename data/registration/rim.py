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


@dataclass(frozen=True)
class Rim:
    """The clamped edge in the plane of the sheet.

    x, y : centre, mm. angle : of the first semi-axis from x towards y, degrees (0 for a circle).
    error : standard error of the centre, mm, from the scatter about the shape.
    """

    x: float
    y: float
    angle: float
    error: float


def rim_of_motion(
    points: Array,
    rises: Sequence[Array],
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
    points : (n, 2) mm, reference places in the plane. rises : (n,) mm each, along its normal;
        by rising pressure: the last few are taken.
    semi_axes : mm; equal for a circle. start : mm, about where the centre is.
    angle : degrees, of the first semi-axis; found unless given where the axes differ.

    Raises
    ------
    InputError : points that do not come near the rim all around it, too few of them.
    """
    circle = semi_axes[0] == semi_axes[1]
    free = not circle and angle is None

    def local(place: Array, of: Array = points) -> Array:
        turn = np.radians(place[2] if free else (angle or 0.0))
        c, s = np.cos(turn), np.sin(turn)
        x, y = (of - place[:2]).T
        return np.stack([(c * x + s * y) / semi_axes[0], (c * y - s * x) / semi_axes[1]])

    inside = np.hypot(*local(np.array([*start, angle or 0.0]))) < 1.0 + 0.02
    on_disk = points[inside]
    count = len(EVEN) + len(ODD) + 1
    if len(on_disk) < 3 * count:
        problem = f"expected at least {3 * count} points on the disk, got {len(on_disk)}"
        raise InputError(None, "centre", f"{problem}; are the length unit and the radius right?")
    _all_around(local(np.array([*start, angle or 0.0]), on_disk))
    few = slice(None, None, -(-len(on_disk) // POINTS))
    on_disk = on_disk[few]
    data = np.stack([rise[inside][few] for rise in rises[-FRAMES:]], axis=1)
    data = data / np.abs(data).max(axis=0)

    def left(place: Array) -> Array:
        terms = _terms(*local(place, on_disk))
        orthogonal, _ = np.linalg.qr(terms)
        return np.asarray((data - orthogonal @ (orthogonal.T @ data)).ravel())

    guesses: list[Array] = [np.array(start, dtype=float)]
    if free:
        guesses = [np.array([*start, turn]) for turn in (0.0, 45.0, 90.0, 135.0)]
    scale = [semi_axes[0], semi_axes[0], 60.0][: 3 if free else 2]
    fits = [least_squares(left, guess, x_scale=scale) for guess in guesses]
    best = min(fits, key=lambda fit: fit.cost)
    variance = 2 * best.cost / max(data.size - len(best.x), 1)
    covariance = variance * np.linalg.pinv(best.jac.T @ best.jac)
    error = float(np.sqrt(np.trace(covariance[:2, :2])))
    turn = float(best.x[2]) % 180.0 if free else (angle or 0.0)
    return Rim(float(best.x[0]), float(best.x[1]), turn, error)


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
