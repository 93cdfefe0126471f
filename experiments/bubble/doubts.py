"""Doubts about the data of a bubble test: traps that measured fields may have fallen into.

Each check, one function in `CHECKS`, looks at the measured fields (`MeasuredView`) and yields
doubts. Here are those of coordinates (origin, radius, tilt, warp) and units, of points where the
image correlation failed, and of the columns of places (x, y, z) and of displacements (dx, dy, dz).

Whether columns belong together is judged by what all inflated disks have in common, without a law.
The sheet rises as a dome along z, dx grows with x and dy with y about the centre, and the strain
fits the rise h: a fibre from rim to rim becomes an arc, so both principal strains of the centre are
near 2/3 (h/R)^2 (R: radius of the rim). Computed bubbles with E1/E2 from 1 to 50 have 1.0 to 2.0
times this strain, measured as here; slack sheets have 0.2 times this at first, and 0.7 times
between two of their frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...readers.units import pressure_remedy, unit_doubt
from ...solvers.base import Array
from ..doubts import Doubt
from .frame_doubts import (
    deformed_coordinates,
    first_shape,
    frame_order,
    loaded_reference,
    moving_edge,
    repeated_frame,
    same_states,
    states_at_rest,
)
from .measured_view import MIN_POINTS, CentreMotion, MeasuredView
from .placement import line_angle

# Coordinates and units --------------------------------------------------------------------------

ADVICE = "let a registration find the frame ([bubble.data.points.registration])"


@dataclass(frozen=True)
class CoordinateLimits:
    """Errors of the coordinate system beyond which it is doubted; lengths in radii of the rim.

    Beyond the limits `sure_` a doubt is sure.
    """

    height: float = 0.1  # median height of the sheet before the test
    edge: float = 0.03  # relative error of the clamp's radius
    sure_edge: float = 0.06
    centre: float = 0.035  # distance of the rim's centre from the origin
    sure_centre: float = 0.15
    small_centre: float = 0.015  # that distance where it exceeds `small_sigmas` standard errors
    small_sigmas: float = 20.0
    sigmas: float = 4.0  # standard errors that a distance or an angle must exceed
    tilt: float = 1.2  # degrees, angle of the mean motion from z
    sure_tilt: float = 8.0
    turn: float = 5.0  # degrees, turn of the yarns or of an elliptic rim
    min_clarity: float = 0.6  # smallest `Axes.clarity` of axes of symmetry that are judged
    strain_ratio: float = 1.1  # strain of the warp over that of the fill: seem to be swapped


COORDINATE_LIMITS = CoordinateLimits()


def camera_height(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt heights counted from somewhere else than the rim."""
    height = 0.0 if view.last.z is None else float(np.median(view.last.z))
    if not abs(height) < COORDINATE_LIMITS.height * view.outline.radius:
        text = f"the reference heights lie about z = {height:.4g} mm, not about the rim: {ADVICE}"
        yield Doubt("camera-frame", False, text)


def clamped_elsewhere(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a radius that is not that of the edge beyond which points stand still."""
    edge = view.clamp
    if edge is None or abs(edge.scale - 1.0) < COORDINATE_LIMITS.edge:
        return
    outline = view.outline
    sizes = {"radius": outline.major}
    if not outline.round:
        sizes = {"major": outline.major, "minor": outline.minor}
    measured, stated = (
        " and ".join(f"{name} {scale * size:.3g} mm" for name, size in sizes.items())
        for scale in (edge.scale, 1.0)
    )
    text = (
        f"{edge.still_count} points of the clamp stand still, beyond an edge of {measured}; the "
        f"project says {stated}: {scale_words(edge.scale)}give that of the free disk inside the "
        "clamp"
    )
    text += ', or radius = "clamp" with a nominal_radius by a ruler' if outline.round else ""
    yield Doubt("radius", abs(edge.scale - 1.0) > COORDINATE_LIMITS.sure_edge, text)


def clamp_scale(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a radius of the clamp in the data that is not the one by a ruler."""
    if view.nominal_radius is None:
        return
    scale = view.outline.radius / view.nominal_radius
    if abs(scale - 1.0) < COORDINATE_LIMITS.edge:
        return
    text = (
        f"the clamp's radius is {view.outline.radius:.4g} mm in the files and "
        f"{view.nominal_radius:.4g} mm by nominal_radius: {scale_words(scale)}correct the "
        "calibration or length_unit, which change displacements as much"
    )
    yield Doubt("radius", abs(scale - 1.0) > COORDINATE_LIMITS.sure_edge, text)


#: Factors by which scales are often wrong, and how they come about.
USUAL_FACTORS = {
    2.54: "inches for centimetres",
    25.4: "inches for millimetres",
    10.0: "centimetres for millimetres",
    1000.0: "metres for millimetres",
    7.0: "the spacing of a calibration plate taken for its width",
}


def scale_words(scale: float) -> str:
    """Return words on a scale of lengths that is not 1, with its cause where the factor is usual.

    Parameters
    ----------
    scale : float
        Measured length over the stated one.
    """
    words = f"the scale of the coordinates is wrong by a factor of {scale:.3g}"
    for factor, cause in USUAL_FACTORS.items():
        if min(abs(scale / factor - 1), abs(scale * factor - 1)) < 0.05:
            words += f" ({cause}?)"
    return f"{words}, or the radius is: measure it with a ruler; "


def off_centre(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt an origin that is not the rim's centre."""
    rim = view.clamp or view.rim
    if rim is None:
        return
    offset = float(np.hypot(rim.x, rim.y))
    radius = view.outline.radius
    large = max(COORDINATE_LIMITS.centre * radius, COORDINATE_LIMITS.sigmas * rim.error)
    small = max(COORDINATE_LIMITS.small_centre * radius, COORDINATE_LIMITS.small_sigmas * rim.error)
    if not offset < min(large, small):
        text = (
            f"the sheet rises about x = {rim.x:.3g}, y = {rim.y:.3g} mm (+- {rim.error:.2g}), not "
            f"about the origin: {ADVICE}"
        )
        yield Doubt("off-centre", offset > COORDINATE_LIMITS.sure_centre * radius, text)


def rise_tilted(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a rise that is not along z: on average the sheet moves sideways."""
    motion = view.mean_motion
    if motion is None:
        return
    x, y, z = motion
    sideways = np.hypot(x, y)
    tilt = float(np.degrees(np.arctan2(sideways, abs(z)))) if z else 0.0
    if not tilt < COORDINATE_LIMITS.tilt:
        text = (
            f"the sheet moves along a line {tilt:.2g} degrees from z: its frame is tilted, or the "
            f"clamp moved; {ADVICE}"
        )
        yield Doubt("tilted", tilt > COORDINATE_LIMITS.sure_tilt, text)


def axes_turned(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt that warp and fill lie along x and y, or that an elliptic rim lies as it is said to."""
    if view.rim is None:
        return
    if not view.outline.round:
        angle = view.outline.angle
        turn = line_angle(view.rim.angle - angle)
        error = view.rim.turn_error
        text = (
            f"the sheet rises within an ellipse whose major axis lies {angle + turn:.3g} degrees "
            f"from x (+- {error:.2g}), not {angle:.3g}: is its angle right, and {ADVICE}"
        )
    elif view.axes is None or view.axes.clarity < COORDINATE_LIMITS.min_clarity:
        return
    else:
        turn = view.axes.misalignment
        error = view.axes.error
        text = (
            f"the fields are symmetric about axes {turn:.3g} degrees from x and y (+- "
            f"{error:.2g}): warp and fill lie there; {ADVICE}"
        )
    if not abs(turn) < max(COORDINATE_LIMITS.turn, COORDINATE_LIMITS.sigmas * error):
        yield Doubt("turned", False, text)


def yarns_swapped(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt warp and fill that seem swapped; an ellipse is strained more along its minor axis."""
    if not view.outline.round or not view.apexes:
        return
    if not view.expected.moduli or not view.expected.warp_is_stiffer:
        return
    warp, fill = view.apexes[-1].strain
    if len(view.apexes) > 1:
        # What the sheet's first shape adds to both frames cancels.
        warp = warp - view.apexes[0].strain[0]
        fill = fill - view.apexes[0].strain[1]
    if warp > COORDINATE_LIMITS.strain_ratio * fill > 0:
        text = (
            f"the centre is strained by {warp:.3g} along the warp and {fill:.3g} along the fill, "
            "and the bounds have the warp stiffer: warp and fill seem to be swapped"
        )
        yield Doubt("swapped", False, text)


@dataclass(frozen=True)
class UnitLimits:
    """Ranges of plausible lengths and moduli; lengths are in radii of the disk."""

    reach: tuple[float, float] = (0.2, 5.0)  # distance of the outermost point from the centre
    rise: tuple[float, float] = (0.004, 1.5)  # rise of the centre at the highest pressure
    modulus_factor: float = 1.1  # a modulus beyond its bounds by this factor is doubted
    min_strain: float = 0.002  # smaller strains are mostly due to the sheet's shape before the test
    contraction: float = 0.25  # Poisson's ratio, which is not known yet and matters little here


UNIT_LIMITS = UnitLimits()


def length_unit(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt mm taken for m, in places or in displacements."""
    reach = float(view.outline.share(view.last.points).max())
    rise = abs(float(view.rises[-1])) / view.outline.radius
    if not UNIT_LIMITS.reach[0] < reach < UNIT_LIMITS.reach[1]:
        text = (
            f"the outermost point is {reach:.3g} radii from the centre: are x and y in the length "
            "unit that is said, and is the radius right?"
        )
        yield Doubt("length-unit", True, text)
    if not UNIT_LIMITS.rise[0] < rise < UNIT_LIMITS.rise[1]:
        text = (
            f"the centre rises by {rise:.3g} radii at {view.highest_pressure} kPa: are the "
            "displacements in the length unit that is said (mm beside m)?"
        )
        yield Doubt("length-unit", True, text)


def pressure_unit(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt bar taken for kPa, or a wrong thickness, by the membrane force at the apex."""
    modulus = _apex_modulus(view)
    doubt = None
    if modulus is not None and view.expected.moduli:
        doubt = _modulus_doubt(view, modulus)
    problem = unit_doubt("pressure", 1e3 * view.last.pressure, "kPa", 1e-3)
    if doubt is None and problem:
        doubt = Doubt("pressure-unit", True, f"the highest pressure: {problem}")
    if doubt is not None:
        yield doubt
    else:
        yield from absolute_pressure(np.array([f.pressure for f in view.fields]), view.rises)


@dataclass(frozen=True)
class AbsolutePressure:
    """Hold the signs that pressures count from vacuum, not from the air around; in MPa."""

    air: tuple[float, float] = (0.085, 0.108)  # on high mountains, and in the deepest low
    first: float = 1.3  # the lowest pressure over the air's: the sheet has hardly risen there
    first_height: float = 0.5  # height there over the largest
    min_frames: int = 5


ABSOLUTE = AbsolutePressure()


def absolute_pressure(pressure: Array, height: Array) -> Iterator[Doubt]:
    """Doubt pressures that are about the air's where the sheet would not have risen.

    Parameters
    ----------
    pressure : (n,) array, MPa
    height : (n,) array, mm
        Of the centre, by rising pressure.
    """
    if len(height) < ABSOLUTE.min_frames or not 0 < height[0] < ABSOLUTE.first_height * height[-1]:
        return
    share = height / height[-1]
    # A flat sheet rises by p = a h + b h^3.
    at_rest = np.linalg.lstsq(share[:, None] ** [0, 1, 3], pressure)[0][0]
    low, high = ABSOLUTE.air
    if low < at_rest < high and at_rest / ABSOLUTE.first < pressure[0] < ABSOLUTE.first * at_rest:
        text = (
            f"the heights vanish at a pressure of {1e3 * at_rest:.3g} kPa, about the air's: is it "
            "absolute? Say by how much it exceeds the pressure of the air"
        )
        yield Doubt("pressure-unit", True, text)


def _modulus_doubt(view: MeasuredView, modulus: float) -> Doubt | None:
    """Return a doubt about the pressure if a modulus (MPa) lies beyond the bounds."""
    expected = view.expected
    names = ("E1", "E2")
    beyond_bounds = expected.outside(modulus, names, UNIT_LIMITS.modulus_factor)
    if not beyond_bounds:
        return None
    apex = view.apexes[-1]
    strain = 0.5 * sum(apex.strain)
    text = (
        f"equilibrium of the apex at {view.highest_pressure} kPa gives {apex.force:.3g} N/mm at a "
        f"strain of {strain:.3g}, a modulus of about {beyond_bounds}: is the pressure in the unit "
        "that is said (bar beside kPa), and are thickness and lengths right?"
    )
    text += pressure_remedy(modulus, expected.limits(names))
    return Doubt("pressure-unit", bool(expected.outside(modulus, names)), text)


def _apex_modulus(view: MeasuredView) -> float | None:
    """Return a rough modulus of the sheet from equilibrium of the apex, MPa.

    None where the apex is unknown or hardly strained.
    """
    if not view.apexes:
        return None
    apex = view.apexes[-1]
    if not np.isfinite(apex.force) or 0.5 * sum(apex.strain) < UNIT_LIMITS.min_strain:
        return None
    return apex.stiffness * (1 - UNIT_LIMITS.contraction) / view.thickness


# Points -----------------------------------------------------------------------------------------


def outliers(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt points far off the smooth surface through all."""
    by_frame = [view.gross_outliers(field) for field in view.fields]
    worst = max(by_frame, key=lambda frame: frame.count)
    if worst.count:
        frames = sum(frame.count > 0 for frame in by_frame)
        pressure = f"{1e3 * worst.field.pressure:.4g} kPa ({worst.count / worst.point_count:.1%})"
        text = (
            f"{worst.count} of {worst.point_count} points at {pressure}, and some in {frames} of "
            f"{len(by_frame)} frames, lie up to {worst.farthest:.3g} mm off the smooth surface "
            "through the others: a fit leaves them out where they are a tenth of a frame at most; "
            "mark them (flag_column), or correlate again"
        )
        yield Doubt("outliers", False, text)
    scattered = max(by_frame, key=lambda frame: frame.scatter)
    if scattered.scatter > CONSISTENCY.largest_scatter * view.rises.max() > 0:
        text = (
            f"dz scatters by {scattered.scatter:.2g} mm about a smooth surface at "
            f"{1e3 * scattered.field.pressure:.4g} kPa, where the centre rises by "
            f"{view.rises.max():.3g} mm: do places and displacements belong to the same points, "
            "in the same order?"
        )
        yield Doubt("outliers", True, text)


def repeated_points(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt rows of points that are given twice, and count twice."""
    last = view.last
    rows = np.column_stack([last.points, last.displacement])
    rows = rows[last.displacement.any(axis=1)]
    repeated = len(rows) - len(np.unique(rows, axis=0))
    if repeated:
        text = (
            f"{repeated} of {len(rows)} moving points at {view.highest_pressure} kPa are given "
            "twice, with the same place and displacement, and would count twice: bands would be "
            "too narrow"
        )
        yield Doubt("repeated-points", False, text)


def rejected_at_zero(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt points without correlation that were written as zeros."""
    displacement = view.last.displacement[view.inner(view.last)]
    count = len(displacement)
    still = int((displacement == 0).all(axis=1).sum())
    is_at_origin = (view.last.points == 0).all(axis=1)
    at_origin = int(is_at_origin.sum())
    rows = np.column_stack([view.last.points, view.last.displacement])[~is_at_origin]
    # Where rows of other points are repeated as often, so is that of the centre.
    repeats = np.unique(rows, axis=0, return_counts=True)[1].max(initial=1)
    signs = []
    if still > 0:
        signs.append(f"{still} of {count} points well within the rim do not move at all")
    if at_origin > repeats:
        signs.append(f"{at_origin} points lie at exactly x = y = 0")
    if signs:
        text = (
            f"{' and '.join(signs)} at {view.highest_pressure} kPa: points without correlation "
            "seem to be written as zeros; name the column that marks them (flag_column)"
        )
        yield Doubt("zero-points", True, text)


# Columns ----------------------------------------------------------------------------------------

#: Sign and column (0 or 1) of the data that is the true dx, then those of the true dy.
Assignment = tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class ConsistencyLimits:
    """Limits beyond which columns do not belong together."""

    dome_share: float = 0.2  # dz is not the rise if its dome is below this share of another's
    visible_dome: float = 0.004  # share of the radius: a lower dome is not seen
    errors: float = 4.0  # strain expected from the rise must exceed so many standard errors
    low_frame: float = 0.7  # first frame is subtracted if it rises by less than this share
    impossible: tuple[float, float] = (0.15, 6.0)  # strain over expected: impossible outside
    doubtful: tuple[float, float] = (0.4, 3.0)  # strain over expected: doubtful outside
    height_slope: float = 0.5  # slope of dz over z that is doubted; -1 where bumps are pulled flat
    largest_scatter: float = 0.05  # of dz, share of the highest rise: a camera scatters far less
    height_share: float = 0.003  # share of the radius: least RMS of bumps that can be judged


CONSISTENCY = ConsistencyLimits()


@dataclass(frozen=True, eq=False)
class StrainOfRise:
    """Measured strains of the centre compared with those expected from its rise.

    Attributes
    ----------
    principal_strains : (2,) array
        Measured principal strains, the smaller first.
    expected : (float, float)
        Expected strains along the long and along the short semi-axis.
    gradient : (2, 2) array
        Derivatives of dx and dy by x and y.
    rise : (float, float), mm
        Rise of the highest frame, and of the frame that is subtracted (0 without one).
    is_comparable : bool
        Whether the expected strain is so much larger than its error that they can be compared.
    """

    principal_strains: Array
    expected: tuple[float, float]
    gradient: Array
    rise: tuple[float, float]
    is_comparable: bool

    @property
    def ratios(self) -> tuple[float, float]:
        """Return the ratios of measured to expected strain.

        They are the smaller principal strain over that along the long semi-axis, and the larger
        over that along the short one.
        """
        smaller, larger = self.principal_strains
        long, short = self.expected
        return smaller / long, larger / short

    def is_outside(self, limits: tuple[float, float]) -> bool:
        """Return whether a ratio of measured to expected strain lies outside of the limits."""
        return not (limits[0] <= self.ratios[0] and self.ratios[1] <= limits[1])

    @property
    def assignment(self) -> Assignment:
        """Return the signs and columns of dx and dy with which dx grows most with x, dy with y."""
        candidates: list[Assignment] = [
            ((x_sign, x_column), (y_sign, y_column))
            for x_column, y_column in permutations((0, 1))
            for x_sign, y_sign in product((1, -1), repeat=2)
        ]
        return max(candidates, key=self._growth)

    def _growth(self, assignment: Assignment) -> float:
        """Return the sum of d(dx)/dx and d(dy)/dy with the signs and columns of an assignment."""
        (x_sign, x_column), (y_sign, y_column) = assignment
        return float(x_sign * self.gradient[x_column, 0] + y_sign * self.gradient[y_column, 1])


def strain_of_rise(low: CentreMotion | None, high: CentreMotion, outline: Outline) -> StrainOfRise:
    """Compare the strain of the centre with that expected from its rise, between two frames.

    The low frame is not subtracted where it is None or rises nearly as much as the high one.
    """
    strain = high.strain
    due = np.array(high.due_strains(outline))
    gradient = high.gradient[:2]
    error = high.error
    lower_rise = 0.0
    if low is not None and abs(low.dome[2]) < CONSISTENCY.low_frame * abs(high.dome[2]):
        strain = strain - low.strain
        due = due - low.due_strains(outline)
        gradient = gradient - low.gradient[:2]
        error = float(np.hypot(error, low.error))
        lower_rise = float(low.dome[2])
    return StrainOfRise(
        principal_strains=np.asarray(np.linalg.eigvalsh(strain), dtype=float),
        expected=(float(due[0]), float(due[1])),
        gradient=gradient,
        rise=(float(high.dome[2]), lower_rise),
        is_comparable=bool(due[0] > CONSISTENCY.errors * error),
    )


def slope_of_rise_over_bumps(field: DisplacementField, outline: Outline) -> float | None:
    """Return the slope of dz over the heights z of the sheet before the test.

    It is -1 where pressure pulls bumps of the sheet flat. Planes and terms symmetric about the
    centre, such as the dome of the bubble, are removed from both first. None where there are no
    heights, too few points, or bumps too small to be judged.
    """
    is_on_disk = outline.share(field.points) < 1.0
    if field.z is None or is_on_disk.sum() < MIN_POINTS:
        return None
    x, y = field.points[is_on_disk].T / outline.radius
    planar = ((0, 0), (1, 0), (0, 1))
    symmetric = ((2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
    smooth = np.stack([x**i * y**j for i, j in (*planar, *symmetric)], axis=1)
    z = field.z[is_on_disk]
    dz = field.displacement[is_on_disk, 2]
    z_and_dz = np.stack([z, dz], axis=1)
    if len(z_and_dz) < 2 * smooth.shape[1]:
        return None
    solution, *_ = np.linalg.lstsq(smooth, z_and_dz, rcond=None)
    heights, rises = (z_and_dz - smooth @ solution).T
    if np.sqrt(np.mean(heights**2)) < CONSISTENCY.height_share * outline.radius:
        return None
    return float(heights @ rises / (heights @ heights))


def spreads(fields: Sequence[DisplacementField]) -> tuple[Array, float]:
    """Return how far points spread: standard deviations of x, y, z (3,), mm, and a least one.

    The last is the smallest standard deviation in any direction of the x-y plane. They are those
    of the first field with heights; all are infinite where none has heights.
    """
    for field in fields:
        if field.z is not None and len(field.points) > 2:
            places = np.column_stack([field.points, field.z])
            within = np.linalg.eigvalsh(np.cov(field.points.T))[0]
            return places.std(axis=0), float(np.sqrt(max(within, 0.0)))
    return np.full(3, np.inf), np.inf


def upside_down(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a bubble that goes down as the pressure goes up: z is flipped."""
    if not view.rises[-1] >= 0:
        text = (
            f"the centre moves by {view.rises[-1]:.3g} mm along z at {view.highest_pressure} kPa: "
            "z is flipped; turn the axes, or let a registration find them"
        )
        yield Doubt("z-flipped", True, text)


def places_exchanged(view: MeasuredView) -> Iterator[Doubt]:
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


def rise_exchanged(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt displacements of which dz is not the rise: dx or dy has the dome."""
    motion = view.centre_motions[-1]
    if motion is None:
        return
    dx, dy, dz = np.abs(motion.dome)
    highest = max(dx, dy)
    is_visible = highest >= CONSISTENCY.visible_dome * view.outline.radius
    if not is_visible or dz > CONSISTENCY.dome_share * highest:
        return
    name = "dx" if dx > dy else "dy"
    text = (
        f"{name} is a dome of {highest:.3g} mm over the disk at {view.highest_pressure} kPa and dz "
        f"of {dz:.2g} mm, but the sheet rises along z: exchange {name} and dz, or the same two of "
        "x, y and z"
    )
    yield Doubt("exchanged", True, text)


def strain_unlike_rise(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt dx and dy that do not go with x and y, or not with the rise."""
    first = view.centre_motions[0]
    last = view.centre_motions[-1]
    if last is None:
        return
    low = first if len(view.fields) > 1 else None
    comparison = strain_of_rise(low, last, view.outline)
    doubtful, impossible = CONSISTENCY.doubtful, CONSISTENCY.impossible
    if view.counts_from_pressure:
        # Strains go with the square of the height, which is more than the rise since that pressure.
        doubtful, impossible = (doubtful[0], np.inf), (impossible[0], np.inf)
    if not comparison.is_comparable or not comparison.is_outside(doubtful):
        return
    smaller, larger = comparison.principal_strains
    rise, lower = comparison.rise
    due = " to ".join(dict.fromkeys(f"{strain:.2g}" for strain in comparison.expected))
    rises = f"a rise of {rise:.3g} mm" if not lower else f"a rise from {lower:.3g} to {rise:.3g} mm"
    text = (
        f"the centre is strained by {smaller:.2g} and {larger:.2g} (principal strains, of dx and "
        f"dy), and {rises} calls for about {due}"
    )
    is_sure = comparison.is_outside(impossible)
    # Exchanged or flipped columns are named only where the strain is impossible without them.
    name, remedy = _remedy(comparison.assignment) if is_sure else ("strain-rise", "")
    if not remedy:
        remedy = "are dx, dy and dz all there and in one unit, and is the radius right?"
    yield Doubt(name, is_sure, f"{text}: {remedy}")


def _remedy(assignment: Assignment) -> tuple[str, str]:
    """Return the name of a doubt and what to do so that dx grows with x, dy with y.

    The assignment is the sign and the column of the data that are the true dx, then those of the
    true dy. No remedy ("") where it is the data's own.
    """
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


def height_flipped(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt the sign of z: bumps of the sheet at rest grow, where pressure pulls them flat."""
    slope = slope_of_rise_over_bumps(view.last, view.outline)
    if slope is not None and slope > CONSISTENCY.height_slope:
        text = (
            f"dz follows the bumps of the heights z by {slope:+.0%} at {view.highest_pressure} "
            "kPa, but a sheet that is pulled flat loses them: change the sign of z"
        )
        yield Doubt("height-flipped", False, text)


# All --------------------------------------------------------------------------------------------

#: Later checks reckon with what earlier ones make sure of: a sure doubt ends the list.
CHECKS = (
    places_exchanged,
    rise_exchanged,
    length_unit,
    rejected_at_zero,
    outliers,
    repeated_points,
    upside_down,
    frame_order,
    repeated_frame,
    states_at_rest,
    same_states,
    deformed_coordinates,
    clamped_elsewhere,
    clamp_scale,
    strain_unlike_rise,
    pressure_unit,
    height_flipped,
    first_shape,
    loaded_reference,
    moving_edge,
    camera_height,
    off_centre,
    rise_tilted,
    axes_turned,
    yarns_swapped,
)


def doubts_of(view: MeasuredView) -> Sequence[Doubt]:
    """Return the doubts about measured fields, in the order of the checks up to a sure one."""
    doubts = [Doubt("frame-numbers", False, text) for text in view.number_doubts]
    doubts += [Doubt("pressure-log", False, text) for text in view.log_doubts]
    for check in CHECKS:
        doubts += check(view)
        if any(doubt.sure for doubt in doubts):
            break
    return doubts
