"""The warp direction from the measured field: which of its axes of symmetry is stiffer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..apex_shape import apex_shape
from ..frames import Frame
from .directions import line_angle
from .rim import Rim
from .symmetry import symmetry_axes

Array = NDArray[np.float64]

#: Standard error of the axes (degrees) above which the field does not tell them, and how clear
#: they must be at least.
UNSURE, CLEAR = 5.0, 0.5


@dataclass(frozen=True)
class WarpDirection:
    """Where the warp lies, by the fields of all frames.

    angle : degrees from x towards y, from -90 to 90. error : standard error of their mean, degrees.
    clear : of the axes, see `symmetry.Axes`; None where an elliptic rim told the angle.
    strains : Green-Lagrange at the centre in the highest frame less those of the lowest, warp and
    fill.
    """

    angle: float
    error: float
    clear: float | None
    strains: tuple[float, float]


def warp_of_field(
    frames: Sequence[Frame], radius: float, warp_is_stiff: bool = True
) -> WarpDirection:
    """The axis of symmetry along which the centre is strained less (warp stiff), or more.

    Parameters
    ----------
    frames : in coordinates about the rim's centre, in its plane; by rising pressure.
    warp_is_stiff : whether the warp is the direction that is strained less.

    Raises
    ------
    InputError : too few points about the centre, or a field whose axes cannot be told.
    """
    axes = symmetry_axes(frames, radius)
    if axes.error > UNSURE or axes.clear < CLEAR:
        problem = (
            f"the field does not tell warp from fill (axes at {axes.angle:.0f} +- {axes.error:.1f}"
            f" degrees, {axes.clear:.0%} clear); give the angle"
        )
        raise InputError(None, "warp", problem)
    angle = axes.angle
    along, across = _strains(frames, radius, angle)
    if (along > across) == warp_is_stiff:
        angle, along, across = angle + 90.0, across, along
    return WarpDirection(line_angle(angle), axes.error, axes.clear, (along, across))


def warp_of_rim(
    frames: Sequence[Frame], radius: float, rim: Rim, rim_angle: float
) -> WarpDirection:
    """The warp by the turn of an elliptic rim, whose first semi-axis lies at `rim_angle` from it.

    A sheet whose edge is an ellipse turned to the yarns has no axes of symmetry.

    Parameters
    ----------
    frames : as for `warp_of_field`. rim : found. rim_angle : degrees from warp towards fill.

    Raises
    ------
    InputError : an ellipse too round to tell its turn.
    """
    if rim.turn_error > UNSURE:
        problem = (
            f"the rim is too round to tell the warp (turned by {rim.angle:.0f} +- "
            f"{rim.turn_error:.0f} degrees); give the angle"
        )
        raise InputError(None, "warp", problem)
    angle = line_angle(rim.angle - rim_angle)
    return WarpDirection(angle, rim.turn_error, None, _strains(frames, radius, angle))


def _strains(frames: Sequence[Frame], radius: float, angle: float) -> tuple[float, float]:
    """At the centre along an axis at `angle` degrees and across it."""
    strain = centre_strain(frames[-1], radius)
    if len(frames) > 1:
        strain = strain - centre_strain(frames[0], radius)
    turn = np.radians(angle)
    first, second = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    return float(first @ strain @ first), float(second @ strain @ second)


def centre_strain(frame: Frame, radius: float) -> Array:
    """Green-Lagrange strain (2, 2) of the surface at the centre.

    Raises
    ------
    InputError : too few points about the centre.
    """
    try:
        shape = apex_shape(frame.points[:, :2], frame.displacement, radius)
    except InputError as error:
        raise InputError(None, "warp", error.problem) from None
    tangents = np.eye(3)[:2] + np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    return np.asarray(0.5 * (tangents @ tangents.T - np.eye(2)))


def warp_of_points(first: Array, second: Array) -> float:
    """Angle (degrees, -90 to 90) of the line through two marked points (2,) in the plane.

    Raises
    ------
    InputError : the points are the same.
    """
    x, y = np.asarray(second, dtype=float) - np.asarray(first, dtype=float)
    if np.hypot(x, y) < 1e-9:
        raise InputError(None, "warp", "expected two different points along the warp")
    return line_angle(float(np.degrees(np.arctan2(y, x))))
