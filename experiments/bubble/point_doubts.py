"""Doubts about points of a bubble where the image correlation was wrong or failed."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...readers.fields import DisplacementField
from ..doubts import Doubt
from .measured_view import MeasuredView
from .placement import SIGMA_PER_MAD, thinned
from .sheet import fit_disk_polynomial


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
