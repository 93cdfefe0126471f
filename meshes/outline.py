"""Outline of the sheet in a bubble test: a circle, or an ellipse at any angle to the yarns."""

from typing import Self

import numpy as np

from ..light_dataclasses import dataclass
from .mesh import Array


@dataclass(frozen=True)
class Outline:
    """A circle or an ellipse in the plane of the sheet (x: warp, y: fill), around the origin.

    Attributes
    ----------
    major, minor : float, mm
        Semi-axes, the larger one first.
    angle : float, degrees
        From the warp towards the fill, to the major axis.
    """

    major: float
    minor: float
    angle: float = 0.0

    @classmethod
    def circle(cls, radius: float) -> Self:
        """Return a circle of a radius (mm)."""
        return cls(radius, radius)

    @property
    def round(self) -> bool:
        """Return whether it is a circle."""
        return self.major == self.minor

    @property
    def doubly_symmetric(self) -> bool:
        """Return whether it is symmetric about warp and fill."""
        return self.round or self.angle % 90.0 == 0.0

    @property
    def radius(self) -> float:
        """Return the mean of the semi-axes in mm, as the typical size of the sheet."""
        return self.minor + 0.5 * (self.major - self.minor)

    @property
    def dome_radius(self) -> float:
        """Return the radius in mm of the circular sheet that rises as high as this one, if taut."""
        return float(np.sqrt(2.0) * self.major * self.minor / np.hypot(self.major, self.minor))

    @property
    def words(self) -> str:
        """Return the radius or the semi-axes in words."""
        if self.round:
            return f"radius {self.major:g} mm"
        return f"semi-axes {self.major:g} and {self.minor:g} mm"

    @property
    def stretch(self) -> Array:
        """Return the symmetric matrix (2, 2) mm that maps the unit disk onto the sheet."""
        turn = np.radians(self.angle)
        # The axes along the yarns are exactly so: 6e-17 would move nodes off lines of symmetry.
        along = np.round([np.cos(turn), np.sin(turn)], 15)
        return self.minor * np.eye(2) + (self.major - self.minor) * np.outer(along, along)

    def places(self, points: Array) -> Array:
        """Return the places (n, 2) mm on the sheet of points (n, 2) of the unit disk."""
        return points @ self.stretch

    def unit(self, places: Array) -> Array:
        """Return the points (n, 2) of the unit disk that `places` maps to places (n, 2) mm."""
        if self.round:
            return places / self.major
        return places @ np.linalg.inv(self.stretch)

    def share(self, places: Array) -> Array:
        """Return the relative distance (n,) of places (n, 2) mm: 0 at the centre, 1 on the edge."""
        return np.hypot(*self.unit(places).T)

    def edge(self, count: int = 181) -> Array:
        """Return points (count, 2) mm around the edge; the last one is the first one again."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        return self.places(np.column_stack([np.cos(turn), np.sin(turn)]))


def rim_form(points: Array) -> Array:
    """Return the matrix Q (2, 2), 1/mm^2, of the ellipse p' Q p = 1 through nodes of a rim.

    Parameters
    ----------
    points : array
        Positions p of the nodes, (n, 2) mm; Q is fitted to them by least squares.
    """
    size = float(np.abs(points).max())
    x, y = points.T / size
    terms = np.stack([x * x, 2 * x * y, y * y], axis=1)
    (xx, xy, yy), *_ = np.linalg.lstsq(terms, np.ones(len(points)), rcond=None)
    return np.array([[xx, xy], [xy, yy]]) / size**2


def rim_share(form: Array, points: Array) -> Array:
    """Return the relative distance (n,) of points (n, 2) mm: 0 at the centre, 1 on the ellipse.

    Parameters
    ----------
    form : array
        Matrix of the ellipse, see `rim_form`.
    """
    return np.sqrt(np.einsum("ni,ij,nj->n", points, form, points))
