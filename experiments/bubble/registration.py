"""Registration: transforms images of a bubble test from the camera's to the test's coordinates.

The test's coordinates have their origin at the centre of the rim, x along the warp, y along the
fill, and z normal to the sheet, in the direction in which it rises. Each step is found from the
measured fields unless it is given: the plane of the sheet (`placement`), the centre of the rim in
this plane (`rim`), the rigid motion of the clamp, which is removed, and the warp, which is an axis
of symmetry of the fields (`symmetry`). A "frame" is one image, never a coordinate system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...light_dataclasses import dataclass
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...readers.frames import Frame
from ...solvers.base import Array
from .field_shape import Axes, centre_strain, symmetry_axes
from .placement import (
    CLAMP_BEGINS,
    MIN_CLAMP_POINTS,
    Placement,
    RigidMotion,
    Rim,
    RiseSurface,
    SemiAxes,
    clamp_motion,
    clamp_of_motion,
    correlated_points,
    in_all_quarters,
    line_angle,
    plane_through,
    rim_of_motion,
    rotation_about_z,
    without_motion,
)

Point = tuple[float, float, float]
PlaneOf = Literal["found", "clamp", "edge", "camera"]


@dataclass(frozen=True)
class RegistrationLimits:
    """Which images and points determine the test's coordinates, and how sure its axes must be."""

    edge_begins: float = 0.85  # share of the rim's radius beyond which points are the sheet's edge
    high_share: float = 0.5  # images that rise by more than this share of the largest are used
    max_error: float = 5.0  # degrees, largest standard error of usable axes of symmetry
    min_clarity: float = 0.5  # smallest `Axes.clarity` of usable axes of symmetry


LIMITS = RegistrationLimits()


def are_usable(axes: Axes) -> bool:
    """Return whether axes of symmetry are sure and clear enough to determine the warp."""
    return axes.error <= LIMITS.max_error and axes.clarity >= LIMITS.min_clarity


@dataclass(frozen=True)
class WarpDirection:
    """The direction of the warp as it was found from the measured fields.

    Attributes
    ----------
    angle : float, degrees
        Angle in the plane of the sheet from x (before the registration's last turn) towards y,
        -90 to 90.
    error : float, degrees
        Standard error of the angle.
    clarity : float or None
        `Axes.clarity` of the symmetry by which the warp was found; None where it was found by the
        turn of an elliptic rim.
    """

    angle: float
    error: float
    clarity: float | None


@dataclass(frozen=True)
class RegistrationOptions:
    """The steps of a registration that a user gives; those that are None are found.

    Attributes
    ----------
    plane : {"found", "clamp", "edge", "camera"}
        How the x-y plane is laid: "clamp" through points on the clamp, "edge" through the edge of
        the sheet, "camera" takes the camera's own x-y plane; "found" takes the clamp where it was
        measured, else the edge.
    centre : (3,) tuple, mm, or None
        Centre of the rim in the camera's coordinates, for `register_fields` in those of the files.
    rim_angle : float, degrees, or None
        Angle of the first semi-axis of an elliptic rim, from the warp towards the fill.
    warp : float, degrees, or None
        Angle of the warp from the camera's x axis, positive towards its y axis where the sheet
        rises towards the camera's z, away from it otherwise.
    warp_points : two (3,) tuples, mm, or None
        Two marks on a line along the warp, in the coordinates of the centre.
    warp_is_stiff : bool
        Whether, of the two axes of symmetry that are found, the one that is strained less is the
        warp (otherwise it is the fill).
    remove_clamp_motion : bool
        Whether the rigid motion of the clamp is taken out of the displacements.

    Raises
    ------
    InputError
        The warp is given twice, by an angle and by marks.
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
            raise InputError(None, "warp_points", problem)

    def turned_over(self) -> RegistrationOptions:
        """Return the options for fields whose y and z, unlike those of the marks, are reversed."""

        def reversed_point(point: Point) -> Point:
            x, y, z = point
            return x, -y, -z

        centre = None if self.centre is None else reversed_point(self.centre)
        if self.warp_points is None:
            return replace(self, centre=centre)
        first, second = map(reversed_point, self.warp_points)
        return replace(self, centre=centre, warp_points=(first, second))


ALL_FOUND = RegistrationOptions()


@dataclass(frozen=True, eq=False)
class CameraRegistration:
    """The result of a registration, and how each step came about.

    Attributes
    ----------
    placement : Placement
        The test's coordinate system, given in the camera's.
    plane_of : str
        What the x-y plane was laid through: "clamp", "edge" or "camera" (its own plane).
    flatness : float, mm
        Robust standard deviation of the fitted points from the plane, 0 for the camera's plane.
    rim : Rim or None
        The rim that was found, in the test's coordinates; None where its centre is given.
    warp : WarpDirection or None
        The warp that was found; None where it is given.
    warp_angle : float, degrees
        Angle of the warp, found or given, in the sense of `RegistrationOptions.warp`.
    motions : tuple of RigidMotion
        Motion of the clamp in each image, in coordinates about the centre before the last turn,
        which lays x along the warp.
    options : RegistrationOptions
        What was given.
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
    frames: Sequence[Frame], semi_axes: SemiAxes, options: RegistrationOptions = ALL_FOUND
) -> tuple[tuple[Frame, ...], CameraRegistration]:
    """Transform images of a bubble test from the camera's to the test's coordinates.

    Parameters
    ----------
    frames : sequence of Frame
        Images in the camera's coordinates, by rising pressure. Unless points on the clamp were
        measured, the rim must not turn between them.
    semi_axes : (float, float), mm
        Semi-axes of the rim; `options.rim_angle` is the angle of the first. Equal for a circle.
    options : RegistrationOptions

    Returns
    -------
    frames : tuple of Frame
        The images in the test's coordinates, without the motion of the clamp if it is removed.
    registration : CameraRegistration

    Raises
    ------
    InputError
        Nothing moves in the last image, or a step cannot be found and must be given.
    """
    highest = frames[-1]
    up = _rising_direction(highest)
    # A first plane, through all points, is enough to find the centre.
    placement, _ = plane_through(highest.points, up)
    if options.plane == "camera":
        # The camera's axes; turned about x where the sheet rises away from its z.
        signs = [1.0, 1.0, 1.0] if up[2] > 0 else [1.0, -1.0, -1.0]
        placement = Placement(np.zeros(3), np.diag(signs))
    placement, rim = _centred(frames, placement, semi_axes, options)
    flatness = 0.0
    plane_of = "camera"
    if options.plane != "camera":
        # Which points lie on the clamp, or at the edge, is known once there is a centre.
        outline = Outline(*semi_axes, _rim_angle(placement, rim, options))
        positions = placement.coordinates(highest.points)
        is_on_plane, plane_of = _plane_points(positions, outline, options)
        placement, flatness = plane_through(highest.points[is_on_plane], up)
        placement, rim = _centred(frames, placement, semi_axes, options)
    outline = Outline(*semi_axes, _rim_angle(placement, rim, options))
    centred_frames, motions = _without_clamp_motion(placement.transformed(frames), outline, options)
    angle, warp = _warp_direction(centred_frames, placement, semi_axes, rim, options)
    turn = rotation_about_z(angle)
    if rim is not None:
        rim_angle = (rim.angle - angle) % 180.0 if rim.angle else 0.0
        rim = replace(rim, x=0.0, y=0.0, angle=rim_angle)
    placement = turn.composed_with(placement)
    x_of_camera = np.arctan2(placement.axes[1, 0], placement.axes[0, 0])
    registration = CameraRegistration(
        placement=placement,
        plane_of=plane_of,
        flatness=flatness,
        rim=rim,
        warp=warp,
        warp_angle=line_angle(-float(np.degrees(x_of_camera))),
        motions=motions,
        options=options,
    )
    return turn.transformed(centred_frames), registration


def _rising_direction(frame: Frame) -> Array:
    """Return the mean displacement (3,) of an image, mm; raise InputError if nothing moves."""
    moving = frame.displacement[np.isfinite(frame.displacement).all(axis=1)]
    if not len(moving) or not np.abs(moving).max() > 0:
        raise InputError(frame.path, "", "nothing moves in the frame of the highest pressure")
    return moving.mean(axis=0)


def _without_clamp_motion(
    frames: tuple[Frame, ...], outline: Outline, options: RegistrationOptions
) -> tuple[tuple[Frame, ...], tuple[RigidMotion, ...]]:
    """Return images without the clamp's motion (with it, if options keep it), and the motions.

    `frames` have the centre of the rim as origin, `outline` is the rim in these coordinates.
    """
    motions = tuple(
        clamp_motion(frame, outline.share(frame.points[:, :2]) > CLAMP_BEGINS) for frame in frames
    )
    if not options.remove_clamp_motion:
        return frames, motions
    still_frames = tuple(
        without_motion(frame, motion) for frame, motion in zip(frames, motions, strict=True)
    )
    return still_frames, motions


def _centred(
    frames: Sequence[Frame],
    placement: Placement,
    semi_axes: SemiAxes,
    options: RegistrationOptions,
) -> tuple[Placement, Rim | None]:
    """Return a placement with its origin moved in its plane to the centre of the rim, and the rim.

    The rim (None where the centre is given) is in the coordinates of the given placement.
    """
    if options.centre is not None:
        centre = placement.coordinates(np.array(options.centre, dtype=float))
        return _moved_in_plane(placement, centre[0], centre[1]), None
    correlated = map(correlated_points, placement.transformed(frames))
    surfaces = _high_surfaces(
        [(positions[:, :2], displacement[:, 2]) for positions, displacement in correlated]
    )
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
    # `rim_of_motion` expects a negative rise just beyond the rim: points of the clamp, which stand
    # still there, bias its centre. The edge of the clamp, where it is found, is the better rim.
    about_centre = [(points - start, rise) for points, rise in surfaces]
    edge = clamp_of_motion(about_centre, semi_axes, rim.angle)
    if edge is not None:
        rim = replace(rim, x=rim.x + edge.x, y=rim.y + edge.y, error=edge.error)
    return _moved_in_plane(placement, rim.x, rim.y), rim


def _moved_in_plane(placement: Placement, x: float, y: float) -> Placement:
    """Return a placement with its origin moved to x, y (mm, its own coordinates) in its plane."""
    in_plane = Placement(np.array([x, y, 0.0]), np.eye(3))
    return in_plane.composed_with(placement)


def _high_surfaces(surfaces: Sequence[RiseSurface]) -> list[RiseSurface]:
    """Return the surfaces, rises in mm over positions, that rise most (`high_share`)."""
    highest = max(float(rise.max()) for _, rise in surfaces)
    return [surface for surface in surfaces if surface[1].max() > LIMITS.high_share * highest]


def _rim_angle(placement: Placement, rim: Rim | None, options: RegistrationOptions) -> float:
    """Return the angle (degrees) from the plane's x to the first semi-axis of the rim.

    It means nothing for a circle.
    """
    if rim is not None:
        return rim.angle
    return (options.rim_angle or 0.0) + (_given_warp(placement, options) or 0.0)


def _plane_points(
    points: Array, outline: Outline, options: RegistrationOptions
) -> tuple[NDArray[np.bool_], str]:
    """Return which points (n, 3), mm, the plane is laid through, and their name "clamp" or "edge".

    The points have the centre of the rim as origin. Raise InputError where the clamp is asked for
    and too few points lie on it.
    """
    share = outline.share(points[:, :2])
    is_on_clamp = share > CLAMP_BEGINS
    is_clamp_visible = is_on_clamp.sum() >= MIN_CLAMP_POINTS
    is_clamp_visible = is_clamp_visible and in_all_quarters(points[is_on_clamp])
    if options.plane == "clamp" and not is_clamp_visible:
        problem = "too few points beyond the rim to lay a plane through the clamp; choose 'edge'"
        raise InputError(None, "plane", problem)
    if is_clamp_visible and options.plane != "edge":
        return is_on_clamp, "clamp"
    return (share > LIMITS.edge_begins) & ~is_on_clamp, "edge"


def _given_warp(placement: Placement, options: RegistrationOptions) -> float | None:
    """Return the given angle (degrees) from the plane's x to the warp; None where none is given."""
    if options.warp_points is None:
        return options.warp
    marks = placement.coordinates(np.array(options.warp_points, dtype=float))
    x, y = (marks[1] - marks[0])[:2]
    if np.hypot(x, y) < 1e-9:
        raise InputError(None, "warp_points", "expected two different points along the warp")
    return line_angle(float(np.degrees(np.arctan2(y, x))))


def _warp_direction(
    frames: Sequence[Frame],
    placement: Placement,
    semi_axes: SemiAxes,
    rim: Rim | None,
    options: RegistrationOptions,
) -> tuple[float, WarpDirection | None]:
    """Return the angle (degrees) from the plane's x to the warp, and how it was found.

    The second is None where the warp is given. `frames` have the centre of the rim as origin.
    """
    angle = _given_warp(placement, options)
    if angle is not None:
        return angle, None
    if semi_axes[0] == semi_axes[1] or options.rim_angle is None:
        warp = _warp_by_symmetry(frames, min(semi_axes), options.warp_is_stiff)
    else:
        warp = _warp_by_rim(rim, options.rim_angle)
    return warp.angle, warp


def _warp_by_symmetry(frames: Sequence[Frame], radius: float, warp_is_stiff: bool) -> WarpDirection:
    """Return the warp as the axis of symmetry along which the centre is strained less.

    It is the one that is strained more where `warp_is_stiff` is false. `radius` of the rim in mm.
    """
    axes = symmetry_axes(frames, radius)
    if not are_usable(axes):
        problem = (
            f"the field does not tell warp from fill (axes at {axes.angle:.0f} +- "
            f"{axes.error:.1f} degrees, {axes.clarity:.0%} clear); give the angle"
        )
        raise InputError(None, "warp", problem)
    strain = centre_strain(frames[-1], radius)
    if len(frames) > 1:
        strain = strain - centre_strain(frames[0], radius)
    x_axis, y_axis = rotation_about_z(axes.angle).axes[:2, :2]
    is_x_strained_more = float(x_axis @ strain @ x_axis) > float(y_axis @ strain @ y_axis)
    is_warp_y = is_x_strained_more == warp_is_stiff
    angle = line_angle(axes.angle + 90.0 * is_warp_y)
    return WarpDirection(angle, axes.error, axes.clarity)


def _warp_by_rim(rim: Rim | None, rim_angle: float) -> WarpDirection:
    """Return the warp by the turn of an elliptic rim in the plane.

    `rim_angle` is the known angle (degrees) of the rim's first semi-axis from the warp.
    """
    if rim is None:
        problem = "expected the warp, too, where the centre of an elliptic rim is given"
        raise InputError(None, "warp", problem)
    if rim.turn_error > LIMITS.max_error:
        problem = (
            f"the rim is too round to tell the warp (turned by {rim.angle:.0f} +- "
            f"{rim.turn_error:.0f} degrees); give the angle"
        )
        raise InputError(None, "warp", problem)
    return WarpDirection(line_angle(rim.angle - rim_angle), rim.turn_error, None)


def register_fields(
    fields: Sequence[DisplacementField], outline: Outline, options: RegistrationOptions = ALL_FOUND
) -> tuple[tuple[DisplacementField, ...], CameraRegistration]:
    """Transform displacement fields to the test's coordinates, as `register` does images.

    Parameters
    ----------
    fields : sequence of DisplacementField
        Fields in the camera's coordinates, by rising pressure. Without measured heights z the
        plane is the camera's.
    outline : Outline
        The rim; an ellipse has its angle measured from the warp.
    options : RegistrationOptions

    Returns
    -------
    registered : tuple of DisplacementField
    registration : CameraRegistration

    Raises
    ------
    InputError
        `register` raises it, or a plane through the clamp or the edge is asked for and the fields
        have no heights.
    """
    if fields[0].source.is_turned_over:
        options = options.turned_over()
    has_heights = all(field.z is not None for field in fields)
    if not has_heights:
        if options.plane not in ("found", "camera"):
            problem = "the files have no height z of the reference state to lay a plane through"
            raise InputError(None, "plane", problem)
        options = replace(options, plane="camera")
    if not outline.round:
        options = replace(options, rim_angle=outline.angle)
    semi_axes = outline.major, outline.minor
    frames, registration = register([field.frame for field in fields], semi_axes, options)
    registered = tuple(
        replace(
            field,
            points=frame.points[:, :2],
            z=frame.points[:, 2] if has_heights else None,
            displacement=frame.displacement,
        )
        for field, frame in zip(fields, frames, strict=True)
    )
    return registered, registration


def clamp_radius(
    fields: Sequence[DisplacementField],
    options: RegistrationOptions | None = None,
    *,
    rounds: int = 8,
    tolerance: float = 1e-4,
) -> tuple[float, Rim]:
    """Find the radius of the clamp: of the circle beyond which the measured points stand still.

    Parameters
    ----------
    fields : sequence of DisplacementField
        Fields in any order, as several inflations and releases have them.
    options : RegistrationOptions or None
        How the fields are registered; None where they are in the test's coordinates.
    rounds : int
        Largest number of iterations of the search.
    tolerance : float
        The search ends where the radius changes by less than this share of it.

    Returns
    -------
    radius : float, mm
    edge : Rim
        The edge of the clamp that was found in the last iteration, with its standard error.

    Raises
    ------
    InputError
        Too few points around the disk stand still.
    """
    rising = sorted(fields, key=lambda field: field.pressure)
    points, displacement = correlated_points(rising[-1].frame)
    weight = np.linalg.norm(displacement, axis=1)
    from_centre = points - weight @ points / weight.sum()
    # First guess: for a paraboloid on a disk of radius R the mean square distance from the centre,
    # weighted by the rise, is R^2 / 3.
    weighted_square = (weight @ from_centre**2).sum()
    radius = float(np.sqrt(3.0 * weighted_square / weight.sum()))
    for _ in range(rounds):
        registered: Sequence[DisplacementField] = rising
        if options is not None:
            registered, _ = register_fields(rising, Outline.circle(radius), options)
        surfaces = [(field.points, field.displacement[:, 2]) for field in registered]
        edge = clamp_of_motion(_high_surfaces(surfaces), (radius, radius))
        if edge is None:
            break
        radius *= edge.scale
        if abs(edge.scale - 1.0) < tolerance:
            return radius, edge
    problem = "no points of a clamp stand still around the disk; give the radius"
    raise InputError(None, "radius", problem)
