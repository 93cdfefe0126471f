"""What the checks of a bubble test look at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ....data.equilibrium import Apex, apex_of
from ....data.fields import DisplacementField
from ....data.outline import Outline
from ....data.registration.directions import in_all_quarters
from ....data.registration.rim import Rim, rim_of_motion
from ....data.registration.symmetry import Axes, symmetry_axes
from ....errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """Measured fields by rising pressure, in the test's coordinates.

    outline : of the clamped edge. thickness : mm. registered : whether a registration brought
    them there.
    """

    fields: tuple[DisplacementField, ...]
    outline: Outline
    thickness: float
    registered: bool

    @property
    def radius(self) -> float:
        """mm, mean of the semi-axes where the edge is an ellipse."""
        return self.outline.radius

    @property
    def last(self) -> DisplacementField:
        """At the highest pressure."""
        return self.fields[-1]

    @cached_property
    def rises(self) -> Array:
        """(fields,) mm: median rise of the points within a quarter of the radius, or of all."""
        return np.array([self._rise(field) for field in self.fields])

    def _rise(self, field: DisplacementField) -> float:
        near = self.outline.share(field.points) < 0.25
        rise = field.displacement[near, 2] if near.any() else field.displacement[:, 2]
        return float(np.median(rise))

    @cached_property
    def apexes(self) -> tuple[Apex, ...]:
        """Of every field; none where there are too few points."""
        try:
            return tuple(apex_of(field, self.outline.minor) for field in self.fields)
        except (InputError, np.linalg.LinAlgError):
            return ()

    @cached_property
    def rim(self) -> Rim | None:
        """Where the sheet does not rise; None where points do not reach it all around.

        The turn of an ellipse is found, too.
        """
        high = [f for f, r in zip(self.fields, self.rises, strict=True) if r > 0.5 * self.rises[-1]]
        surfaces = [(f.points, f.displacement[:, 2]) for f in high]
        try:
            return rim_of_motion(surfaces, (self.outline.major, self.outline.minor))
        except InputError:
            return None

    @cached_property
    def axes(self) -> Axes | None:
        """About which the fields are symmetric; None where points lie on one side only.

        None, too, where the edge is an ellipse: its turn says more, and across the yarns there
        are no axes.
        """
        if not self.outline.round or not in_all_quarters(self.last.points):
            return None
        return symmetry_axes([field.frame for field in self.fields], self.radius)

    def inner(self, field: DisplacementField, share: float = 0.9) -> NDArray[np.bool_]:
        """Points well within the rim."""
        return np.asarray(self.outline.share(field.points) < share)
