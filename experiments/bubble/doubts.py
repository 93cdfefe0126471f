"""Doubts about the data of a bubble test: traps that measured fields may have fallen into.

Each check, one function in `CHECKS`, looks at the measured fields (`View`) and yields doubts."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...readers.unit_plausibility import pressure_remedy, unit_doubt
from ...solvers.base import Array
from ..doubts import Doubt, Expected
from . import registration
from .column_consistency import (
    CentreMotion,
    ConsistencyLimits,
    centre_motion,
    flattened_share,
    spreads,
    strain_of_rise,
)
from .registration import MAD
from .sheet import fit_disk_polynomial

#: Of the highest rise: a centre that sinks by more while the pressure rises is no noise.
SINKS = 0.02
#: Between two pressures ln(rise) grows by so large a part of what it does in the others (of ln(p),
#: at least so much), or the state is the same; so large a part of the highest rise is judged.
SAME_STATE, USUAL, JUDGED = 0.1, 0.2, 0.02
#: Share of the displacements by which reference places follow them when they are deformed ones (at
#: most: no sheet is moved by twice its motion), and least correlation of the two.
FOLLOWS, MOST_FOLLOWED, LIKE = 0.5, 2.0, 0.9
#: Of the median motion between two frames: places this close are one; of the points, most of them.
CLOSE, MOST = 0.05, 0.5
LIMITS = ConsistencyLimits()
ADVICE = "let a registration find the frame ([bubble.data.points.registration])"
#: Of the radius: a centre, or a sheet's height, further off is no small thing.
OFF, FAR_OFF, HIGH = 0.035, 0.15, 0.1
#: Of the radius, and in standard errors: a smaller offset of a centre that is known this well, by
#: the clamp's edge or by a sheet that rises as evenly as none with a first shape does.
A_LITTLE, WELL = 0.015, 20.0
#: Of the radius: the clamp's edge is elsewhere; surely so.
EDGE, FAR_EDGE = 0.03, 0.06
#: Of the radius: a first shape of the sheet that matters; degree of its polynomial.
SHAPE, DEGREE = 0.004, 4
#: Points off the smooth surface by so many robust deviations, and by so much of the highest rise,
#: are gross outliers; degree of the surface, rounds, and the share of the radius that is judged.
GROSS, OF_RISE, SMOOTH, ROUNDS, WELL_INSIDE = 10.0, 0.04, 8, 5, 0.95
#: Points of a frame that are enough to look at; of more, every so many.
ENOUGH = 4000
#: Degrees.
TILT, STEEP, TURN = 1.2, 8.0, 5.0
#: Standard errors that a place or an angle must be off by.
SURE = 4.0
#: How clear axes must be, and how much more the warp must be strained than the fill.
CLEAR, MORE = 0.6, 1.1
#: Of the radius: the rise of a bubble at its highest pressure is somewhere between.
LEAST_RISE, MOST_RISE = 0.004, 1.5
#: Of the radius: how far from the centre the outermost point is.
LEAST_REACH, MOST_REACH = 0.1, 20.0
#: Of a biaxial stress and strain: Poisson's ratio is not known yet, and matters little here.
RATIO = 0.25
#: A modulus that equilibrium gives is doubted where it lies beyond the bounds by this factor.
BEYOND_BOUNDS = 1.1
#: Below this mean strain the first shape of the sheet decides what looks like strain.
TELLING = 0.002


@dataclass(frozen=True)
class Apex:
    """Equilibrium at the apex of one field without any model: n1 k1 + n2 k2 = p from its shape.
    pressure : MPa. height : mm, rise of the centre. curvature : 1/mm, k1 + k2 of the inflated
    surface; positive where it is a dome. force : N/mm, p / (k1 + k2), that of all directions if
    alike. error : N/mm, of the force by the points' scatter. strain : logarithmic, along x and y.
    """

    pressure: float
    height: float
    curvature: float
    force: float
    error: float
    strain: tuple[float, float]

    @property
    def stiffness(self) -> float:
        """Return force over mean strain, N/mm; infinite where nothing is strained."""
        mean = 0.5 * (self.strain[0] + self.strain[1])
        return self.force / mean if mean > 0 else float("inf")


def apex_of(field: DisplacementField, radius: float) -> Apex:
    """Return the apex of a field about the centre of a rim of `radius` mm; raises InputError."""
    before = field.frame.points
    after = before + field.displacement
    shape = registration.apex_shape(field.points, np.hstack([after, before]), radius)
    left = after[shape.near, 2] - shape.terms @ shape.coefficients[:, 2]
    tangents = np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    metric = tangents[:, :3] @ tangents[:, :3].T
    first = tangents[:, 3:] @ tangents[:, 3:].T
    normal = np.cross(tangents[0, :3], tangents[1, :3])
    normal /= np.linalg.norm(normal)
    xx, xy, yy = (shape.at_centre(i, j)[:3] @ normal for i, j in ((2, 0), (1, 1), (0, 2)))
    second = np.array([[xx, xy], [xy, yy]])
    curvature = -float(np.trace(np.linalg.solve(metric, second)))
    variance = float(left @ left) / (len(left) - len(registration.POWERS))
    inverse = np.linalg.pinv(shape.terms.T @ shape.terms)
    both = [registration.POWERS.index((2, 0)), registration.POWERS.index((0, 2))]
    spread = float(np.sqrt(variance * inverse[np.ix_(both, both)].sum())) * 2 / radius**2
    stretch = np.sqrt(np.diag(metric) / np.diag(first))
    strain = float(np.log(stretch[0])), float(np.log(stretch[1]))
    centre = shape.at_centre()
    force = doubt = float("inf")
    if curvature > 0:
        force = field.pressure / curvature
        doubt = force * spread / curvature
    return Apex(field.pressure, float(centre[2] - centre[5]), curvature, force, doubt, strain)


@dataclass(frozen=True, eq=False)
class View:
    """Measured fields by rising pressure, in the test's coordinates; thickness mm.
    flat : nothing is said of the sheet's first shape. numbers : doubts about the frames' numbers.
    """

    fields: tuple[DisplacementField, ...]
    outline: Outline
    thickness: float
    registered: bool
    flat: bool = False
    numbers: Sequence[str] = ()

    @property
    def last(self) -> DisplacementField:
        """Return the field at the highest pressure."""
        return self.fields[-1]

    @property
    def top(self) -> str:
        """Return the highest pressure, kPa."""
        return f"{1e3 * self.last.pressure:.4g}"

    @cached_property
    def rises(self) -> Array:
        """Return (fields,) mm: median rise of points within a quarter of the radius, or of all."""
        found = []
        for field in self.fields:
            near = self.outline.share(field.points) < 0.25
            found.append(np.median(field.displacement[near if near.any() else ..., 2]))
        return np.array(found)

    @cached_property
    def apexes(self) -> tuple[Apex, ...]:
        """Return the apex of every field; none where there are too few points."""
        try:
            return tuple(apex_of(field, self.outline.minor) for field in self.fields)
        except (InputError, np.linalg.LinAlgError):
            return ()

    @cached_property
    def centre_motions(self) -> tuple[CentreMotion | None, ...]:
        """Return the motion about the centre in the first and the last frame."""
        return tuple(
            centre_motion(f, self.outline, LIMITS)
            for f in self.fields[:: max(1, len(self.fields) - 1)]
        )

    @property
    def surfaces(self) -> list[tuple[Array, Array]]:
        """Return places and rises of the high frames."""
        high = [f for f, r in zip(self.fields, self.rises, strict=True) if r > 0.5 * self.rises[-1]]
        return [(f.points, f.displacement[:, 2]) for f in high]

    @cached_property
    def clamp(self) -> registration.Rim | None:
        """Find the edge of the clamp; None where no points stand still around the disk."""
        outline = self.outline
        return registration.clamp_of_motion(
            self.surfaces, (outline.major, outline.minor), outline.angle
        )

    @cached_property
    def rim(self) -> registration.Rim | None:
        """Find the rim, of an ellipse its turn; None where points do not reach it all around."""
        try:
            return registration.rim_of_motion(
                self.surfaces, (self.outline.major, self.outline.minor)
            )
        except InputError:
            return None

    @cached_property
    def axes(self) -> registration.Axes | None:
        """Find the axes of symmetry; None of an ellipse or where points lie on one side only."""
        if not self.outline.round or not registration.in_all_quarters(self.last.points):
            return None
        frames = [field.frame for field in self.fields]
        return registration.symmetry_axes(frames, self.outline.radius)

    @property
    def registration_estimates(self) -> dict[str, float]:
        """Return what the fields alone say of the frame: turn of the yarns, tilts about x and y
        (degrees), shifts (mm), as they make up for it; what is not clear is left out."""
        found = {}
        axes = self.axes
        rim = self.clamp or self.rim
        if axes and axes.error <= registration.UNSURE and axes.clear >= registration.CLEAR:
            found["turn"] = axes.off
        motion = _motion(self)
        if motion is not None and motion[2] > 0:
            x, y, z = motion
            found["tilt_x"] = -float(np.degrees(np.arctan2(y, z)))
            found["tilt_y"] = float(np.degrees(np.arctan2(x, np.hypot(y, z))))
        if rim is not None:
            found |= {"shift_x": -rim.x, "shift_y": -rim.y}
        return found

    def inner(self, field: DisplacementField, share: float = 0.9) -> NDArray[np.bool_]:
        """Return which points lie well within the rim."""
        return np.asarray(self.outline.share(field.points) < share)


def upside_down(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt a bubble that goes down as the pressure goes up: z is flipped."""
    if not view.rises[-1] >= 0:
        text = (
            f"the centre moves by {view.rises[-1]:.3g} mm along z at {view.top} kPa: z is "
            "flipped; turn the axes, or let a registration find them"
        )
        yield Doubt("z-flipped", True, text)


def order(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt frames that are not in the order of their pressures."""
    for k, (a, b) in enumerate(pairwise(view.rises)):
        if b < a - SINKS * view.rises.max():
            low, high = (1e3 * view.fields[i].pressure for i in (k, k + 1))
            text = (
                f"the centre sinks from {a:.3g} to {b:.3g} mm between {low:.4g} and {high:.4g} "
                "kPa: the frames are not in the order of the pressures"
            )
            yield Doubt("frame-order", True, text)
            return


def repeated(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt one frame given for two pressures."""
    pairs = [
        f"{1e3 * first.pressure:.4g} and {1e3 * second.pressure:.4g} kPa"
        for first, second in pairwise(view.fields)
        if np.array_equal(first.displacement, second.displacement) and first.displacement.any()
    ]
    if pairs:
        more = f" (and in {len(pairs) - 1} more pairs)" if pairs[1:] else ""
        text = f"the displacements at {pairs[0]} are the same to the last digit{more}: one frame"
        yield Doubt("repeated-frame", True, f"{text} is given twice")


def same_states(view: View, of: Expected) -> Iterator[Doubt]:
    """Doubt two pressures between which the centre rises by next to nothing."""
    if len(view.fields) < 2 or not (view.rises > 0).all():
        return
    p = np.log([field.pressure for field in view.fields])
    h = np.log(view.rises)
    usual = max(USUAL, float(np.median(np.diff(h) / np.diff(p))))
    for k in range(len(p) - 1):
        expected = usual * (p - p[k])
        # The next frame that is far enough above for a rise to be seen.
        far = np.flatnonzero(expected * view.rises[k] > JUDGED * view.rises.max())
        if len(far) and h[far[0]] - h[k] < SAME_STATE * expected[far[0]]:
            low, high = (1e3 * view.fields[i].pressure for i in (k, far[0]))
            text = (
                f"the centre stands at {view.rises[k]:.4g} mm at {low:.4g} kPa and at "
                f"{view.rises[far[0]]:.4g} mm at {high:.4g} kPa, and should rise by about "
                f"{view.rises[k] * np.expm1(expected[far[0]]):.2g} mm: one state was recorded twice"
                ", or a pressure is wrong"
            )
            yield Doubt("repeated-frame", True, text)
            return


def outliers(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt points far off the smooth surface through all."""
    found = [(field, *_gross(view, field)) for field in view.fields]
    field, bad, judged, most = max(found, key=lambda one: one[1])
    if bad:
        frames = sum(one[1] > 0 for one in found)
        text = (
            f"{bad} of {judged} points at {1e3 * field.pressure:.4g} kPa ({bad / judged:.1%}), and "
            f"some in {frames} of {len(found)} frames, lie up to {most:.3g} mm off the smooth "
            "surface through the others, and the fit takes squares: leave them out with a flag "
            "(flag_column), or correlate again"
        )
        yield Doubt("outliers", False, text)


def _gross(view: View, field: DisplacementField) -> tuple[int, int, float]:
    """Return the number of gross outliers, of points that were judged, and the farthest, mm."""
    inside = np.flatnonzero(view.inner(field, WELL_INSIDE))
    inside = inside[:: max(1, -(-len(inside) // ENOUGH))]
    points = field.points[inside]
    moved = field.displacement[inside]
    kept = np.ones(len(points), dtype=bool)
    off = np.zeros_like(moved)
    for _ in range(ROUNDS):
        try:
            surface = fit_disk_polynomial(points[kept], moved[kept], view.outline.major, SMOOTH)
        except InputError:
            return 0, len(points), 0.0
        off = np.abs(moved - surface.at(points))
        least = np.maximum(GROSS * MAD * np.median(off[kept], axis=0), OF_RISE * view.rises.max())
        now = (off <= least).all(axis=1)
        if (now == kept).all():
            break
        kept = now
    return int((~kept).sum()), len(points), float(off[~kept].max(initial=0.0))


def rejected_at_zero(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt points without correlation that were written as zeros."""
    moved = view.last.displacement[view.inner(view.last)]
    still = int((moved == 0).all(axis=1).sum())
    twice = int((view.last.points == 0).all(axis=1).sum())
    found = [f"{still} of {len(moved)} points well within the rim do not move at all"] * (still > 0)
    found += [f"{twice} points lie at exactly x = y = 0"] * (twice > 1)
    if found:
        text = (
            f"{' and '.join(found)} at {view.top} kPa: points without correlation "
            "seem to be written as zeros; name the column that marks them (flag_column)"
        )
        yield Doubt("zero-points", True, text)


def deformed_coordinates(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt places after the motion where those before it are meant."""
    last = view.last
    seen = ""
    if last.z is not None and not view.registered:
        # A reference surface that has the bubble's own shape.
        alike = _follows(last.z[:, None], last.displacement[:, 2:])
        seen = f"the height z follows dz by {alike:.0%}" if alike > FOLLOWS else ""
    for other in view.fields[:-1]:
        a, b = _same_points(last, other)
        if not seen and len(a):
            moved = (last.displacement[a] - other.displacement[b])[:, :2]
            alike = _follows(last.points[a] - other.points[b], moved)
            if FOLLOWS < alike < MOST_FOLLOWED:
                seen = f"x and y change from frame to frame by {alike:.0%} of dx and dy"
    if seen:
        text = f"{seen}: the coordinates are those of the deformed sheet; export the reference"
        yield Doubt("deformed-coordinates", True, f"{text} coordinates")


def _same_points(
    last: DisplacementField, other: DisplacementField
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of points that are in both frames: by their places, before or after.
    Rows are paired as they stand where most of the places are found in neither way."""
    moved = float(np.median(np.linalg.norm(last.displacement[:, :2], axis=1)))
    for taken_off in (0.0, 1.0):
        a, b = (f.points - taken_off * f.displacement[:, :2] for f in (last, other))
        some = np.arange(len(b))[:: max(1, -(-len(b) // ENOUGH))]
        apart, row = scipy.spatial.cKDTree(a).query(b[some])
        near = apart <= CLOSE * moved
        if near.mean() > MOST:
            return row[near], some[near]
    rows = np.arange(len(last.points) if len(last.points) == len(other.points) else 0)
    return rows, rows


def _follows(place: Array, moved: Array) -> float:
    """Return the slope of places over displacements where the two are alike, 0 otherwise."""
    a = place - place.mean(axis=0)
    b = moved - moved.mean(axis=0)
    size = float(np.sqrt((a**2).sum() * (b**2).sum()))
    if not size > 0 or float((a * b).sum()) < LIKE * size:
        return 0.0
    return float((a * b).sum() / (b**2).sum())


def places_exchanged(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt places of which z is not the height: the points spread more along it than across."""
    spread, within = spreads(view.fields)
    if np.isfinite(within) and spread[2] > within:
        flat = "xyz"[int(np.argmin(spread))]
        text = (
            f"the points spread by {spread[0]:.3g}, {spread[1]:.3g} and {spread[2]:.3g} mm along "
            f"x, y and z (standard deviations), and a sheet is flat along z: exchange {flat} and z "
            "of the places"
        )
        yield Doubt("exchanged", True, text)


def rise_exchanged(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt displacements of which dz is not the rise: dx or dy has the dome."""
    motion = view.centre_motions[-1]
    if motion is None:
        return
    dx, dy, dz = np.abs(motion.dome)
    highest = max(dx, dy)
    if highest < LIMITS.visible_dome * view.outline.radius or dz > LIMITS.dome_share * highest:
        return
    name = "dx" if dx > dy else "dy"
    text = (
        f"{name} is a dome of {highest:.3g} mm over the disk at {view.top} kPa and dz of "
        f"{dz:.2g} mm, but the sheet rises along z: exchange {name} and dz, or the same two of x, "
        "y and z"
    )
    yield Doubt("exchanged", True, text)


def strain_and_rise(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt dx and dy that do not go with x and y, or not with the rise."""
    first = view.centre_motions[0]
    last = view.centre_motions[-1]
    if last is None:
        return
    comparison = strain_of_rise(first if len(view.fields) > 1 else None, last, view.outline, LIMITS)
    if not comparison.judged or not comparison.outside(LIMITS.unusual):
        return
    least, most = comparison.principal
    rise, lower = comparison.rise
    due = " to ".join(dict.fromkeys(f"{strain:.2g}" for strain in comparison.due))
    rises = f"a rise of {rise:.3g} mm" if not lower else f"a rise from {lower:.3g} to {rise:.3g} mm"
    text = (
        f"the centre is strained by {least:.2g} and {most:.2g} (principal strains, of dx and dy), "
        f"and {rises} calls for about {due}"
    )
    sure = comparison.outside(LIMITS.sure)
    name, remedy = _remedy(comparison.assignment) if sure else ("strain-rise", "")
    if not remedy:
        remedy = "are dx, dy and dz all there and in one unit, and is the radius right?"
    yield Doubt(name, sure, f"{text}: {remedy}")


def _remedy(assignment: tuple[tuple[int, int], tuple[int, int]]) -> tuple[str, str]:
    """Return the name of a doubt and what to do so that dx grows with x, dy with y."""
    (x_sign, x_column), (y_sign, _) = assignment
    if x_column == 1:
        minus_x, minus_y = ("minus " if sign < 0 else "" for sign in (x_sign, y_sign))
        text = f"dx and dy are exchanged; take {minus_x}dy for dx and {minus_y}dx for dy"
        return "exchanged", f"{text}, or exchange x and y in the same way"
    if x_sign > 0 and y_sign > 0:
        return "strain-rise", ""
    wrong = [name for name, sign in (("x", x_sign), ("y", y_sign)) if sign < 0]
    senses = " and ".join(f"{name} and d{name} have opposite senses" for name in wrong)
    return "axis-flipped", f"{senses}; flip one of them"


def height_flipped(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt heights z of the first shape that the rise adds to: pressure pulls a sheet flat."""
    slope = flattened_share(view.last, view.outline, LIMITS)
    if slope is not None and slope > LIMITS.height_slope:
        text = (
            f"dz follows the bumps of the heights z by {slope:+.0%} at {view.top} kPa, but a sheet "
            "that is pulled flat loses them: change the sign of z"
        )
        yield Doubt("height-flipped", False, text)


def camera_height(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt heights counted from somewhere else than the rim."""
    height = 0.0 if view.last.z is None else float(np.median(view.last.z))
    if not abs(height) < HIGH * view.outline.radius:
        text = f"the reference heights lie about z = {height:.4g} mm, not about the rim: {ADVICE}"
        yield Doubt("camera-frame", False, text)


def clamped_elsewhere(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt a radius that is not that of the edge beyond which points stand still."""
    edge = view.clamp
    if edge is None or abs(edge.scale - 1.0) < EDGE:
        return
    outline = view.outline
    names = ("radius",) if outline.round else ("major", "minor")
    sizes = (outline.major,) if outline.round else (outline.major, outline.minor)
    seen, said = (
        " and ".join(f"{name} {by * size:.3g} mm" for name, size in zip(names, sizes, strict=True))
        for by in (edge.scale, 1.0)
    )
    text = (
        f"{edge.still} points of the clamp stand still, beyond an edge of {seen}; the project says "
        f"{said}: give that of the free disk inside the clamp"
    )
    text += ', or radius = "clamp"' if outline.round else ""
    yield Doubt("radius", abs(edge.scale - 1.0) > FAR_EDGE, text)


def first_shape(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt a sheet taken for flat whose measured heights are not."""
    field = max(view.fields, key=lambda f: 0 if f.z is None else len(f.points))
    on = view.inner(field, 1.0)
    if field.z is None or not view.flat:
        return
    heights = field.z[on]
    points = field.points[on]
    try:
        plane, shape = (
            fit_disk_polynomial(points, heights[:, None], view.outline.major, degree).at(points)
            for degree in (1, DEGREE)
        )
    except InputError:
        return
    most = float(np.abs(shape - plane).max())
    if most > SHAPE * view.outline.radius:
        text = (
            f"the sheet is up to {most:.2g} mm off a plane in the reference picture, and would be "
            "taken for flat and taut, which can change E1 by a factor: say [bubble.sheet] surface "
            '= "measured"'
        )
        yield Doubt("flat-sheet", False, text)


def off_centre(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt an origin that is not the rim's centre."""
    rim = view.clamp or view.rim
    off = 0.0 if rim is None else float(np.hypot(rim.x, rim.y))
    if rim is None:
        return
    much = max(OFF * view.outline.radius, SURE * rim.error)
    little = max(A_LITTLE * view.outline.radius, WELL * rim.error)
    if not off < min(much, little):
        text = (
            f"the sheet rises about x = {rim.x:.3g}, y = {rim.y:.3g} mm (+- {rim.error:.2g}), not "
            f"about the origin: {ADVICE}"
        )
        yield Doubt("off-centre", off > FAR_OFF * view.outline.radius, text)


def _motion(view: View) -> Array | None:
    """Return (3,) mm, the mean motion well within the rim; None without points there."""
    if not view.inner(view.last).any():
        return None
    first = _mean_motion(view, view.fields[0]) * (len(view.fields) > 1)
    return _mean_motion(view, view.last) - first


def _mean_motion(view: View, field: DisplacementField) -> Array:
    """Return (3,) mm over points with others across the centre: a side that is lost is no tilt."""
    inner = view.inner(field)
    points = field.points[inner]
    tree = scipy.spatial.cKDTree(field.points[inner])
    apart = 2.0 * np.median(tree.query(points, 2)[0][:, 1])
    paired = tree.query(-points)[0] < apart
    return np.asarray(field.displacement[inner][paired if paired.any() else ...].mean(axis=0))


def tilted(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt a rise that is not along z: on average the sheet moves sideways."""
    motion = _motion(view)
    if motion is None:
        return
    x, y, z = motion
    tilt = float(np.degrees(np.arctan2(np.hypot(x, y), abs(z)))) if z else 0.0
    if not tilt < TILT:
        text = (
            f"the sheet moves along a line {tilt:.2g} degrees from z: its frame is tilted, or the "
            f"clamp moved; {ADVICE}"
        )
        yield Doubt("tilted", tilt > STEEP, text)


def turned(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt that warp and fill lie along x and y, or that an elliptic rim lies as it is said to."""
    if view.rim is None:
        return
    if not view.outline.round:
        said = view.outline.angle
        off = registration.line_angle(view.rim.angle - said)
        error = view.rim.turn_error
        where = f"{said + off:.3g} degrees from x"
        text = (
            f"the sheet rises within an ellipse whose major axis lies {where} (+- {error:.2g}), not"
            f" {said:.3g}: is its angle right, and {ADVICE}"
        )
    elif view.axes is None or view.axes.clear < CLEAR:
        return
    else:
        off = view.axes.off
        error = view.axes.error
        text = (
            f"the fields are symmetric about axes {off:.3g} degrees from x and y (+- "
            f"{error:.2g}): warp and fill lie there; {ADVICE}"
        )
    if not abs(off) < max(TURN, SURE * error):
        yield Doubt("turned", False, text)


def swapped(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt warp and fill that seem swapped; an ellipse is strained more along its minor axis."""
    if not view.outline.round or not view.apexes:
        return
    if not expected.moduli or not expected.warp_is_stiffer:
        return
    warp, fill = view.apexes[-1].strain
    if len(view.apexes) > 1:
        # What the sheet's first shape adds to both frames cancels.
        warp = warp - view.apexes[0].strain[0]
        fill = fill - view.apexes[0].strain[1]
    if warp > MORE * fill > 0:
        text = (
            f"the centre is strained by {warp:.3g} along the warp and {fill:.3g} along the fill, "
            "and the bounds have the warp stiffer: warp and fill seem to be swapped"
        )
        yield Doubt("swapped", False, text)


def length_unit(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt mm taken for m, in places or in displacements."""
    reach = float(view.outline.share(view.last.points).max())
    rise = abs(float(view.rises[-1])) / view.outline.radius
    if not LEAST_REACH < reach < MOST_REACH:
        text = (
            f"the outermost point is {reach:.3g} radii from the centre: are x and y in the length "
            "unit that is said, and is the radius right?"
        )
        yield Doubt("length-unit", True, text)
    if not LEAST_RISE < rise < MOST_RISE:
        text = (
            f"the centre rises by {rise:.3g} radii at {view.top} kPa: are the displacements in "
            "the length unit that is said (mm beside m)?"
        )
        yield Doubt("length-unit", True, text)


def pressure_unit(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt bar taken for kPa, or a wrong thickness, by the force that equilibrium gives."""
    modulus = _apex_modulus(view)
    text = ""
    names = ("E1", "E2")
    if modulus is not None and expected.moduli:
        beyond = expected.outside(modulus, names, BEYOND_BOUNDS)
        if beyond:
            top = view.apexes[-1]
            mean = 0.5 * sum(top.strain)
            text = (
                f"equilibrium of the apex at {view.top} kPa gives {top.force:.3g} N/mm at a strain "
                f"of {mean:.3g}, a modulus of about {beyond}: is the pressure in the unit that is "
                "said (bar beside kPa), and are thickness and lengths right?"
            )
            text += pressure_remedy(modulus, expected.limits(names))
            yield Doubt("pressure-unit", bool(expected.outside(modulus, names)), text)
    problem = unit_doubt("pressure", 1e3 * view.last.pressure, "kPa", 1e-3)
    if problem and not text:
        yield Doubt("pressure-unit", True, f"the highest pressure: {problem}")


def _apex_modulus(view: View) -> float | None:
    """Return a rough modulus of the sheet, MPa; None where nothing is strained."""
    if not view.apexes:
        return None
    top = view.apexes[-1]
    if not np.isfinite(top.force) or 0.5 * sum(top.strain) < TELLING:
        return None
    return top.stiffness * (1 - RATIO) / view.thickness


#: Later checks reckon with what earlier ones make sure of: a sure doubt ends the list.
CHECKS = (
    places_exchanged,
    rise_exchanged,
    length_unit,
    rejected_at_zero,
    outliers,
    upside_down,
    order,
    repeated,
    same_states,
    deformed_coordinates,
    clamped_elsewhere,
    strain_and_rise,
    pressure_unit,
    height_flipped,
    first_shape,
    camera_height,
    off_centre,
    tilted,
    turned,
    swapped,
)


def doubts_of(view: View, expected: Expected) -> Sequence[Doubt]:
    """Return the doubts in the order of the checks."""
    found = [Doubt("frame-numbers", False, text) for text in view.numbers]
    for check in CHECKS:
        found += check(view, expected)
        if any(doubt.sure for doubt in found):
            break
    return found
