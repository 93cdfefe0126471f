"""Quadrilateral surface meshes as plain data: interpolation, strain, enclosed volume."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..files import compiled


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of four-node quadrilaterals.

    points : (n, 3) mm; warp is x, fill is y, unless `warp` says otherwise. quads : (m, 4) node
    numbers, counter-clockwise seen from the side that pressure inflates to. node_sets, element_sets
    : numbers by name, each sorted and without repeats. warp : (m, 3) unit direction of the warp
    yarn in each quad; None where the model has one for all. The fill yarn is a quarter turn from
    it, counter-clockwise.
    """

    points: NDArray[np.float64]
    quads: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
    element_sets: Mapping[str, NDArray[np.intp]] = field(default_factory=dict)
    warp: NDArray[np.float64] | None = None


Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


def snapped(points: Array, near: float) -> Array:
    """Return points (n, k) with coordinates within `near` of zero exactly zero."""
    return np.where(np.abs(points) < near, 0.0, points)


def with_mirror_image(points: Array, quads: Numbers, axis: int) -> tuple[Array, Numbers, Numbers]:
    """Return the mesh and its image in the plane where coordinate `axis` is exactly zero, joined.

    Returns points (n', k) and quads (2 m, 4), those given first, then their images in the same
    order, wound so that a normal is the image of the normal; and (n',) the given point that each
    node is or mirrors.
    """
    off = points[:, axis] != 0
    image = np.arange(len(points))
    image[off] = len(points) + np.arange(np.count_nonzero(off))
    sign = np.where(np.arange(points.shape[1]) == axis, -1.0, 1.0)
    # A mirror turns quads round: read them backwards to keep the side that faces out.
    turned = image[quads[:, ::-1]]
    source = np.concatenate([np.arange(len(points)), np.flatnonzero(off)])
    return np.concatenate([points, points[off] * sign]), np.concatenate([quads, turned]), source


NEIGHBOURS = 12  # candidate quads of a point, nearest centre first
INSIDE = 1.0 + 1e-6


def sampling_matrix(mesh: Mesh, points: Array) -> tuple[sp.csr_matrix, NDArray[np.bool_]]:
    """Return bilinear interpolation from the nodes of a mesh in the xy plane to points (n, 2) mm.

    Returns the matrix (inside points, nodes) and inside (n,), which points lie in the mesh.
    """
    corner = mesh.points[:, :2][mesh.quads]
    count = min(NEIGHBOURS, len(mesh.quads))
    from scipy.spatial import cKDTree

    _, candidate = cKDTree(corner.mean(axis=1)).query(points, k=count)
    candidate = candidate.reshape(len(points), count)
    owner = np.full(len(points), -1)
    where = np.zeros((len(points), 2))
    for k in range(count):
        open_ = np.flatnonzero(owner < 0)
        if not len(open_):
            break
        natural = _natural(corner[candidate[open_, k]], points[open_])
        hit = (np.abs(natural) <= INSIDE).all(axis=1)
        owner[open_[hit]] = candidate[open_[hit], k]
        where[open_[hit]] = natural[hit]
    inside = owner >= 0
    s, t = where[inside, 0], where[inside, 1]
    weights = 0.25 * np.stack(
        [(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)], axis=1
    )
    rows = np.repeat(np.arange(int(inside.sum())), 4)
    columns = mesh.quads[owner[inside]].reshape(-1)
    shape = (int(inside.sum()), len(mesh.points))
    return sp.csr_matrix((weights.reshape(-1), (rows, columns)), shape=shape), inside


def _natural(corner: Array, point: Array) -> Array:
    """Return natural coordinates (n, 2) of point (n, 2) in quads (n, 4, 2), by Newton; NaN-free."""
    a = corner.mean(axis=1)
    b = 0.25 * (-corner[:, 0] + corner[:, 1] + corner[:, 2] - corner[:, 3])
    c = 0.25 * (-corner[:, 0] - corner[:, 1] + corner[:, 2] + corner[:, 3])
    d = 0.25 * (corner[:, 0] - corner[:, 1] + corner[:, 2] - corner[:, 3])
    s, t = np.zeros(len(point)), np.zeros(len(point))
    for _ in range(12):
        gap = a + b * s[:, None] + c * t[:, None] + d * (s * t)[:, None] - point
        by_s, by_t = b + d * t[:, None], c + d * s[:, None]
        det = by_s[:, 0] * by_t[:, 1] - by_s[:, 1] * by_t[:, 0]
        det = np.where(np.abs(det) < 1e-12, 1e-12, det)
        # A point far outside may have no answer: keep it bounded, it is then outside.
        s = np.clip(s - (gap[:, 0] * by_t[:, 1] - gap[:, 1] * by_t[:, 0]) / det, -10, 10)
        t = np.clip(t - (by_s[:, 0] * gap[:, 1] - by_s[:, 1] * gap[:, 0]) / det, -10, 10)
    return np.stack([s, t], axis=1)


#: Slopes of the bilinear shape functions at the middle, (corner, direction).
MIDDLE = 0.25 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def middle_strain(mesh: Mesh, displacement: Array, warp: Array) -> Array:
    """Return (quads, 3) log strain (eps1, eps2, gamma12) of a mesh in the xy plane.

    displacement : (nodes, 3) mm; warp : (3,) direction of the warp yarn in the plane, at rest.
    """
    rest, u = mesh.points[mesh.quads], displacement[mesh.quads]
    jacobian = np.einsum("mni,nj->mij", rest[:, :, :2], MIDDLE)
    # Columns of the gradient are the images of the unit warp and fill vectors.
    yarns = np.array([[warp[0], -warp[1]], [warp[1], warp[0]]])
    slopes = np.einsum("nj,mjk,kl->mnl", MIDDLE, np.linalg.inv(jacobian), yarns)
    gradient = np.einsum("mni,mnl->mil", rest + u, slopes)
    return log_strain_of(gradient)


def surface_strain(mesh: Mesh, displacement: Array) -> Array:
    """Return (quads, 3) log strain (eps1, eps2, gamma12) at the middles of a curved mesh.

    mesh : its `warp` is projected on each quad's tangent plane. displacement : (nodes, 3) mm.
    """
    if mesh.warp is None:
        raise ValueError("surface_strain: the mesh has no direction of the warp in each quad")
    rest = mesh.points[mesh.quads]
    tangents = np.einsum("mni,nj->mij", rest, MIDDLE)
    normal = np.cross(tangents[..., 0], tangents[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.einsum("mi,mi->m", mesh.warp, normal)[:, None]
    warp = mesh.warp - along * normal
    warp = warp / np.linalg.norm(warp, axis=1, keepdims=True)
    yarns = np.stack([warp, np.cross(normal, warp)], axis=1)
    # Slopes along the two yarns, from those along the quad's own two directions.
    inverse = np.linalg.inv(np.einsum("mki,mij->mkj", yarns, tangents))
    slopes = np.einsum("nj,mjk->mnk", MIDDLE, inverse)
    gradient = np.einsum("mni,mnk->mik", rest + displacement[mesh.quads], slopes)
    return log_strain_of(gradient)


def log_strain_of(gradient: Array) -> Array:
    """Return log strain (..., 3) of surface gradients (..., 3, 2): eps1, eps2, gamma12.

    The columns of a gradient are the images of the unit warp and fill vectors.
    """
    stretch, axes = np.linalg.eigh(np.einsum("...ki,...kj->...ij", gradient, gradient))
    h = np.einsum("...ia,...a,...ja->...ij", axes, 0.5 * np.log(stretch), axes)
    return np.stack([h[..., 0, 0], h[..., 1, 1], 2 * h[..., 0, 1]], axis=-1)


_G = 1 / np.sqrt(3)
_AT = _G * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_CORNER = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
#: Bilinear shape functions (point, corner) at 2 x 2 Gauss points, and their slopes.
_VALUES = 0.25 * (1 + _AT[:, None, 0] * _CORNER[:, 0]) * (1 + _AT[:, None, 1] * _CORNER[:, 1])
_SLOPES = 0.25 * np.stack(
    [
        _CORNER[:, 0] * (1 + _AT[:, None, 1] * _CORNER[:, 1]),
        _CORNER[:, 1] * (1 + _AT[:, None, 0] * _CORNER[:, 0]),
    ]
)
_EVEN, _ORIGIN = np.full(3, 1 / 3), np.zeros(3)


def enclosed_volume(points: Array, quads: NDArray[np.intp]) -> float:
    """Return the volume inside a surface, mm^3; negative when normals point in.

    quads : (m, 4), closed but for edges in planes through the origin.
    """
    return volume_and_gradient(points, quads)[0]


def volume_and_gradient(
    points: Array, quads: NDArray[np.intp], weight: Array = _EVEN, origin: Array = _ORIGIN
) -> tuple[float, Array]:
    """Return the volume (mm^3) and its derivative (n, 3) mm^2, exact for bilinear quads.

    V = 1/3 * integral of x . n: a plane of symmetry through the origin adds nothing, so that a
    quarter needs no lids as long as its open edges stay in their planes.

    Times a pressure the latter is the force of that pressure on each node. On an open edge it is
    for moves in the plane of that edge.

    weight : (3,) adding to one: V = sum_k weight_k * integral of (x_k - origin_k) n_k. A surface
    that is open in direction k at both ends has weight 0 there. origin : (3,) mm, in the planes of
    symmetry.
    """
    gradient = np.zeros(points.shape)
    points = np.ascontiguousarray(points, dtype=float)
    return _enclosed(points, quads, _VALUES, _SLOPES, weight, origin, gradient), gradient


@compiled()
def _enclosed(points, quads, values, slopes, weight, origin, gradient):  # type: ignore[no-untyped-def]
    """Volume; adds its derivative to `gradient` (n, 3). All Gauss weights are one."""
    volume = 0.0
    x, a, normal = np.empty((4, 3)), np.empty((2, 3)), np.empty(3)
    for e in range(quads.shape[0]):
        for n in range(4):
            for k in range(3):
                x[n, k] = points[quads[e, n], k]
        for g in range(4):
            for i in range(2):
                for k in range(3):
                    a[i, k] = 0.0
                    for n in range(4):
                        a[i, k] += slopes[i, g, n] * x[n, k]
            # Its length is the area of the Gauss point.
            normal[0] = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
            normal[1] = a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2]
            normal[2] = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
            for k in range(3):
                at = -origin[k]
                for n in range(4):
                    at += values[g, n] * x[n, k]
                    gradient[quads[e, n], k] += values[g, n] * normal[k]
                volume += weight[k] * at * normal[k]
    return volume
