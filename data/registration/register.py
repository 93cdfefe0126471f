"""Frames of a bubble test brought into the test's coordinates, each step found or given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..frames import Frame
from ..outline import Outline
from .clamp import (
    LEAST,
    UNKNOWN,
    RigidMotion,
    clamp_motion,
    clamp_points,
    without,
)
from .directions import in_all_quarters, line_angle
from .placement import Placement, all_applied, shifted, turned
from .plane import plane_through
from .rim import Rim, rim_of_motion
from .warp import WarpDirection, warp_of_field, warp_of_points, warp_of_rim

Array = NDArray[np.float64]
Point = tuple[float, float, float]
PlaneOf = Literal["found", "clamp", "edge", "camera"]

#: The sheet's edge: points from this share of the rim's radius on.
EDGE = 0.85
#: Frames by which the centre is found: those with at least this share of the largest rise.
HIGH = 0.5


@dataclass(frozen=True)
class RegistrationOptions:
    """What is given of a registration; everything else is found.

    Parameters
    ----------
    plane : of the rim: through points on the "clamp", through the "edge" of the sheet, the
        "camera"'s own x and y, or "found": the clamp where it was seen, else the edge.
    centre : (3,) of the rim in the camera's coordinates, mm.
    rim_angle : degrees, of the first semi-axis of an ellipse from the warp towards the fill.
    warp : degrees from the camera's x to the warp, towards the camera's y where the sheet rises
        towards the camera's z.
    warp_points : two marks along the warp in the camera's coordinates, mm.
    warp_is_stiff : whether the direction strained less is the warp, where it is found.
    remove_clamp_motion : whether the clamp's rigid motion is taken out of every frame.
    """

    plane: PlaneOf = "found"
    centre: Point | None = None
    rim_angle: float | None = None
    warp: float | None = None
    warp_points: tuple[Point, Point] | None = None
    warp_is_stiff: bool = True
    remove_clamp_motion: bool = True

    def __post_init__(self) -> None:
        if self.warp is not None and self.warp_points is not None:
            problem = "expected an angle 'warp' or two points 'warp_points', not both"
            raise InputError(None, "warp", problem)


#: Nothing is given.
ALL_FOUND = RegistrationOptions()


@dataclass(frozen=True, eq=False)
class Registration:
    """What was found, and how.

    Parameters
    ----------
    placement : of the test's coordinates in the camera's.
    plane_of : "clamp", "edge" or "camera". flatness : mm, robust deviation of its points.
    rim : in the plane, x along the warp; its centre is the origin. None where the centre is given.
    warp : None where its direction is given. warp_angle : degrees, as `RegistrationOptions.warp`.
    motions : of the clamp, one a frame, in the test's coordinates.
    options : what was given.
    """

    placement: Placement
    plane_of: str
    flatness: float
    rim: Rim | None
    warp: WarpDirection | None
    warp_angle: float
    motions: tuple[RigidMotion, ...]
    options: RegistrationOptions


def register(
    frames: Sequence[Frame],
    semi_axes: tuple[float, float],
    options: RegistrationOptions = ALL_FOUND,
) -> tuple[tuple[Frame, ...], Registration]:
    """The frames in the test's coordinates, and what they are.

    Parameters
    ----------
    frames : in the camera's coordinates, mm, by rising pressure; the rim must not turn by more
        than rounding between frames, unless the clamp is seen.
    semi_axes : of the rim, mm; equal for a circle, first the one that `rim_angle` belongs to.

    Raises
    ------
    InputError : a step that cannot be found and must be given.
    """
    reference = frames[-1]
    up = _up(reference)
    placement, _ = plane_through(reference.points, up)
    if options.plane == "camera":
        placement = _camera(up)
    placement, rim = _centred(frames, placement, semi_axes, options)
    flatness, plane_of = 0.0, "camera"
    if options.plane != "camera":
        # Which points lie on the clamp, or at the edge, is known once there is a centre.
        angle = _rim_angle(placement, rim, options)
        places = placement.places(reference.points)
        points, plane_of = _rim_points(places, Outline(*semi_axes, angle), options)
        placement, flatness = plane_through(reference.points[points], up)
        placement, rim = _centred(frames, placement, semi_axes, options)
    moved = all_applied(placement, frames)
    motions = _motions(moved, Outline(*semi_axes, _rim_angle(placement, rim, options)))
    if options.remove_clamp_motion:
        moved = tuple(without(f, m) for f, m in zip(moved, motions, strict=True))
    angle, warp = _warp(moved, placement, semi_axes, rim, options)
    turn = turned(angle)
    if rim is not None:
        rest = (rim.angle - angle) % 180.0 if rim.angle else 0.0
        rim = Rim(0.0, 0.0, rest, rim.error, rim.turn_error)
    full = turn.after(placement)
    return all_applied(turn, moved), Registration(
        full, plane_of, flatness, rim, warp, _from_camera_x(full), motions, options
    )


def _up(frame: Frame) -> Array:
    moved = frame.displacement[np.isfinite(frame.displacement).all(axis=1)]
    if not len(moved) or not np.abs(moved).max() > 0:
        raise InputError(frame.path, "", "nothing moves in the frame of the highest pressure")
    return np.asarray(moved.mean(axis=0))


def _camera(up: Array) -> Placement:
    """The camera's axes; turned about x where the sheet rises away from its z."""
    return Placement(np.zeros(3), np.diag([1.0, 1.0, 1.0] if up[2] > 0 else [1.0, -1.0, -1.0]))


def _centred(
    frames: Sequence[Frame],
    placement: Placement,
    semi_axes: tuple[float, float],
    options: RegistrationOptions,
) -> tuple[Placement, Rim | None]:
    """The same plane with its origin in the centre of the rim."""
    if options.centre is not None:
        place = placement.places(np.array(options.centre, dtype=float))
        return shifted(place[0], place[1]).after(placement), None
    surfaces = [_surface(frame) for frame in all_applied(placement, frames)]
    top = surfaces[-1][1].max()
    surfaces = [one for one in surfaces if one[1].max() > HIGH * top]
    points, rise = surfaces[-1]
    weight = np.clip(rise, 0.0, None)
    start = (weight[:, None] * points).sum(axis=0) / weight.sum()
    angle = options.rim_angle
    warp = _given_warp(placement, options)
    if angle is not None and warp is not None:
        angle += warp
    elif semi_axes[0] != semi_axes[1]:
        angle = None
    # The first centre decides which points lie on the disk.
    for _ in range(2):
        rim = rim_of_motion(surfaces, semi_axes, (start[0], start[1]), angle)
        start = np.array([rim.x, rim.y])
    return shifted(rim.x, rim.y).after(placement), rim


def _surface(frame: Frame) -> tuple[Array, Array]:
    """Places (n, 2) and rises (n,) where both were correlated."""
    whole = np.isfinite(frame.points).all(axis=1) & np.isfinite(frame.displacement).all(axis=1)
    return frame.points[whole, :2], frame.displacement[whole, 2]


def _rim_angle(placement: Placement, rim: Rim | None, options: RegistrationOptions) -> float:
    """Degrees from the plane's x to the rim's first semi-axis; without meaning for a circle."""
    if rim is not None:
        return rim.angle
    return (options.rim_angle or 0.0) + (_given_warp(placement, options) or 0.0)


def _rim_points(
    points: Array, outline: Outline, options: RegistrationOptions
) -> tuple[NDArray[np.bool_], str]:
    beyond = clamp_points(points, outline)
    seen = beyond.sum() >= LEAST and in_all_quarters(points[beyond])
    if options.plane == "clamp" and not seen:
        problem = "too few points beyond the rim to lay a plane through the clamp; choose 'edge'"
        raise InputError(None, "plane", problem)
    if seen and options.plane != "edge":
        return beyond, "clamp"
    return (outline.share(points[:, :2]) > EDGE) & ~beyond, "edge"


def _motions(frames: Sequence[Frame], outline: Outline) -> tuple[RigidMotion, ...]:
    found = []
    for frame in frames:
        clamp = clamp_points(frame.points, outline)
        found.append(clamp_motion(frame, clamp) if clamp.any() else UNKNOWN)
    return tuple(found)


def _given_warp(placement: Placement, options: RegistrationOptions) -> float | None:
    """Degrees from the plane's x to the warp, where it is given."""
    if options.warp_points is not None:
        first, second = placement.places(np.array(options.warp_points, dtype=float))[:, :2]
        return warp_of_points(first, second)
    return options.warp


def _warp(
    frames: Sequence[Frame],
    placement: Placement,
    semi_axes: tuple[float, float],
    rim: Rim | None,
    options: RegistrationOptions,
) -> tuple[float, WarpDirection | None]:
    """Degrees from the plane's x to the warp."""
    given = _given_warp(placement, options)
    if given is not None:
        return given, None
    if semi_axes[0] == semi_axes[1] or options.rim_angle is None:
        found = warp_of_field(frames, min(semi_axes), options.warp_is_stiff)
    elif rim is None:
        problem = "expected the warp, too, where the centre of an elliptic rim is given"
        raise InputError(None, "warp", problem)
    else:
        found = warp_of_rim(frames, min(semi_axes), rim, options.rim_angle)
    return found.angle, found


def _from_camera_x(placement: Placement) -> float:
    """Degrees from the camera's x, laid into the plane, to the test's x."""
    x = placement.axes @ np.array([1.0, 0.0, 0.0])
    return line_angle(-float(np.degrees(np.arctan2(x[1], x[0]))))
