"""The clamped edge of a bubble test: a circle or an ellipse about the origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outline:
    """An ellipse in the plane of the sheet; warp is x, fill is y.

    Parameters
    ----------
    major, minor : mm, semi-axes; equal for a circle.
    angle : degrees from the warp towards the fill to the major one; without meaning for a circle.
    """

    major: float
    minor: float
    angle: float = 0.0

    @classmethod
    def circle(cls, radius: float) -> Outline:
        """Of a radius in mm."""
        return cls(radius, radius)

    @property
    def round(self) -> bool:
        """Whether it is a circle."""
        return self.major == self.minor

    @property
    def doubly_symmetric(self) -> bool:
        """Whether warp and fill are axes of symmetry."""
        return self.round or self.angle % 90.0 == 0.0

    @property
    def radius(self) -> float:
        """mm, mean of the semi-axes: what lengths are compared with."""
        return self.minor + 0.5 * (self.major - self.minor)

    @property
    def words(self) -> str:
        """For messages."""
        if self.round:
            return f"radius {self.major:g} mm"
        return f"semi-axes {self.major:g} and {self.minor:g} mm"

    @property
    def stretch(self) -> Array:
        """(2, 2) mm, symmetric: takes the unit disk onto the disk; a multiple of 1 for a circle."""
        turn = np.radians(self.angle)
        # The axes along the yarns are exactly so: 6e-17 would move nodes off lines of symmetry.
        along = np.round([np.cos(turn), np.sin(turn)], 15)
        return np.asarray(
            self.minor * np.eye(2) + (self.major - self.minor) * np.outer(along, along)
        )

    def places(self, points: Array) -> Array:
        """(n, 2) mm, where points (n, 2) of the unit disk lie."""
        return np.asarray(points @ self.stretch)

    def unit(self, places: Array) -> Array:
        """(n, 2), points of the unit disk from places (n, 2) mm; the inverse of `places`."""
        if self.round:
            return np.asarray(places / self.major)
        return np.asarray(places @ np.linalg.inv(self.stretch))

    def share(self, places: Array) -> Array:
        """(n,) of places (n, 2) mm: 0 at the centre, 1 on the edge."""
        return np.asarray(np.hypot(*self.unit(places).T))

    def edge(self, count: int = 181) -> Array:
        """(count, 2) mm, once around, the last point the first."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        return self.places(np.column_stack([np.cos(turn), np.sin(turn)]))
