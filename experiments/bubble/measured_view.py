"""The measured fields of a bubble with the quantities derived from them that checks judge.

Checks find doubts about the data before a fit; nothing here needs a model.
"""

from collections.abc import Sequence
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
from .apex import Apex, apex_of
from .column_consistency import CentreMotion, ConsistencyLimits, centre_motion
from .placement import in_all_quarters
from .registration import are_usable
from .rim import Rim, RiseSurface, clamp_of_motion, rim_of_motion
from .symmetry import Axes, symmetry_axes

CONSISTENCY = ConsistencyLimits()


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
        return tuple(centre_motion(field, self.outline, CONSISTENCY) for field in ends)

    @property
    def surfaces(self) -> list[RiseSurface]:
        """Return positions and rises (mm) of the fields that rise by over half of the last rise."""
        return [
            (field.points, field.displacement[:, 2])
            for field, rise in zip(self.fields, self.rises, strict=True)
            if rise > 0.5 * self.rises[-1]
        ]

    @cached_property
    def clamp(self) -> Rim | None:
        """Find the edge of the clamp; None where no points stand still around the disk."""
        outline = self.outline
        return clamp_of_motion(self.surfaces, (outline.major, outline.minor), outline.angle)

    @cached_property
    def rim(self) -> Rim | None:
        """Find the rim and the turn of an ellipse; None where points do not reach all around it."""
        try:
            return rim_of_motion(self.surfaces, (self.outline.major, self.outline.minor))
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
