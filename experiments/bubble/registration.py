"""Frames of a bubble test brought into the test's coordinates, each step found or given.

`Placement` moves frames, `plane_through` and `clamp_motion` find where the rim lies, `apex_shape`
is the polynomial about the centre. The rim is where the sheet does not rise (`rim_of_motion`). A
disk of orthotropic fabric moves symmetrically about warp and fill: in polar components u_r and u_z
have only cosines of the angle from the warp, u_theta only sines (`symmetry_axes`). The sheet's
first shape adds much the same at every pressure: two frames are subtracted. `register` puts plane,
centre, clamp motion and warp together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import factorial
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...readers.frames import Frame

Array = NDArray[np.float64]
Point = tuple[float, float, float]
PlaneOf = Literal["found", "clamp", "edge", "camera"]
#: Points further from the plane than this many robust deviations do not count.
FAR = 4.0
#: Rounds of a search, of points of a plane and of a circle.
ROUNDS = 8
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
    """A right-handed frame in the camera's: `origin` (3,) mm, unit `axes` (3, 3), rows x, y, z."""

    origin: Array
    axes: Array

    def places(self, points: Array) -> Array:
        """Return points (..., 3) of the camera's frame in the test's."""
        return np.asarray((points - self.origin) @ self.axes.T)

    def applied(self, frames: Sequence[Frame]) -> tuple[Frame, ...]:
        """Return the frames in the test's coordinates."""
        moved = [np.asarray(frame.displacement @ self.axes.T) for frame in frames]
        every = zip(frames, moved, strict=True)
        return tuple(replace(f, points=self.places(f.points), displacement=u) for f, u in every)

    def after(self, first: Placement) -> Placement:
        """Return the one placement that is `first` and then this."""
        return Placement(first.origin + self.origin @ first.axes, self.axes @ first.axes)

    @property
    def tilt(self) -> float:
        """Return the angle between the two z axes, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.axes[2, 2], -1.0, 1.0))))


def turned(angle: float) -> Placement:
    """Return the same plane and origin, x turned by `angle` degrees from x towards y."""
    c = np.cos(np.radians(angle))
    s = np.sin(np.radians(angle))
    return Placement(np.zeros(3), np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def plane_through(points: Array, up: Array) -> tuple[Placement, float]:
    """Fit a plane through points (n, 3); return it and their robust deviation from it in mm.
    Its origin is the mean of the points that count, its z the normal on the side of `up` (3,), its
    x the camera's x laid into the plane. Raises InputError for points on a line."""
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


def in_all_quarters(points: NDArray[np.float64]) -> bool:
    """Return whether points (n, 2 or 3) about the centre lie in all four quarters of its plane."""
    return len(np.unique(points[:, :2] > 0, axis=0)) == 4


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A motion of a rigid body: place -> turn @ place + shift, mm, by so many points."""

    turn: Array
    shift: Array
    points: int

    @property
    def angle(self) -> float:
        """Return the angle of the turn, degrees."""
        return float(np.degrees(np.arccos(np.clip((np.trace(self.turn) - 1) / 2, -1.0, 1.0))))


UNKNOWN = RigidMotion(np.eye(3), np.zeros(3), 0)


def clamp_motion(frame: Frame, clamp: NDArray[np.bool_]) -> RigidMotion:
    """Return the rigid motion of the clamp (Kabsch 1976); `UNKNOWN` of too few points around it."""
    whole = clamp & np.isfinite(frame.displacement).all(axis=1)
    before = frame.points[whole]
    if len(before) < LEAST or not in_all_quarters(before):
        return UNKNOWN
    after = before + frame.displacement[whole]
    middle_before = before.mean(axis=0)
    middle_after = after.mean(axis=0)
    u, _, v = np.linalg.svd((after - middle_after).T @ (before - middle_before))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return RigidMotion(turn, middle_after - turn @ middle_before, len(before))


def without(frame: Frame, motion: RigidMotion) -> Frame:
    """Return the frame as a clamp that did not move would show it."""
    after = frame.points + frame.displacement
    still = (after - motion.shift) @ motion.turn  # the inverse of a rotation is its transpose
    return replace(frame, displacement=still - frame.points)


@dataclass(frozen=True, eq=False)
class ApexShape:
    """A polynomial of x and y in radii (mm) about the centre, coefficients (15, values).
    near : (points,) which of those given it was fitted to. terms : (near, 15) at those points."""

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
    """Fit a polynomial to finite values (n, k) at points (n, 2) mm near the rim's centre.
    Raises InputError for too few."""
    x = points / radius
    near = np.isfinite(values).all(axis=1) & (np.hypot(*x.T) < WITHIN)
    if near.sum() < 2 * len(POWERS):
        problem = f"expected {2 * len(POWERS)} points about the centre, got {int(near.sum())}"
        raise InputError(None, "", problem)
    terms = np.stack([x[near, 0] ** i * x[near, 1] ** j for i, j in POWERS], axis=1)
    solution, *_ = np.linalg.lstsq(terms, values[near], rcond=None)
    return ApexShape(radius, near, terms, solution)


#: Even and odd powers (of u, of v) of a shape beside the factor that vanishes at the rim.
EVEN = ((0, 0), (2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
ODD = ((1, 0), (0, 1), (3, 0), (2, 1), (1, 2), (0, 3))
#: Points and frames that are enough for a centre; of more points, every so many.
POINTS, FRAMES = 2000, 4
#: Share of the radius beyond which points tell where the rim is, and up to which points are taken
#: about the first guess of the centre.
NEAR, INSIDE = 0.8, 1.02
#: Of the radius that is said: points further off tell nothing of the clamp's edge. Of the largest
#: rise: points that move by less stand still.
AROUND, STILL = 1.6, 0.01
#: Of the radius that is said: sizes of the edge that are tried first.
SIZES = np.arange(0.6, 1.55, 0.1)
#: Harmonics around the centre; the even ones above zero tell the axes.
HARMONICS = (0, 1, 2, 3, 4)
TELLING = (2, 4)
RADII = np.linspace(0.1, 0.9, 9)
ANGLES = np.radians(np.arange(0.0, 90.0, 0.05))
#: Share of the highest frame's rise that the frame subtracted from others may have at most.
LOW = 0.7
#: Parts of the points by whose scatter the axes are judged, and the most frames that are used.
PARTS, FRAMES_SYMMETRY = 4, 6
#: Points that a part needs: four for each of its terms.
ENOUGH = 120
#: Largest standard error of usable axes, degrees, and how clear they must be at least.
UNSURE, CLEAR = 5.0, 0.5
#: The sheet's edge: points from this share of the rim's radius on.
EDGE = 0.85
#: Frames by which the centre is found: those with at least this share of the largest rise.
HIGH = 0.5


@dataclass(frozen=True)
class Rim:
    """The clamped edge in the plane of the sheet: centre x, y and its standard error, mm.
    angle : of the first semi-axis from x towards y, degrees (0 for a circle). turn_error : of an
    angle that was found, degrees; 0 where it was not looked for. scale : of the semi-axes that were
    said. still : points beyond it that stand still, where it was found by these."""

    x: float
    y: float
    angle: float
    error: float
    turn_error: float = 0.0
    scale: float = 1.0
    still: int = 0


def rim_of_motion(
    surfaces: Sequence[tuple[Array, Array]],
    semi_axes: tuple[float, float],
    start: tuple[float, float] = (0.0, 0.0),
    angle: float | None = None,
) -> Rim:
    """Find the rim of known size through which the sheet does not rise.

    The rise of every frame is a polynomial times a factor that is zero on the rim, about the centre
    that is looked for, and one constant, the frame's shift along z. Odd terms take what the sheet
    is not symmetric in: they cannot move the rim.

    surfaces : places (n, 2) mm in the plane and rises (n,) mm, by rising pressure: the last few are
    taken. semi_axes, start : mm. angle : degrees, of the first semi-axis; found unless given where
    the axes differ. Raises InputError for too few points, or none near the rim all around it."""
    free = semi_axes[0] != semi_axes[1] and angle is None
    fixed = 0.0 if angle is None else angle
    guess = np.array([*start, _long_axis(*surfaces[-1], semi_axes) if free else fixed])
    few = [_on_disk(*one, guess, semi_axes) for one in surfaces[-FRAMES:]]

    def terms(points: Array, place: Array) -> Array:
        return _terms(_local(points, np.append(place, fixed)[:3], semi_axes))

    count = 3 if free else 2
    scale = [semi_axes[0], semi_axes[0], 60.0][:count]
    place, covariance = _followed(few, terms, [guess[:count]], scale, np.full(count, np.inf))
    error = float(np.sqrt(np.trace(covariance[:2, :2])))
    turn = float(place[2]) % 180.0 if free else fixed
    turn_error = float(np.sqrt(covariance[2, 2])) if free else 0.0
    return Rim(float(place[0]), float(place[1]), turn, error, turn_error)


def _followed(
    few: Sequence[tuple[Array, Array]],
    terms: Callable[[Array, Array], Array],
    starts: Sequence[Array],
    scale: Sequence[float],
    reach: Array,
) -> tuple[Array, Array]:
    """Return the place whose terms (n, k) at the points follow the rises best; its covariance.
    few : points and rises. starts : of which the best is taken. reach : from there, at most."""

    def left(place: Array) -> Array:
        parts = []
        for points, rise in few:
            orthogonal, _ = np.linalg.qr(terms(points, place))
            parts.append(rise - orthogonal @ (orthogonal.T @ rise))
        return np.concatenate(parts)

    start = min(starts, key=lambda place: np.linalg.norm(left(place)))
    bounds = start - reach, start + reach
    best = scipy.optimize.least_squares(left, start, x_scale=scale, bounds=bounds)
    variance = 2 * best.cost / max(len(best.fun) - len(best.x), 1)
    return best.x, variance * np.linalg.pinv(best.jac.T @ best.jac)


def clamp_of_motion(
    surfaces: Sequence[tuple[Array, Array]], semi_axes: tuple[float, float], angle: float = 0.0
) -> Rim | None:
    """Find the edge beyond which points stand still; None where too few around the disk do.
    The rise of every frame is a polynomial times a factor that is zero from the edge on, whose
    centre and size are looked for. surfaces, semi_axes, angle : as those of `rim_of_motion`."""
    few = []
    for points, rise in surfaces[-FRAMES:]:
        near = np.hypot(*_local(points, np.array([0.0, 0.0, angle]), semi_axes)) < AROUND
        every = slice(None, None, max(1, -(-int(near.sum()) // POINTS)))
        points = points[near][every]
        rise = rise[near][every]
        if len(rise) < 3 * (len(EVEN) + len(ODD) + 1) or not np.abs(rise).max() > 0:
            return None
        few.append((points, rise / np.abs(rise).max()))

    def local(points: Array, place: Array) -> Array:
        return _local(points, np.array([*place[:2], angle]), semi_axes) / place[2]

    def terms(points: Array, place: Array) -> Array:
        return _terms(local(points, place), still=True)

    # Too large a circle hides in the points that stand still: the best of several is the start.
    starts = [np.array([0.0, 0.0, size]) for size in SIZES]
    ends = np.array([0.5 * semi_axes[1], 0.5 * semi_axes[1], 0.2])
    place, covariance = _followed(few, terms, starts, [semi_axes[0], semi_axes[0], 1.0], ends)
    points, rise = few[-1]
    places = local(points, place)
    beyond = np.hypot(*places) > BEYOND
    if beyond.sum() < LEAST or not in_all_quarters(places[:, beyond].T):
        return None
    # Of the largest rise: what does not stand still is no clamp.
    level = np.median(rise[beyond])
    if np.median(np.abs(rise[beyond] - level)) > STILL:
        return None
    error = float(np.sqrt(np.trace(covariance[:2, :2])))
    x, y, size = map(float, place)
    return Rim(x, y, angle, error, scale=size, still=int(beyond.sum()))


#: Change of a circle's size after which the search for it ends.
ENDED = 1e-4


def clamp_radius(
    fields: Sequence[DisplacementField], options: RegistrationOptions | None = None
) -> tuple[float, Rim]:
    """Return the radius (mm) of the circle beyond which points stand still, and its edge.
    fields : by rising pressure. options : of the registration, None for fields in the test's
    coordinates. Raises InputError where too few points around the disk stand still."""
    points, moved = _whole(fields[-1].frame)
    weight = np.linalg.norm(moved, axis=1)
    off = points - weight @ points / weight.sum()
    # Of a paraboloid on a disk: the mean square distance, weighted by the rise, is R^2 / 3.
    radius = float(np.sqrt(3.0 * (weight @ off**2).sum() / weight.sum()))
    for _ in range(ROUNDS):
        seen = fields
        if options is not None:
            seen, _ = register_fields(fields, Outline.circle(radius), options)
        rises = [(f.points, f.displacement[:, 2]) for f in seen]
        top = max(float(rise.max()) for _, rise in rises)
        high = [one for one in rises if one[1].max() > HIGH * top]
        edge = clamp_of_motion(high, (radius, radius))
        if edge is None:
            break
        radius *= edge.scale
        if abs(edge.scale - 1.0) < ENDED:
            return radius, edge
    problem = "no points of a clamp stand still around the disk; give the radius"
    raise InputError(None, "radius", problem)


def _long_axis(points: Array, rise: Array, semi_axes: tuple[float, float]) -> float:
    """Guess the turn of the first semi-axis, degrees: the rise spreads along the longer one."""
    weight = np.clip(rise, 0.0, None)
    x, y = (points - (weight[:, None] * points).sum(axis=0) / weight.sum()).T
    xx, yy, xy = (float((weight * a).sum()) for a in (x * x, y * y, x * y))
    along = np.degrees(0.5 * np.arctan2(2 * xy, xx - yy))
    return float(along if semi_axes[0] > semi_axes[1] else along + 90.0)


def _local(points: Array, place: Array, semi_axes: tuple[float, float]) -> Array:
    """Return coordinates (2, n) about a centre x, y, turned by degrees, in semi-axes."""
    c = np.cos(np.radians(place[2]))
    s = np.sin(np.radians(place[2]))
    x, y = (points - place[:2]).T
    return np.stack([(c * x + s * y) / semi_axes[0], (c * y - s * x) / semi_axes[1]])


def _on_disk(
    points: Array, rise: Array, place: Array, semi_axes: tuple[float, float]
) -> tuple[Array, Array]:
    """Return some of the points within the rim, and their rises over the largest of them."""
    local = _local(points, place, semi_axes)
    inside = np.hypot(*local) < INSIDE
    least = 3 * (len(EVEN) + len(ODD) + 1)
    if inside.sum() < least:
        problem = f"expected at least {least} points on the disk, got {int(inside.sum())}"
        raise InputError(None, "centre", f"{problem}; are the length unit and the radius right?")
    u, v = local[:, inside & (np.hypot(*local) > NEAR)]
    around = np.unique((np.arctan2(v, u) // (np.pi / 4)).astype(int))
    if len(around) < 8:
        problem = f"points come within {1 - NEAR:.0%} of the rim in {len(around)} of 8 directions"
        raise InputError(None, "centre", f"{problem} only; give the centre")
    every = slice(None, None, -(-int(inside.sum()) // POINTS))
    rise = rise[inside][every]
    return points[inside][every], rise / np.abs(rise).max()


def _terms(local: Array, still: bool = False) -> Array:
    u, v = local
    factor = 1.0 - u**2 - v**2
    factor = factor.clip(min=0.0) if still else factor
    shapes = [factor * u**i * v**j for i, j in (*EVEN, *ODD)]
    return np.stack([*shapes, np.ones_like(u)], axis=1)


@dataclass(frozen=True)
class Axes:
    """Two axes of symmetry at right angles, one at `angle` (0 to 90 degrees) from x towards y.
    error : standard error, degrees, from frame to frame and between parts of the points, or between
    the components of the displacement. clear : 1 where the field is wholly symmetric about these
    axes, 0 where no axes are better."""

    angle: float
    error: float
    clear: float

    @property
    def off(self) -> float:
        """Return the turn from x and y, degrees, which repeats after 90: from -45 to below 45."""
        return (self.angle + 45.0) % 90.0 - 45.0


def symmetry_axes(frames: Sequence[Frame], radius: float) -> Axes:
    """Return the axes of the frames' even part; frames about the rim's centre, rising pressure."""
    costs = _costs(frames, radius)
    together = costs.sum(axis=(0, 1))
    best = float(ANGLES[np.argmin(together)])
    # Frames share the noise of the one that is subtracted; parts of the points do not.
    error = _scatter(costs.sum(axis=1), best)
    count = min(PARTS, min(len(frame.points) for frame in frames) // ENOUGH)
    if count > 1:
        parts = [_costs(frames, radius, slice(k, None, count)) for k in range(count)]
        by_part = np.array([costs.sum(axis=(0, 1)) for costs in parts])
        error = float(np.hypot(error, _scatter(by_part, best)))
    # A sheet that is not symmetric, say ridged, turns the axes of u_r, u_theta and u_z apart.
    error = max(error, _scatter(costs.sum(axis=0), best))
    total = float(together.max())
    clear = 1.0 - float(together.min()) / total if total > 0 else 0.0
    return Axes(float(np.degrees(best)), error, clear)


def _costs(frames: Sequence[Frame], radius: float, every: slice = slice(None)) -> Array:
    """Return asymmetries (frames, 3, angles) of some points of each high frame less the lowest."""
    frames = [
        replace(f, points=f.points[every], displacement=f.displacement[every]) for f in frames
    ]
    rise = [float(np.nanmax(frame.displacement[:, 2])) for frame in frames]
    low = [f for f, r in zip(frames, rise, strict=True) if r <= LOW * rise[-1]]
    high = [f for f, r in zip(frames, rise, strict=True) if r > LOW * rise[-1]]
    first = harmonics(low[0], radius) if low else 0.0
    high = high[-FRAMES_SYMMETRY:]
    return np.array([_asymmetry(harmonics(frame, radius) - first) for frame in high])


def _scatter(costs: Array, best: float) -> float:
    """Return the standard error of the mean angle, degrees; axes repeat after 90 degrees."""
    each = ANGLES[np.argmin(costs, axis=1)]
    if len(each) < 2:
        return 0.0
    apart = np.angle(np.exp(4j * (each - best))) / 4
    return float(np.degrees(np.sqrt((apart**2).sum() / (len(each) - 1) / len(each))))


def harmonics(frame: Frame, radius: float) -> Array:
    """Return amplitudes (3, 5, 2, 9) mm of u_r, u_theta, u_z, by harmonic, cosine/sine, radius."""
    points, moved = _whole(frame)
    x, y = points[:, :2].T / radius
    r = np.hypot(x, y)
    angle = np.arctan2(y, x)
    on = (r > 1e-6) & (r < 1.0)
    r = r[on]
    angle = angle[on]
    moved = moved[on]
    c = np.cos(angle)
    s = np.sin(angle)
    polar = np.stack([c * moved[:, 0] + s * moved[:, 1], c * moved[:, 1] - s * moved[:, 0]])
    result = np.empty((3, len(HARMONICS), 2, len(RADII)))
    for quantity, values in enumerate([*polar, moved[:, 2]]):
        planar = quantity < 2
        radial = np.concatenate([_radial(r, k, planar) for k in HARMONICS for _ in range(2)])
        around = [f(k * angle) for k in HARMONICS for f in (np.cos, np.sin)]
        terms = (radial.reshape(len(around), 3, -1) * np.array(around)[:, None]).reshape(-1, len(r))
        solution, *_ = np.linalg.lstsq(terms.T, values, rcond=1e-10)
        of_term = solution.reshape(len(HARMONICS), 2, 3)
        for k in HARMONICS:
            result[quantity, k] = of_term[k] @ _radial(RADII, k, planar)
    return result


def _whole(frame: Frame) -> tuple[Array, Array]:
    """Return places (n, 3) and displacements (n, 3) mm where both were correlated."""
    whole = np.isfinite(frame.points).all(axis=1) & np.isfinite(frame.displacement).all(axis=1)
    return frame.points[whole], frame.displacement[whole]


def _radial(r: Array, k: int, planar: bool) -> Array:
    """Return the powers of the radius that a smooth field's harmonic k has: (3, n)."""
    lowest = abs(k - 1) if planar and k else k + (1 if planar else 0)
    return np.stack([r ** (lowest + 2 * i) for i in range(3)])


def _asymmetry(profile: Array) -> Array:
    """Return the parts of u_r, u_theta, u_z not symmetric about axes at the angles, (3, n) mm^2."""
    total = np.zeros((3, len(ANGLES)))
    for k in TELLING:
        cosine = np.cos(k * ANGLES)[:, None]
        sine = np.sin(k * ANGLES)[:, None]
        for quantity in range(3):
            a, b = profile[quantity, k]
            odd = b * cosine - a * sine if quantity != 1 else a * cosine + b * sine
            total[quantity] += (RADII * odd**2).sum(axis=1)
    return total


@dataclass(frozen=True)
class WarpDirection:
    """The direction of the warp, -90 to 90 degrees from x towards y, and its standard error.
    clear : as that of `Axes`; None by an elliptic rim."""

    angle: float
    error: float
    clear: float | None


def centre_strain(frame: Frame, radius: float) -> Array:
    """Return the Green-Lagrange strain (2, 2) of the surface at the centre; raises InputError."""
    try:
        shape = apex_shape(frame.points[:, :2], frame.displacement, radius)
    except InputError as error:
        raise InputError(None, "warp", error.problem) from None
    tangents = np.eye(3)[:2] + np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    return np.asarray(0.5 * (tangents @ tangents.T - np.eye(2)))


@dataclass(frozen=True)
class RegistrationOptions:
    """The given steps of a registration; everything else is found.
    plane : through points on the "clamp", through the "edge" of the sheet, the "camera"'s own x and
    y, or "found": the clamp where it was seen, else the edge. centre, warp_points : (3,) of the rim
    and two marks along the warp, mm, in the camera's coordinates. rim_angle : degrees, of the first
    semi-axis of an ellipse from the warp towards the fill. warp : degrees from the camera's x,
    towards its y where the sheet rises towards its z. warp_is_stiff : the direction strained less
    is the warp, where it is found."""

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


ALL_FOUND = RegistrationOptions()


@dataclass(frozen=True, eq=False)
class CameraRegistration:
    """The result of a registration, and how each step came about.
    placement : of the test's coordinates in the camera's. plane_of : "clamp", "edge" or "camera".
    flatness : mm, robust deviation of its points. rim : x along the warp; None where the centre is
    given. warp : None where it is given. warp_angle : degrees, as `RegistrationOptions.warp`.
    motions : of the clamp, one a frame, in the test's coordinates."""

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
) -> tuple[tuple[Frame, ...], CameraRegistration]:
    """Return the frames in the test's coordinates, and how these were found.
    frames : in the camera's coordinates, mm, by rising pressure; unless the clamp is seen, the rim
    must not turn between them. semi_axes : of the rim, mm, first the one that `rim_angle` belongs
    to. Raises InputError for a step that cannot be found and must be given."""
    reference = frames[-1]
    moving = reference.displacement[np.isfinite(reference.displacement).all(axis=1)]
    if not len(moving) or not np.abs(moving).max() > 0:
        raise InputError(reference.path, "", "nothing moves in the frame of the highest pressure")
    up = np.asarray(moving.mean(axis=0))
    placement, _ = plane_through(reference.points, up)
    if options.plane == "camera":
        # The camera's axes; turned about x where the sheet rises away from its z.
        axes = np.diag([1.0, 1.0, 1.0] if up[2] > 0 else [1.0, -1.0, -1.0])
        placement = Placement(np.zeros(3), axes)
    placement, rim = _centred(frames, placement, semi_axes, options)
    flatness = 0.0
    plane_of = "camera"
    if options.plane != "camera":
        # Which points lie on the clamp, or at the edge, is known once there is a centre.
        angle = _rim_angle(placement, rim, options)
        places = placement.places(reference.points)
        points, plane_of = _rim_points(places, Outline(*semi_axes, angle), options)
        placement, flatness = plane_through(reference.points[points], up)
        placement, rim = _centred(frames, placement, semi_axes, options)
    moved = placement.applied(frames)
    outline = Outline(*semi_axes, _rim_angle(placement, rim, options))
    motions = tuple(clamp_motion(f, outline.share(f.points[:, :2]) > BEYOND) for f in moved)
    if options.remove_clamp_motion:
        moved = tuple(without(f, m) for f, m in zip(moved, motions, strict=True))
    angle, warp = _warp(moved, placement, semi_axes, rim, options)
    turn = turned(angle)
    if rim is not None:
        rest = (rim.angle - angle) % 180.0 if rim.angle else 0.0
        rim = Rim(0.0, 0.0, rest, rim.error, rim.turn_error)
    full = turn.after(placement)
    from_camera_x = line_angle(-float(np.degrees(np.arctan2(full.axes[1, 0], full.axes[0, 0]))))
    return turn.applied(moved), CameraRegistration(
        full, plane_of, flatness, rim, warp, from_camera_x, motions, options
    )


def _centred(
    frames: Sequence[Frame],
    placement: Placement,
    semi_axes: tuple[float, float],
    options: RegistrationOptions,
) -> tuple[Placement, Rim | None]:
    """Return the same plane with its origin in the centre of the rim."""
    if options.centre is not None:
        place = placement.places(np.array(options.centre, dtype=float))
        return Placement(np.array([*place[:2], 0.0]), np.eye(3)).after(placement), None
    seen = [_whole(frame) for frame in placement.applied(frames)]
    surfaces = [(points[:, :2], displacement[:, 2]) for points, displacement in seen]
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
    # Points that stand still just beyond the rim pull at a rise that is negative there.
    about = [(points - start, rise) for points, rise in surfaces]
    if (edge := clamp_of_motion(about, semi_axes, rim.angle)) is not None:
        rim = replace(rim, x=rim.x + edge.x, y=rim.y + edge.y, error=edge.error)
    return Placement(np.array([rim.x, rim.y, 0.0]), np.eye(3)).after(placement), rim


def _rim_angle(placement: Placement, rim: Rim | None, options: RegistrationOptions) -> float:
    """Return degrees from the plane's x to the first semi-axis; without meaning for a circle."""
    if rim is not None:
        return rim.angle
    return (options.rim_angle or 0.0) + (_given_warp(placement, options) or 0.0)


def _rim_points(
    points: Array, outline: Outline, options: RegistrationOptions
) -> tuple[NDArray[np.bool_], str]:
    beyond = outline.share(points[:, :2]) > BEYOND
    seen = beyond.sum() >= LEAST and in_all_quarters(points[beyond])
    if options.plane == "clamp" and not seen:
        problem = "too few points beyond the rim to lay a plane through the clamp; choose 'edge'"
        raise InputError(None, "plane", problem)
    if seen and options.plane != "edge":
        return beyond, "clamp"
    return (outline.share(points[:, :2]) > EDGE) & ~beyond, "edge"


def _given_warp(placement: Placement, options: RegistrationOptions) -> float | None:
    """Return degrees from the plane's x to the warp, where it is given."""
    if options.warp_points is not None:
        first, second = placement.places(np.array(options.warp_points, dtype=float))[:, :2]
        x, y = second - first
        if np.hypot(x, y) < 1e-9:
            raise InputError(None, "warp", "expected two different points along the warp")
        return line_angle(float(np.degrees(np.arctan2(y, x))))
    return options.warp


def _warp(
    frames: Sequence[Frame],
    placement: Placement,
    semi_axes: tuple[float, float],
    rim: Rim | None,
    options: RegistrationOptions,
) -> tuple[float, WarpDirection | None]:
    """Return degrees from the plane's x to the warp, and how it was found unless given."""
    given = _given_warp(placement, options)
    radius = min(semi_axes)
    if given is not None:
        return given, None
    if semi_axes[0] == semi_axes[1] or options.rim_angle is None:
        # The axis of symmetry along which the centre is strained less, or more.
        axes = symmetry_axes(frames, radius)
        if axes.error > UNSURE or axes.clear < CLEAR:
            problem = (
                f"the field does not tell warp from fill (axes at {axes.angle:.0f} +- "
                f"{axes.error:.1f} degrees, {axes.clear:.0%} clear); give the angle"
            )
            raise InputError(None, "warp", problem)
        strain = centre_strain(frames[-1], radius)
        if len(frames) > 1:
            strain = strain - centre_strain(frames[0], radius)
        along, across = (float(x @ strain @ x) for x in turned(axes.angle).axes[:2, :2])
        swapped = (along > across) == options.warp_is_stiff
        angle = line_angle(axes.angle + 90.0 * swapped)
        return angle, WarpDirection(angle, axes.error, axes.clear)
    if rim is None:
        problem = "expected the warp, too, where the centre of an elliptic rim is given"
        raise InputError(None, "warp", problem)
    if rim.turn_error > UNSURE:
        problem = (
            f"the rim is too round to tell the warp (turned by {rim.angle:.0f} +- "
            f"{rim.turn_error:.0f} degrees); give the angle"
        )
        raise InputError(None, "warp", problem)
    angle = line_angle(rim.angle - options.rim_angle)
    return angle, WarpDirection(angle, rim.turn_error, None)


def register_fields(
    fields: Sequence[DisplacementField], outline: Outline, options: RegistrationOptions = ALL_FOUND
) -> tuple[tuple[DisplacementField, ...], CameraRegistration]:
    """Register fields by rising pressure as `register` does frames; outline from the warp.
    Without measured heights the plane is the camera's; one to be found raises InputError."""
    measured = all(field.z is not None for field in fields)
    if not measured:
        if options.plane not in ("found", "camera"):
            problem = "the files have no height z of the reference state to lay a plane through"
            raise InputError(None, "plane", problem)
        options = replace(options, plane="camera")
    if not outline.round:
        options = replace(options, rim_angle=outline.angle)
    semi_axes = outline.major, outline.minor
    frames, registration = register([field.frame for field in fields], semi_axes, options)
    moved = []
    for field, frame in zip(fields, frames, strict=True):
        z = frame.points[:, 2] if measured else None
        own = replace(field, points=frame.points[:, :2], z=z, displacement=frame.displacement)
        moved.append(own)
    return tuple(moved), registration
