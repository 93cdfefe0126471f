"""Nodal fields of a curved sheet read between its nodes: without the sag of flat quads.

A quad of edge h under a surface of curvature k sags by up to k h^2 / 4 between its nodes: 0.2 to
0.4 mm of an inflated bubble on a hundred quads, many times what a camera is uncertain by. The
nodes themselves are far better than that. So every node has a quadratic of its own, through its
value and as near as possible to its neighbours', and a point in a quad reads those of the four
corners, weighted by its bilinear shape functions. Nodal values are kept, quadratics are exact, and
what is read is continuous and linear in the nodal values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .location import sampling_matrix
from .mesh import Mesh

Array = NDArray[np.float64]

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
        """Of a mesh."""
        return cls(mesh, _quadratics(mesh))

    def matrix(self, points: Array) -> tuple[sp.csr_matrix, NDArray[np.bool_]]:
        """From the nodes to points (n, 2) mm.

        Returns
        -------
        matrix (inside points, nodes) and inside (n,): which points lie in the mesh at all.
        """
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
    """Nodes of the quads around each node, and of those around them where they are too few."""
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
