"""Where points lie in a flat quadrilateral mesh: the matrix that samples nodal fields there."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .mesh import Mesh

Array = NDArray[np.float64]

NEIGHBOURS = 12  # candidate quads of a point, nearest centre first
INSIDE = 1.0 + 1e-6


def sampling_matrix(mesh: Mesh, points: Array) -> tuple[sp.csr_matrix, NDArray[np.bool_]]:
    """Bilinear interpolation from the nodes of a mesh in the xy plane to points in it.

    Parameters
    ----------
    points : (n, 2) mm.

    Returns
    -------
    matrix (inside points, nodes) and inside (n,): which points lie in the mesh at all.
    """
    corner = mesh.points[:, :2][mesh.quads]
    count = min(NEIGHBOURS, len(mesh.quads))
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
    """Natural coordinates (n, 2) of point (n, 2) in quads (n, 4, 2), by Newton; NaN-free."""
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
