"""Places on a specimen's triangulated surface, and the holes in it where correlation was lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .frames import Frame

if TYPE_CHECKING:
    from scipy.spatial import Delaunay

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Surface:
    """The correlated points of a frame, triangulated by their reference x and y.

    mesh : Delaunay triangles. places : (points, 2, 3) mm, before and after.
    """

    mesh: Delaunay
    places: Array

    def longest_edge(self, triangles: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Longest edge (triangles,) mm in the reference x and y."""
        corners = self.places[self.mesh.simplices[triangles], 0, :2]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return np.asarray(edges.max(axis=1))


def triangulated(frame: Frame, before: Surface | None = None) -> Surface | None:
    """The surface of a frame; None where fewer than three points, or a line, were correlated.

    before : a surface whose triangles are taken where the reference points are the same: most
        exports have the same points in every frame, and triangulating is what costs.
    """
    from scipy.spatial import Delaunay, QhullError

    places = np.stack([frame.points, frame.points + frame.displacement], axis=1)
    places = places[np.isfinite(places).all(axis=(1, 2))]
    if len(places) < 3:
        return None
    if before is not None and np.array_equal(places[:, 0, :2], before.places[:, 0, :2]):
        return Surface(before.mesh, places)
    try:
        return Surface(Delaunay(places[:, 0, :2]), places)
    except QhullError:  # all on one line
        return None


def usual_edge(surface: Surface) -> float:
    """Median over the triangles of their longest edge, mm."""
    return float(np.median(surface.longest_edge()))


def place_of(end: Array, surface: Surface | None, limit: float) -> Array | str:
    """Place (2, 3) mm before and after of the point (2,), or why there is none.

    limit : mm; a triangle with a longer edge spans a hole.
    """
    if surface is None:
        return "no three correlated points that span a surface"
    triangle, weights = _triangle_around(end, surface)
    if triangle < 0:
        return "outside the correlated points"
    widest = float(surface.longest_edge(np.array([triangle]))[0])
    if widest > limit:
        return f"the points around it are {widest:.3g} mm apart, allowed {limit:.3g}"
    corners = surface.places[surface.mesh.simplices[triangle]]
    return np.asarray(np.einsum("i,ijk->jk", weights, corners))


def _triangle_around(end: Array, surface: Surface) -> tuple[int, Array]:
    """The triangle that holds a point (2,), -1 for none, and the weights (3,) of its corners.

    By hand: Delaunay.find_simplex first inverts a matrix for every triangle, which costs more
    than triangulating.
    """
    x, y = np.moveaxis(surface.places[surface.mesh.simplices, 0, :2] - end, -1, 0)
    # Twice the areas that the point makes with the sides opposite to each corner.
    areas = np.roll(x, -1, 1) * np.roll(y, -2, 1) - np.roll(x, -2, 1) * np.roll(y, -1, 1)
    whole = areas.sum(axis=1, keepdims=True)
    weights = np.divide(areas, whole, out=np.full_like(areas, -1.0), where=whole != 0)
    best = int(np.argmax(weights.min(axis=1)))
    return (best if weights[best].min() >= -1e-9 else -1), weights[best]
