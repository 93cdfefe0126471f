"""Doubts about the data of a bubble test: traps that measured fields may have fallen into.

Each check, one function in `CHECKS`, looks at the measured fields (`MeasuredView`) and yields
doubts. Here are those of points where the image correlation failed, and of the columns of places
(x, y, z) and of displacements (dx, dy, dz).

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
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...solvers.base import Array
from ..doubts import Doubt
from .coordinate_doubts import (
    axes_turned,
    camera_height,
    clamp_scale,
    clamped_elsewhere,
    length_unit,
    off_centre,
    pressure_unit,
    rise_tilted,
    yarns_swapped,
)
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
from .placement import SIGMA_PER_MAD, thinned
from .sheet import fit_disk_polynomial

# Points -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OutlierSearch:
    """Settings of the search for gross outliers about a smooth surface."""

    deviations: float = 10.0  # distance from the surface in robust standard deviations, and ...
    rise_share: float = 0.02  # ... as a share of the highest rise: an outlier exceeds both
    degree: int = 8  # degree of the polynomial surface
    rounds: int = 5  # largest number of times that outliers are left out and the fit is repeated
    disk_share: float = 0.95  # points within this share of the radius are judged
    max_points: int = 4000  # about the largest number of points judged in a frame, evenly thinned
    largest_scatter: float = 0.05  # share of the highest rise: a camera scatters far less


OUTLIERS = OutlierSearch()
Rows = NDArray[np.bool_]


@dataclass(frozen=True)
class GrossOutliers:
    """The gross outliers of a field: points far off the smooth surface through the others.

    Attributes
    ----------
    field : DisplacementField
    count : int
        Number of outliers.
    point_count : int
        Number of points that were judged.
    farthest : float, mm
        Largest distance of an outlier from the surface, in any component of the displacement.
    scatter : float, mm
        Robust standard deviation of the other points about the surface, in dz.
    is_outlying : (n,) bool array
        Which of all points of the field are outliers.
    """

    field: DisplacementField
    count: int
    point_count: int
    farthest: float
    scatter: float
    is_outlying: Rows


def outliers(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt points far off the smooth surface through all."""
    by_frame = [_gross_outliers(view, field) for field in view.fields]
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
    if scattered.scatter > OUTLIERS.largest_scatter * view.rises.max() > 0:
        text = (
            f"dz scatters by {scattered.scatter:.2g} mm about a smooth surface at "
            f"{1e3 * scattered.field.pressure:.4g} kPa, where the centre rises by "
            f"{view.rises.max():.3g} mm: do places and displacements belong to the same points, "
            "in the same order?"
        )
        yield Doubt("outliers", True, text)


def _gross_outliers(view: MeasuredView, field: DisplacementField) -> GrossOutliers:
    """Return the gross outliers of a field; none where there are too few points for a surface."""
    inner_rows = np.flatnonzero(view.inner(field, OUTLIERS.disk_share))
    is_outlying = np.zeros(len(field.points), dtype=bool)
    rows = thinned(inner_rows, OUTLIERS.max_points)
    points = field.points[rows]
    displacement = field.displacement[rows]
    is_kept = np.ones(len(points), dtype=bool)
    distance = np.zeros_like(displacement)
    deviation = np.zeros(3)
    radius = view.outline.major
    for _ in range(OUTLIERS.rounds):
        try:
            surface = fit_disk_polynomial(
                points[is_kept], displacement[is_kept], radius, OUTLIERS.degree
            )
        except InputError:
            return GrossOutliers(field, 0, len(points), 0.0, 0.0, is_outlying)
        distance = np.abs(displacement - surface.values_at(points))
        deviation = SIGMA_PER_MAD * np.median(distance[is_kept], axis=0)
        largest = np.maximum(
            OUTLIERS.deviations * deviation, OUTLIERS.rise_share * view.rises.max()
        )
        is_close = (distance <= largest).all(axis=1)
        if (is_close == is_kept).all():
            break
        is_kept = is_close
    of_all = np.abs(field.displacement[inner_rows] - surface.values_at(field.points[inner_rows]))
    is_outlying[inner_rows] = (of_all > largest).any(axis=1)
    farthest = float(distance[~is_kept].max(initial=0.0))
    count = int((~is_kept).sum())
    return GrossOutliers(
        field,
        count=count,
        point_count=len(points),
        farthest=farthest,
        scatter=float(deviation[2]),  # in dz
        is_outlying=is_outlying,
    )


def outlying_points(
    view: MeasuredView, field: DisplacementField, *, max_share: float = 0.1
) -> Rows:
    """Return which points of a field (n,) lie far off the smooth surface through the others.

    Parameters
    ----------
    view : MeasuredView
        The fields of the test.
    field : DisplacementField
    max_share : float
        Largest share of the points: of more it is not known which are wrong, and none is named.
    """
    is_outlying = _gross_outliers(view, field).is_outlying
    return is_outlying & (is_outlying.mean() <= max_share)


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
    at_origin = int((view.last.points == 0).all(axis=1).sum())
    signs = []
    if still > 0:
        signs.append(f"{still} of {count} points well within the rim do not move at all")
    if at_origin > 1:
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
    if not comparison.is_comparable or not comparison.is_outside(CONSISTENCY.doubtful):
        return
    smaller, larger = comparison.principal_strains
    rise, lower = comparison.rise
    due = " to ".join(dict.fromkeys(f"{strain:.2g}" for strain in comparison.expected))
    rises = f"a rise of {rise:.3g} mm" if not lower else f"a rise from {lower:.3g} to {rise:.3g} mm"
    text = (
        f"the centre is strained by {smaller:.2g} and {larger:.2g} (principal strains, of dx and "
        f"dy), and {rises} calls for about {due}"
    )
    is_sure = comparison.is_outside(CONSISTENCY.impossible)
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
