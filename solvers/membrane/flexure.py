"""Bending stiffness of the membrane's wall: what keeps a wrinkle from being as fine as the mesh.

No rotations: the curvature along a line of the mesh is the second difference of three positions,

    curvature = [(x_+ - x_0)/l_+ - (x_0 - x_-)/l_-] / h,   h = (l_+ + l_-)/2,

(l reference lengths), a vector that turns with the wall, and the energy of a node's share of the
surface is D/2 |curvature|^2 (the quadratic bending of Bergou et al., Symposium on Geometry
Processing 2006, on the lines of a grid). It is quadratic in the positions, so that its stiffness
is one constant matrix. The sheet is flat when it is free; twist has no stiffness.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from .newton import initial_stiffness

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

#: cos of the largest angle in a line of the mesh: a cap's rim is a seam, and carries no moment.
STRAIGHT = 0.7


@dataclass(frozen=True, eq=False)
class Flexure:
    """The lines of a mesh through its nodes.

    nodes (h, 3): before, at and after the node; where a plane of symmetry ends the line the node
    after it twice, once mirrored. differences (h, 3, 3): by node and component, 1/mm^2, of the
    curvature. shares (h, 2) mm^2 mm^3: surface times thickness^3/12 that bends along warp, fill.
    """

    nodes: Numbers
    differences: Array
    shares: Array

    def stiffness(self, law: HypoelasticLaw) -> Array:
        """(h, 3, 3, 3) N/mm: by line, component, node and node; with moduli at zero strain."""
        plane = np.diagonal(initial_stiffness(law))[:2]
        c = self.differences
        return np.asarray(np.einsum("h,hai,hbi->hiab", self.shares @ plane, c, c))

    def matrix(self, law: HypoelasticLaw, count: int) -> sp.csr_matrix:
        """(3 count, 3 count) N/mm on all unknowns of `count` nodes."""
        values = self.stiffness(law)
        unknowns = 3 * self.nodes[:, None, :] + np.arange(3)[:, None]  # (h, 3, 3)
        rows = np.broadcast_to(unknowns[..., :, None], values.shape)
        columns = np.broadcast_to(unknowns[..., None, :], values.shape)
        triples = (values.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_matrix(triples, shape=(3 * count, 3 * count))


def flexure_of(
    points: Array, quads: Numbers, warp: Array, thickness: Array, planes: NDArray[np.bool_]
) -> Flexure:
    """The lines through every node of a mesh.

    Parameters
    ----------
    points : (n, 3) mm. warp : (quads, 3). thickness : mm, one or (quads,).
    planes : (n, 3) whether an open edge at the node lies in a plane of symmetry, by its normal.
    """
    share, inertia, along = _of_nodes(points, quads, warp, thickness)
    nodes, differences, shares = [], [], []
    for before, node, after, mirror in _lines(points, quads, planes):
        step = points[after] - points[node]
        back = points[node] - points[before] if before != after else -mirror * step
        ahead, behind = float(np.linalg.norm(step)), float(np.linalg.norm(back))
        if step @ back < STRAIGHT * ahead * behind:
            continue
        one = np.ones(3)
        slopes = np.stack([mirror / behind, -one / behind - one / ahead, one / ahead])
        if before == after:
            # What is normal to the plane is the same on both sides, so that none of it is left.
            slopes *= mirror > 0
        nodes.append((before, node, after))
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
    """Of every node: surface mm^2, mean of thickness^3 / 12, direction of the warp."""
    corner = points[quads]
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    area = 0.5 * np.linalg.norm(across, axis=1)
    normal = across / (2.0 * area[:, None])
    flat = warp - np.einsum("mk,mk->m", warp, normal)[:, None] * normal
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    share, cube, along = np.zeros(len(points)), np.zeros(len(points)), np.zeros(points.shape)
    np.add.at(share, quads, 0.25 * area[:, None])
    np.add.at(cube, quads, 0.25 * (area * np.broadcast_to(thickness, area.shape) ** 3)[:, None])
    np.add.at(along, quads, flat[:, None])
    inertia = cube / (12.0 * np.where(share > 0, share, 1.0))
    length = np.linalg.norm(along, axis=1)[:, None]
    return share, inertia, along / np.where(length > 0, length, 1.0)


def _lines(
    points: Array, quads: Numbers, planes: NDArray[np.bool_]
) -> Iterator[tuple[int, int, int, Array]]:
    """(before, node, after, mirror (3,)): neighbours that continue each other through a node.

    Where a plane of symmetry ends a line, what is after is before as well, and mirrored.
    """
    beside: list[dict[int, set[int]]] = [{} for _ in points]
    for e, quad in enumerate(quads.tolist()):
        for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
            beside[a].setdefault(b, set()).add(e)
            beside[b].setdefault(a, set()).add(e)
    size = 1e-9 * float(np.ptp(points, axis=0).max())
    for node, around in enumerate(beside):
        normals = np.flatnonzero(planes[node])
        inside = list(around)
        for normal in normals:
            leaving = [a for a in around if abs(points[a, normal] - points[node, normal]) > size]
            if len(leaving) == 1:
                mirror = np.ones(3)
                mirror[normal] = -1.0
                yield leaving[0], node, leaving[0], mirror
                inside.remove(leaving[0])
        if len(around) + len(normals) == 4 and len(inside) > 1:
            for i, a in enumerate(inside):
                for b in inside[i + 1 :]:
                    if not around[a] & around[b]:
                        yield a, node, b, np.ones(3)
