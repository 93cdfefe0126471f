"""The measured fields of a bubble as checks look at them before a fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.outline import Outline
from ...readers.fields import DisplacementField
from ...solvers.base import Array
from .apex import Apex, apex_of
from .column_consistency import CentreMotion, ConsistencyLimits, centre_motion
from .placement import in_all_quarters
from .registration import are_usable
from .rim import Rim, RiseSurface, clamp_of_motion, rim_of_motion
from .symmetry import Axes, symmetry_axes

CONSISTENCY = ConsistencyLimits()


@dataclass(frozen=True, eq=False)
class View:
    """Measured fields by rising pressure, in the test's coordinates.

    Attributes
    ----------
    fields : tuple of DisplacementField
    outline : Outline, mm
    thickness : float, mm
    registered : bool
        Whether a registration found the coordinates.
    flat : bool
        Whether nothing is said of the sheet's first shape.
    numbers : sequence of str
        Doubts about the frames' numbers.
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
    def highest_pressure(self) -> str:
        """Return the highest pressure, kPa."""
        return f"{1e3 * self.last.pressure:.4g}"

    @cached_property
    def rises(self) -> Array:
        """Return (fields,) mm: median rise of points within a quarter of the radius, or of all."""
        rises = []
        for field in self.fields:
            rise = field.displacement[:, 2]
            is_central = self.outline.share(field.points) < 0.25
            rises.append(np.median(rise[is_central] if is_central.any() else rise))
        return np.array(rises)

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
        ends = self.fields[:: max(1, len(self.fields) - 1)]
        return tuple(centre_motion(field, self.outline, CONSISTENCY) for field in ends)

    @property
    def surfaces(self) -> list[RiseSurface]:
        """Return positions and rises (mm) of the high frames."""
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
        """Find the rim, of an ellipse its turn; None where points do not reach it all around."""
        try:
            return rim_of_motion(self.surfaces, (self.outline.major, self.outline.minor))
        except InputError:
            return None

    @cached_property
    def axes(self) -> Axes | None:
        """Find the axes of symmetry; None of an ellipse or where points lie on one side only."""
        if not self.outline.round or not in_all_quarters(self.last.points):
            return None
        return symmetry_axes([field.frame for field in self.fields], self.outline.radius)

    @property
    def registration_estimates(self) -> dict[str, float]:
        """Return what the fields alone say of the frame, as it makes up for it.

        Turn of the yarns, tilts about x and y (degrees), shifts (mm); what is not clear is left
        out.
        """
        estimates = {}
        axes = self.axes
        if axes and are_usable(axes):
            estimates["turn"] = axes.off
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
        """Return the mean motion (3,) mm well within the rim, from the first frame to the last.

        That of a single frame as it stands; None without points there.
        """
        if not self.inner(self.last).any():
            return None
        first = self._mean_motion_of(self.fields[0]) * (len(self.fields) > 1)
        return self._mean_motion_of(self.last) - first

    def _mean_motion_of(self, field: DisplacementField) -> Array:
        """Return (3,) mm over points with others across the centre: a lost side is no tilt."""
        is_inner = self.inner(field)
        points = field.points[is_inner]
        tree = scipy.spatial.cKDTree(field.points[is_inner])
        max_distance = 2.0 * np.median(tree.query(points, 2)[0][:, 1])
        is_paired = tree.query(-points)[0] < max_distance
        displacement = field.displacement[is_inner]
        return np.asarray(displacement[is_paired if is_paired.any() else ...].mean(axis=0))

    def inner(self, field: DisplacementField, share: float = 0.9) -> NDArray[np.bool_]:
        """Return which points lie well within the rim."""
        return np.asarray(self.outline.share(field.points) < share)
