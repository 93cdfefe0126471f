"""Bending stiffness of the wall, which keeps a wrinkle from being as fine as the mesh.

No rotations: the curvature along a line of the mesh is the second difference of three positions,
    [(x_+ - x_0)/l_+ - (x_0 - x_-)/l_-] / h,   h = (l_+ + l_-)/2,
a vector that turns with the wall, and the energy of a node's share of the surface D/2 times its
square (Bergou et al., Symposium on Geometry Processing 2006, on lines of a grid): quadratic in
the positions, with one constant matrix. The sheet is flat when it is free; no twist.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...meshes.mesh import Array, Numbers
from .initial_stiffness import initial_stiffness

#: cos of the largest angle in a line of the mesh: a cap's rim is a seam, and carries no moment.
STRAIGHT = 0.7


@dataclass(frozen=True, eq=False)
class Flexure:
    """Lines of a mesh through its nodes.

    nodes (h, 3): before, at, after; a plane of symmetry mirrors the node after. differences (h, 3,
    3): by node and component, 1/mm^2, of the curvature. shares (h, 2) mm^2 mm^3: surface times
    thickness^3/12 that bends along warp, fill.
    """

    nodes: Numbers
    differences: Array
    shares: Array

    def stiffness(self, law: HypoelasticLaw) -> Array:
        """Return (h, 3, 3, 3) N/mm by line, component, node, node; with moduli at zero strain."""
        plane = np.diagonal(initial_stiffness(law))[:2]
        c = self.differences
        return np.asarray(np.einsum("h,hai,hbi->hiab", self.shares @ plane, c, c))

    def matrix(self, law: HypoelasticLaw, count: int) -> sp.csr_matrix:
        """Return (3 count, 3 count) N/mm on all unknowns of `count` nodes."""
        values = self.stiffness(law)
        unknowns = 3 * self.nodes[:, None, :] + np.arange(3)[:, None]  # (h, 3, 3)
        rows = np.broadcast_to(unknowns[..., :, None], values.shape)
        columns = np.broadcast_to(unknowns[..., None, :], values.shape)
        triples = (values.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_matrix(triples, shape=(3 * count, 3 * count))


def flexure_of(
    points: Array, quads: Numbers, warp: Array, thickness: Array, planes: NDArray[np.bool_]
) -> Flexure:
    """Find the lines through every node of a mesh.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (m, 4) array of int
    warp : (m, 3) array
        Direction of the warp.
    thickness : float or (m,) array, mm
    planes : (n, 3) array of bool
        Whether an open edge at the node lies in a plane of symmetry, by its normal.

    Returns
    -------
    Flexure
    """
    share, inertia, along = _of_nodes(points, quads, warp, thickness)
    nodes = []
    differences = []
    shares = []
    for previous_node, node, next_node, mirror in MeshLines(points, quads, planes).through_nodes():
        step = points[next_node] - points[node]
        back = (
            points[node] - points[previous_node] if previous_node != next_node else -mirror * step
        )
        ahead = float(np.linalg.norm(step))
        behind = float(np.linalg.norm(back))
        if step @ back < STRAIGHT * ahead * behind:
            continue
        ones = np.ones(3)
        slopes = np.stack([mirror / behind, -ones / behind - ones / ahead, ones / ahead])
        if previous_node == next_node:
            # Components normal to the plane are equal on both sides and cancel.
            slopes *= mirror > 0
        nodes.append((previous_node, node, next_node))
        differences.append(slopes / (0.5 * (ahead + behind)))
        direction = step / ahead + back / behind
        cosine = direction @ along[node] / np.linalg.norm(direction)
        warps = min(1.0, float(cosine) ** 2)
        shares.append(share[node] * inertia[node] * np.array([warps**2, (1.0 - warps) ** 2]))
    return Flexure(
        np.array(nodes, dtype=np.intp).reshape(-1, 3),
        np.array(differences).reshape(-1, 3, 3),
        np.array(shares).reshape(-1, 2),
    )


def _of_nodes(
    points: Array, quads: Numbers, warp: Array, thickness: Array
) -> tuple[Array, Array, Array]:
    """Return of every node: surface mm^2, mean of thickness^3 / 12, direction of the warp."""
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
    """Lines of a mesh: pairs of neighbours on either side of a node.

    quads_by_neighbour : of each node, the quads of each edge to a neighbour.
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
        """Yield (before, node, after, mirror (3,)): neighbours in line through a node."""
        for node, around in enumerate(self.quads_by_neighbour):
            normals = np.flatnonzero(self.planes[node]).tolist()
            unmatched = list(around)
            for normal in normals:
                leaving = self._leaving(node, normal)
                if len(leaving) == 1:
                    mirror = np.ones(3)
                    mirror[normal] = -1.0
                    yield leaving[0], node, leaving[0], mirror
                    unmatched.remove(leaving[0])
            if len(around) + len(normals) == 4 and len(unmatched) > 1:
                for a, b in combinations(unmatched, 2):
                    if not around[a] & around[b]:
                        yield a, node, b, np.ones(3)

    def _leaving(self, node: int, normal: int) -> list[int]:
        """Return the neighbours of a node that are not in its plane of symmetry."""
        level = self.points[node, normal]
        neighbours = self.quads_by_neighbour[node]
        return [a for a in neighbours if abs(self.points[a, normal] - level) > self.tolerance]
