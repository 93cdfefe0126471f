"""Nodal fields of a curved sheet read between its nodes: without the sag of flat quads.

A quad of edge h under a surface of curvature k sags by up to k h^2 / 4 between its nodes: 0.2 to
0.4 mm of an inflated bubble on a hundred quads, many times what a camera is uncertain by. The nodes
themselves are far better than that. So every node has a quadratic of its own, through its value and
as near as possible to its neighbours', and a point in a quad reads those of the four corners,
weighted by its bilinear shape functions. Nodal values are kept, quadratics are exact, and what is
read is continuous and linear in the nodal values.

Image correlation does not see the displacement of a point. It fits a polynomial (its shape
function) to all that lies in a square facet around it and takes its value in the middle; most
programs then smooth neighbouring points. Both are linear: weights at places around the point, the
same for a model as for the fabric, so that the model can be read in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from .mesh import Array, Mesh, sampling_matrix

#: Neighbours that a node needs for its quadratic; with fewer, theirs are asked, too.
ENOUGH = 8
#: Of a quadratic without its constant: x, y, x^2, xy, y^2.
TERMS = 5


@dataclass(frozen=True, eq=False)
class SmoothReading:
    """A mesh in the xy plane whose nodal fields are read.

    quadratics : (5 nodes, nodes), takes nodal values to each node's slopes and curvatures.
    """

    mesh: Mesh
    quadratics: sp.csr_matrix

    @classmethod
    def of(cls, mesh: Mesh) -> SmoothReading:
        return cls(mesh, _quadratics(mesh))

    def matrix(self, points: Array) -> tuple[sp.csr_matrix, NDArray[np.bool_]]:
        """Return the matrix (inside points, nodes) to points (n, 2) mm, and inside (n,)."""
        bilinear, inside = sampling_matrix(self.mesh, points)
        shares = bilinear.tocoo()
        away = points[inside][shares.row] - self.mesh.points[shares.col, :2]
        values = shares.data[:, None] * _terms(away)
        columns = TERMS * shares.col[:, None] + np.arange(TERMS)
        rows = np.repeat(shares.row, TERMS)
        shape = (bilinear.shape[0], TERMS * len(self.mesh.points))
        curved = sp.csr_matrix((values.reshape(-1), (rows, columns.reshape(-1))), shape=shape)
        return sp.csr_matrix(bilinear + curved @ self.quadratics), inside


def _terms(away: Array) -> Array:
    x, y = away.T
    return np.stack([x, y, x * x, x * y, y * y], axis=1)


def _quadratics(mesh: Mesh) -> sp.csr_matrix:
    nodes = mesh.points[:, :2]
    count = len(nodes)
    rows, columns, values = [], [], []
    for node, near in enumerate(_neighbours(mesh)):
        away = nodes[near] - nodes[node]
        distance = np.hypot(*away.T)
        size = float(distance.max())
        weight = size / distance
        # Of the fewest-noded meshes not all terms are determined: the least of them are taken.
        solution = np.linalg.pinv(weight[:, None] * _terms(away / size), rcond=1e-8) * weight
        solution /= np.array([size, size, size**2, size**2, size**2])[:, None]
        own = TERMS * node + np.arange(TERMS)
        rows += [np.repeat(own, len(near)), own]
        columns += [np.tile(near, TERMS), np.full(TERMS, node)]
        values += [solution.reshape(-1), -solution.sum(axis=1)]
    shape = (TERMS * count, count)
    flat = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sp.csr_matrix(flat, shape=shape)


def _neighbours(mesh: Mesh) -> list[NDArray[np.intp]]:
    """Return nodes of the quads around each node, and of those around them where too few."""
    count, each = len(mesh.points), mesh.quads.shape[1]
    of_quad = np.repeat(np.arange(len(mesh.quads)), each)
    ones = np.ones(mesh.quads.size, dtype=np.int64)
    belongs = sp.csr_matrix(
        (ones, (of_quad, mesh.quads.reshape(-1))), shape=(len(mesh.quads), count)
    )
    beside = sp.csr_matrix(belongs.T @ belongs)
    further = sp.csr_matrix(beside @ beside)
    found = []
    for node in range(count):
        near = beside[node].indices
        if len(near) <= ENOUGH:
            near = further[node].indices
        found.append(np.sort(near[near != node]).astype(np.intp))
    return found


#: Gauss points along a side of a facet: exact for polynomials to the ninth degree.
GAUSS = 5
#: Of a facet, that has to lie in the mesh.
LEAST_SHARE = 0.5


@dataclass(frozen=True)
class Facet:
    """The way in which a camera's correlation sees a place.

    size : mm, side of the square facet in the reference picture. order : of its shape function, 1
    (the mean, and a slope) or 2. window : points along a side of the square over whose mean
    displacements are smoothed, odd. step : mm between neighbouring points, needed for a window.
    Raises InputError.
    """

    size: float
    order: int = 1
    window: int = 1
    step: float | None = None

    def __post_init__(self) -> None:
        if not self.size > 0:
            raise InputError(None, "facet", f"expected more than 0 mm, got {self.size:g}")
        if self.order not in (1, 2):
            raise InputError(None, "order", f"expected 1 or 2, got {self.order}")
        if self.window < 1 or self.window % 2 == 0:
            raise InputError(None, "smoothing", f"expected 1, 3, 5 ... points, got {self.window}")
        if self.window > 1 and self.step is None:
            raise InputError(None, "step", "this key is missing; smoothing needs it")

    @cached_property
    def places(self) -> tuple[Array, Array]:
        """Return (m, 2) mm from the middle of a facet, and the shares (m,) of its area there."""
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
        x, y = np.meshgrid(0.5 * self.size * nodes, 0.5 * self.size * nodes)
        return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel() / 4

    @cached_property
    def centres(self) -> Array:
        """Return (window^2, 2) mm, of the facets over which a point is smoothed."""
        half = (self.window - 1) // 2
        along = np.arange(-half, half + 1) * (self.step or 0.0)
        x, y = np.meshgrid(along, along)
        return np.column_stack([x.ravel(), y.ravel()])

    def weights(self, seen: NDArray[np.bool_]) -> Array:
        """Return (m,) weights of the places that the camera sees; zero of the others.

        By least squares over what is seen: a polynomial of the order keeps its value in the middle.
        """
        (x, y), share = self.places[0].T / self.size, self.places[1] * seen
        terms = [np.ones_like(x), x, y]
        if self.order == 2:
            terms += [x * x, x * y, y * y]
        v = np.column_stack(terms)
        first = np.linalg.pinv(v.T @ (share[:, None] * v))[0]
        return np.asarray((v @ first) * share)


@dataclass(frozen=True, eq=False)
class FacetReading:
    """A mesh in the xy plane whose nodal fields are read by facets."""

    reading: SmoothReading
    facet: Facet

    def matrix(self, points: Array) -> tuple[sp.csr_matrix, NDArray[np.bool_]]:
        """Return as `SmoothReading.matrix`; a facet over the edge reads the rest."""
        _, inside = self.reading.matrix(points)
        own = points[inside]
        total = sp.csr_matrix((len(own), len(self.reading.mesh.points)))
        count = np.zeros(len(own))
        for centre in self.facet.centres:
            read, seen = self._facets(own + centre)
            total = total + read
            count += seen
        # A point whose facet is all but outside is read as it is.
        alone = count == 0
        if alone.any():
            plain, _ = self.reading.matrix(own)
            total = total + sp.diags(alone.astype(float)) @ plain
        return sp.csr_matrix(sp.diags(1.0 / np.maximum(count, 1.0)) @ total), inside

    def _facets(self, middles: Array) -> tuple[sp.csr_matrix, Array]:
        """Return rows of facets, and 1 of each that counts; 0, with an empty row, of the others."""
        offsets, share = self.facet.places
        places = (middles[:, None] + offsets).reshape(-1, 2)
        read, inside = self.reading.matrix(places)
        seen = inside.reshape(len(middles), -1)
        counts = seen @ share >= LEAST_SHARE
        weights = np.zeros(seen.shape)
        known: dict[bytes, Array] = {}
        for row in np.flatnonzero(counts):
            key = seen[row].tobytes()
            if key not in known:
                known[key] = self.facet.weights(seen[row])
            weights[row] = known[key]
        columns = np.cumsum(inside) - 1
        rows = np.repeat(np.arange(len(middles)), seen.shape[1])
        flat = inside & np.repeat(counts, seen.shape[1])
        gather = sp.csr_matrix(
            (weights.reshape(-1)[flat], (rows[flat], columns[flat])),
            shape=(len(middles), read.shape[0]),
        )
        return sp.csr_matrix(gather @ read), counts.astype(float)
