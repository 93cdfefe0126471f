"""Logarithmic strain of a deformed surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .mesh import Mesh

Array = NDArray[np.float64]

#: Slopes of the bilinear shape functions at the middle, (corner, direction).
MIDDLE = 0.25 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def middle_strain(mesh: Mesh, displacement: Array, warp: Array) -> Array:
    """(quads, 3) log strain (eps1, eps2, gamma12) of a mesh in the xy plane.

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
    """(quads, 3) log strain (eps1, eps2, gamma12) in the middle of the quads of a curved mesh.

    mesh : with the direction of its `warp` in each quad, which is projected on the quad's tangent
    plane. displacement : (nodes, 3) mm.
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
    """Log strain (..., 3) of surface gradients (..., 3, 2): eps1, eps2, gamma12.

    The columns of a gradient are the images of the unit warp and fill vectors.
    """
    stretch, axes = np.linalg.eigh(np.einsum("...ki,...kj->...ij", gradient, gradient))
    h = np.einsum("...ia,...a,...ja->...ij", axes, 0.5 * np.log(stretch), axes)
    return np.stack([h[..., 0, 0], h[..., 1, 1], 2 * h[..., 0, 1]], axis=-1)
