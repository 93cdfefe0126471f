"""Outline of a sheet: a circle, or an ellipse turned against the yarns."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from .mesh import Array


@dataclass(frozen=True)
class Outline:
    """An ellipse in the sheet's plane: semi-axes (mm), degrees from the warp to the major."""

    major: float
    minor: float
    angle: float = 0.0

    @classmethod
    def circle(cls, radius: float) -> Self:
        return cls(radius, radius)

    @property
    def round(self) -> bool:
        return self.major == self.minor

    @property
    def doubly_symmetric(self) -> bool:
        return self.round or self.angle % 90.0 == 0.0

    @property
    def radius(self) -> float:
        """Return the mean of the semi-axes, mm, with which lengths are compared."""
        return self.minor + 0.5 * (self.major - self.minor)

    @property
    def words(self) -> str:
        if self.round:
            return f"radius {self.major:g} mm"
        return f"semi-axes {self.major:g} and {self.minor:g} mm"

    @property
    def stretch(self) -> Array:
        """Return the symmetric map (2, 2) mm of the unit disk onto the disk."""
        turn = np.radians(self.angle)
        # The axes along the yarns are exactly so: 6e-17 would move nodes off lines of symmetry.
        along = np.round([np.cos(turn), np.sin(turn)], 15)
        return np.asarray(
            self.minor * np.eye(2) + (self.major - self.minor) * np.outer(along, along)
        )

    def places(self, points: Array) -> Array:
        """Return (n, 2) mm of points (n, 2) of the unit disk."""
        return np.asarray(points @ self.stretch)

    def unit(self, places: Array) -> Array:
        """Return (n, 2), points of the unit disk from places (n, 2) mm; the inverse of `places`."""
        if self.round:
            return np.asarray(places / self.major)
        return np.asarray(places @ np.linalg.inv(self.stretch))

    def share(self, places: Array) -> Array:
        """Return (n,) of places (n, 2) mm: 0 at the centre, 1 on the edge."""
        return np.asarray(np.hypot(*self.unit(places).T))

    def edge(self, count: int = 181) -> Array:
        """Return (count, 2) mm, once around, the last point the first."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        return self.places(np.column_stack([np.cos(turn), np.sin(turn)]))


def rim_form(points: Array) -> Array:
    """Return the symmetric Q (2, 2), 1/mm^2, with p Q p = 1 at rim nodes p (n, 2)."""
    size = float(np.abs(points).max())
    x, y = points.T / size
    terms = np.stack([x * x, 2 * x * y, y * y], axis=1)
    (xx, xy, yy), *_ = np.linalg.lstsq(terms, np.ones(len(points)), rcond=None)
    return np.array([[xx, xy], [xy, yy]]) / size**2


def rim_share(form: Array, points: Array) -> Array:
    """Return (n,) of points (n, 2) mm: 0 at the centre, 1 on the curve of the form."""
    return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", points, form, points)))
