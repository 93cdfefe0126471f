"""Bending stiffness of the wall, without which wrinkles become as fine as the mesh.

It needs no rotational unknowns. Where a line of the mesh runs through the nodes x_-, x_0, x_+ with
the distances l_- and l_+, the curvature vector along it is the second difference
    c = [(x_+ - x_0)/l_+ - (x_0 - x_-)/l_-] / h,   h = (l_+ + l_-)/2,
and the energy of the node is D/2 c.c times its share of the surface, where D is the bending
stiffness per unit of width (Bergou et al., Symposium on Geometry Processing 2006, for the lines of
a grid). This is quadratic in the positions, so that the stiffness matrix is constant. The sheet is
taken to be flat when no load acts, and twist is neglected.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...meshes.mesh import Array, Numbers
from .membrane import initial_stiffness

#: Cosine of the largest angle by which a line of the mesh may turn at a node. A sharper edge, like
#: the rim of a cap, is a seam that transfers no moment.
STRAIGHT = 0.7


@dataclass(frozen=True, eq=False)
class Flexure:
    """Discrete curvatures of a mesh: h triples of nodes that follow each other along a line.

    Attributes
    ----------
    nodes : (h, 3) ndarray of int
        The node before, the node itself and the node after. At a plane of symmetry the first and
        the last are the same node, one of them meaning its mirror image.
    differences : (h, 3, 3) ndarray, 1/mm^2
        Coefficient of the position of each of the three nodes, by component, in the curvature.
    shares : (h, 2) ndarray, mm^5
        Area times thickness^3 / 12 that bends along the warp and along the fill.
    """

    nodes: Numbers
    differences: Array
    shares: Array

    def stiffness(self, law: HypoelasticLaw) -> Array:
        """Return the stiffness of each triple, (h, 3 components, 3 nodes, 3 nodes) N/mm.

        It is computed with the moduli of the law at zero strain.
        """
        plane = np.diagonal(initial_stiffness(law))[:2]
        c = self.differences
        return np.einsum("h,hai,hbi->hiab", self.shares @ plane, c, c)

    def matrix(self, law: HypoelasticLaw, count: int) -> scipy.sparse.csr_matrix:
        """Return the stiffness matrix (3 count, 3 count) N/mm of all unknowns of `count` nodes."""
        values = self.stiffness(law)
        unknowns = 3 * self.nodes[:, None, :] + np.arange(3)[:, None]  # (h, 3, 3)
        rows = np.broadcast_to(unknowns[..., :, None], values.shape)
        columns = np.broadcast_to(unknowns[..., None, :], values.shape)
        triples = (values.ravel(), (rows.ravel(), columns.ravel()))
        return scipy.sparse.csr_matrix(triples, shape=(3 * count, 3 * count))


def flexure_of(
    points: Array,
    quads: Numbers,
    warp: Array,
    thickness: Array,
    planes: NDArray[np.bool_],
) -> Flexure:
    """Find the triples of nodes on lines of a mesh, and how the wall bends along each.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (m, 4) array of int
    warp : (m, 3) array
        Direction of the warp.
    thickness : float or (m,) array, mm
    planes : (n, 3) array of bool
        Whether an open edge at the node lies in the plane of symmetry normal to each axis.

    Returns
    -------
    Flexure
    """
    share, inertia, along = _of_nodes(points, quads, warp, thickness)
    triples = list(MeshLines(points, quads, planes).through_nodes())
    nodes = np.array([triple[:3] for triple in triples], dtype=np.intp).reshape(-1, 3)
    mirror = np.array([triple[3] for triple in triples]).reshape(-1, 3)
    previous_node, node, next_node = nodes.T
    is_mirrored = (previous_node == next_node)[:, None]
    step = points[next_node] - points[node]
    back = np.where(is_mirrored, -mirror * step, points[node] - points[previous_node])
    ahead = np.linalg.norm(step, axis=1)[:, None]
    behind = np.linalg.norm(back, axis=1)[:, None]
    ones = np.ones((len(nodes), 3))
    slopes = np.stack([mirror / behind, -ones / behind - ones / ahead, ones / ahead], axis=1)
    # Components normal to a plane of symmetry are equal on both sides and cancel.
    slopes *= (~is_mirrored | (mirror > 0))[:, None]
    differences = slopes / (0.5 * (ahead + behind))[:, None]
    direction = step / ahead + back / behind
    size = np.linalg.norm(direction, axis=1)
    cosine = np.einsum("hk,hk->h", direction, along[node]) / np.where(size > 0, size, 1.0)
    warps = np.minimum(1.0, cosine**2)
    bends = np.stack([warps**2, (1.0 - warps) ** 2], axis=1)
    shares = (share[node] * inertia[node])[:, None] * bends
    is_straight = np.einsum("hk,hk->h", step, back) >= STRAIGHT * (ahead * behind)[:, 0]
    return Flexure(nodes[is_straight], differences[is_straight], shares[is_straight])


def _of_nodes(
    points: Array,
    quads: Numbers,
    warp: Array,
    thickness: Array,
) -> tuple[Array, Array, Array]:
    """Return three properties of every node.

    They are its share of the surface (n,) mm^2, the mean of thickness^3 / 12 over that share (n,)
    mm^3, and the unit vector (n, 3) of the warp in the surface.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (m, 4) array of int
    warp : (m, 3) array
        Direction of the warp.
    thickness : float or (m,) array, mm
    """
    corner = points[quads]
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    area = 0.5 * np.linalg.norm(across, axis=1)
    normal = across / (2.0 * area[:, None])
    flat = warp - np.einsum("mk,mk->m", warp, normal)[:, None] * normal
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    share = np.zeros(len(points))
    cube = np.zeros(len(points))
    along = np.zeros(points.shape)
    np.add.at(share, quads, 0.25 * area[:, None])
    np.add.at(cube, quads, 0.25 * (area * np.broadcast_to(thickness, area.shape) ** 3)[:, None])
    np.add.at(along, quads, flat[:, None])
    inertia = cube / (12.0 * np.where(share > 0, share, 1.0))
    length = np.linalg.norm(along, axis=1)[:, None]
    return share, inertia, along / np.where(length > 0, length, 1.0)


class MeshLines:
    """The lines of a mesh of quads: through every node, the neighbours opposite to each other.

    Attributes
    ----------
    planes : (n, 3) array of bool
        Whether a node lies on the plane of symmetry that is normal to each axis.
    quads_by_neighbour : list of dict
        For each node a dictionary from each neighbour along an edge to the numbers of the quads
        that share this edge.
    """

    def __init__(self, points: Array, quads: Numbers, planes: NDArray[np.bool_]) -> None:
        self.points = points
        self.planes = planes
        self.tolerance = 1e-9 * float(np.ptp(points, axis=0).max())
        self.quads_by_neighbour: list[dict[int, set[int]]] = [{} for _ in points]
        for e, quad in enumerate(quads.tolist()):
            for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
                self.quads_by_neighbour[a].setdefault(b, set()).add(e)
                self.quads_by_neighbour[b].setdefault(a, set()).add(e)

    def through_nodes(self) -> Iterator[tuple[int, int, int, Array]]:
        """Yield every triple (before, node, after) on a line, and its mirroring factors (3,).

        At a plane of symmetry, before and after are one node and the factor of the component that
        is normal to the plane is -1; all other factors are 1.
        """
        for node, around in enumerate(self.quads_by_neighbour):
            normal_axes = np.flatnonzero(self.planes[node]).tolist()
            unmatched = list(around)
            for axis in normal_axes:
                leaving = self._leaving(node, axis)
                if len(leaving) == 1:
                    mirror = np.ones(3)
                    mirror[axis] = -1.0
                    yield leaving[0], node, leaving[0], mirror
                    unmatched.remove(leaving[0])
            if len(around) + len(normal_axes) == 4 and len(unmatched) > 1:
                for a, b in combinations(unmatched, 2):
                    if not around[a] & around[b]:
                        yield a, node, b, np.ones(3)

    def _leaving(self, node: int, axis: int) -> list[int]:
        """Return the neighbours of a node outside its plane of symmetry, normal to the axis."""
        coordinates = self.points[:, axis]
        neighbours = self.quads_by_neighbour[node]
        return [a for a in neighbours if abs(coordinates[a] - coordinates[node]) > self.tolerance]
