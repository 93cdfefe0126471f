"""The measured fields of a bubble with the quantities derived from them that checks judge.

Checks find doubts about the data before a fit; nothing here needs a model. Gross outliers, points
far off all others, are left out of a fit, too.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...solvers.base import Array
from ..doubts import UNKNOWN, Expected
from .field_shape import Apex, Axes, apex_of, symmetry_axes
from .placement import (
    SIGMA_PER_MAD,
    Rim,
    RiseSurface,
    clamp_of_motion,
    in_all_quarters,
    rim_of_motion,
    thinned,
)
from .registration import are_usable
from .sheet import fit_disk_polynomial

#: Fewest points on the disk to which a motion, or the sheet's bumps, are fitted: four terms.
MIN_POINTS = 12


@dataclass(frozen=True, eq=False)
class CentreMotion:
    """Displacements at the centre by a fit of terms that vanish at the rim, and a constant.

    Attributes
    ----------
    dome : (3,) array, mm
        Displacements dx, dy, dz of the centre relative to the rim.
    gradient : (3, 2) array
        Derivatives of dx, dy, dz by x and y at the centre.
    error : float
        Standard error of an in-plane element of the gradient.
    """

    dome: Array
    gradient: Array
    error: float

    @property
    def strain(self) -> Array:
        """Return the Green-Lagrange strain (2, 2) of the centre."""
        in_plane = self.gradient[:2]
        return 0.5 * (in_plane + in_plane.T + self.gradient.T @ self.gradient)

    def due_strains(self, outline: Outline) -> tuple[float, float]:
        """Return the strains 2/3 (h/R)^2 expected from the rise, along long and short semi-axis."""
        rise = abs(float(self.dome[2]))
        long = max(outline.major, outline.minor)
        short = min(outline.major, outline.minor)
        return 2.0 / 3.0 * (rise / long) ** 2, 2.0 / 3.0 * (rise / short) ** 2


def _centre_motion(field: DisplacementField, outline: Outline) -> CentreMotion | None:
    """Fit the motion about the centre of a field by least squares.

    Return None where too few points lie on the disk, or they do not determine it.
    """
    share = outline.share(field.points)
    is_on_disk = share < 1.0
    points = field.points[is_on_disk]
    displacement = field.displacement[is_on_disk]
    if len(points) < MIN_POINTS:
        return None
    size = 0.5 * (outline.major + outline.minor)
    clamped = (1.0 - share[is_on_disk] ** 2)[:, None]
    terms = np.hstack([clamped, clamped * points / size, np.ones_like(clamped)])
    solution, _, rank, _ = np.linalg.lstsq(terms, displacement, rcond=1e-9)
    if rank < terms.shape[1]:
        return None
    residual = displacement[:, :2] - terms @ solution[:, :2]
    degrees_of_freedom = 2 * (len(points) - terms.shape[1])
    variance = float((residual**2).sum()) / degrees_of_freedom
    inverse = np.linalg.inv(terms.T @ terms)
    spread = inverse[1:3, 1:3].trace() / 2
    error = float(np.sqrt(variance * spread)) / size
    return CentreMotion(solution[0], np.asarray(solution[1:3].T / size), error)


@dataclass(frozen=True)
class OutlierSearch:
    """Settings of the search for gross outliers about a smooth surface."""

    deviations: float = 10.0  # distance from the surface in robust standard deviations, and ...
    first_deviations: float = 4.0  # the same while outliers still spoil the surface
    first_rounds: int = 3
    rise_share: float = 0.02  # ... as a share of the highest rise: an outlier exceeds both
    degree: int = 8  # degree of the polynomial surface
    rounds: int = 8  # largest number of times that outliers are left out and the fit is repeated
    disk_share: float = 0.95  # points within this share of the radius are judged
    max_points: int = 4000  # about the largest number of points judged in a frame, evenly thinned


OUTLIERS = OutlierSearch()


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
    is_outlying: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MeasuredView:
    """Measured fields by rising pressure, in the test's coordinates, and what follows from them.

    Attributes
    ----------
    fields : tuple of DisplacementField
    outline : Outline, mm
        The rim.
    thickness : float, mm
        Thickness of the fabric.
    is_registered : bool
        Whether the coordinates were found by a registration (otherwise the files are in them).
    is_flat : bool
        Whether the fit takes the sheet for flat before the test.
    number_doubts : sequence of str
        Texts of doubts about the frames' numbers.
    log_doubts : sequence of str
        Texts of doubts about the log of the pressure.
    nominal_radius : float, mm, or None
        Radius of the clamp by a ruler, where the radius is that of the measured points.
    counts_from_pressure : bool
        Whether displacements count from a frame under pressure.
    moving_rim : bool
        Whether the fit's rim moves as it was measured.
    expected : Expected
        Bounds of the moduli, as far as they are known.
    """

    fields: tuple[DisplacementField, ...]
    outline: Outline
    thickness: float
    is_registered: bool
    is_flat: bool = False
    number_doubts: Sequence[str] = ()
    log_doubts: Sequence[str] = ()
    nominal_radius: float | None = None
    counts_from_pressure: bool = False
    moving_rim: bool = False
    expected: Expected = UNKNOWN

    @property
    def last(self) -> DisplacementField:
        """Return the field at the highest pressure."""
        return self.fields[-1]

    @property
    def highest_pressure(self) -> str:
        """Return the highest pressure in kPa, as text."""
        return f"{1e3 * self.last.pressure:.4g}"

    @cached_property
    def rises(self) -> Array:
        """Return the rise of the centre in each field, (fields,) mm.

        It is the median rise of the points within a quarter of the radius, or of all points where
        there are none.
        """
        rises = []
        for field in self.fields:
            rise = field.displacement[:, 2]
            is_central = self.outline.share(field.points) < 0.25
            rises.append(np.median(rise[is_central] if is_central.any() else rise))
        return np.array(rises)

    @cached_property
    def apexes(self) -> tuple[Apex, ...]:
        """Return the apex of every field; empty where one has too few points."""
        try:
            return tuple(apex_of(field, self.outline.minor) for field in self.fields)
        except (InputError, np.linalg.LinAlgError):
            return ()

    @cached_property
    def centre_motions(self) -> tuple[CentreMotion | None, ...]:
        """Return the motion about the centre in the first and in the last field.

        It is None where a field has too few points; with one field there is one entry.
        """
        ends = self.fields[:: max(1, len(self.fields) - 1)]
        return tuple(_centre_motion(field, self.outline) for field in ends)

    @property
    def surfaces(self) -> list[RiseSurface]:
        """Return positions and rises (mm) of the fields that rise by over half of the last rise.

        There are none where the sheet falls.
        """
        return [
            (field.points, field.displacement[:, 2])
            for field, rise in zip(self.fields, self.rises, strict=True)
            if rise > max(0.5 * self.rises[-1], 0.0)
        ]

    @cached_property
    def clamp(self) -> Rim | None:
        """Find the edge of the clamp; None where no points stand still around a disk that rises."""
        return self._find_rim(clamp_of_motion, self.outline.angle)

    @cached_property
    def rim(self) -> Rim | None:
        """Find the rim and the turn of an ellipse; None where points do not reach all around it."""
        return self._find_rim(rim_of_motion)

    def _find_rim(self, search: Callable[..., Rim | None], *angle: float) -> Rim | None:
        """Search the fields that rise for a rim; None where there are none, or too few points."""
        if not self.surfaces:
            return None
        try:
            return search(self.surfaces, (self.outline.major, self.outline.minor), *angle)
        except InputError:
            return None

    @cached_property
    def axes(self) -> Axes | None:
        """Find the axes of symmetry; None for an elliptic rim, or without points all around."""
        if not self.outline.round or not in_all_quarters(self.last.points):
            return None
        return symmetry_axes([field.frame for field in self.fields], self.outline.radius)

    @property
    def registration_estimates(self) -> dict[str, float]:
        """Return misalignments of the coordinate system, estimated from the fields alone.

        They have the signs with which the fit corrects them: "turn" of the yarns, "tilt_x" and
        "tilt_y" about x and y (degrees), "shift_x" and "shift_y" (mm). What the fields do not show
        clearly is left out.
        """
        estimates = {}
        axes = self.axes
        if axes and are_usable(axes):
            estimates["turn"] = axes.misalignment
        motion = self.mean_motion
        if motion is not None and motion[2] > 0:
            x, y, z = motion
            estimates["tilt_x"] = -float(np.degrees(np.arctan2(y, z)))
            estimates["tilt_y"] = float(np.degrees(np.arctan2(x, np.hypot(y, z))))
        rim = self.clamp or self.rim
        if rim is not None:
            estimates |= {"shift_x": -rim.x, "shift_y": -rim.y}
        return estimates

    @property
    def mean_motion(self) -> Array | None:
        """Return the mean motion (3,), mm, of points well within the rim, first to last field.

        With a single field it is the mean displacement; None without points there.
        """
        if not self.inner(self.last).any():
            return None
        first = self._mean_motion_of(self.fields[0]) * (len(self.fields) > 1)
        return self._mean_motion_of(self.last) - first

    def _mean_motion_of(self, field: DisplacementField) -> Array:
        """Return the mean displacement (3,), mm, of the inner points of a field.

        Only points with a counterpart across the centre count, so that a side without points does
        not look like a tilt; all count where none has one.
        """
        is_inner = self.inner(field)
        points = field.points[is_inner]
        tree = scipy.spatial.cKDTree(field.points[is_inner])
        max_distance = 2.0 * np.median(tree.query(points, 2)[0][:, 1])
        is_paired = tree.query(-points)[0] < max_distance
        displacement = field.displacement[is_inner]
        return displacement[is_paired if is_paired.any() else ...].mean(axis=0)

    def inner(self, field: DisplacementField, share: float = 0.9) -> NDArray[np.bool_]:
        """Return which points (n,) of a field lie within a share of the rim's radius."""
        return self.outline.share(field.points) < share

    def expecting(self, expected: Expected) -> MeasuredView:
        """Return the view with bounds of the moduli, and with what has followed from it so far."""
        view = copy.copy(self)
        object.__setattr__(view, "expected", expected)
        return view

    @cached_property
    def _outliers_by_field(self) -> dict[DisplacementField, GrossOutliers]:
        """Return the outliers of the fields in which they were searched so far."""
        return {}

    def gross_outliers(self, field: DisplacementField) -> GrossOutliers:
        """Return the gross outliers of a field; none where it has too few points for a surface."""
        if field not in self._outliers_by_field:
            self._outliers_by_field[field] = self._search_outliers(field)
        return self._outliers_by_field[field]

    def _search_outliers(self, field: DisplacementField) -> GrossOutliers:
        """Fit a smooth surface to all points of a field but those far off it."""
        inner_rows = np.flatnonzero(self.inner(field, OUTLIERS.disk_share))
        is_outlying = np.zeros(len(field.points), dtype=bool)
        rows = thinned(inner_rows, OUTLIERS.max_points)
        points = field.points[rows]
        displacement = field.displacement[rows]
        is_kept = np.ones(len(points), dtype=bool)
        distance = np.zeros_like(displacement)
        deviation = np.zeros(3)
        radius = self.outline.major
        for number in range(OUTLIERS.rounds):
            is_first = number < OUTLIERS.first_rounds
            deviations = OUTLIERS.first_deviations if is_first else OUTLIERS.deviations
            try:
                surface = fit_disk_polynomial(
                    points[is_kept], displacement[is_kept], radius, OUTLIERS.degree
                )
            except InputError:
                return GrossOutliers(field, 0, len(points), 0.0, 0.0, is_outlying)
            distance = np.abs(displacement - surface.values_at(points))
            deviation = SIGMA_PER_MAD * np.median(distance[is_kept], axis=0)
            largest = np.maximum(deviations * deviation, OUTLIERS.rise_share * self.rises.max())
            is_close = (distance <= largest).all(axis=1)
            if not is_first and (is_close == is_kept).all():
                break
            is_kept = is_close
        of_all = np.abs(
            field.displacement[inner_rows] - surface.values_at(field.points[inner_rows])
        )
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
        self, field: DisplacementField, *, max_share: float = 0.1
    ) -> NDArray[np.bool_]:
        """Return which points of a field (n,) lie far off the smooth surface through the others.

        Parameters
        ----------
        field : DisplacementField
        max_share : float
            Largest share of the points: of more it is not known which are wrong, and none is named.
        """
        is_outlying = self.gross_outliers(field).is_outlying
        return is_outlying & (is_outlying.mean() <= max_share)
