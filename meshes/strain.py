"""Logarithmic strain at the middles of quadrilaterals."""

import numpy as np

from .mesh import Array, Mesh

#: Slopes of the bilinear shape functions at the middle, (corner, direction).
MIDDLE = 0.25 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
#: Direction of the warp where none is given.
X = np.array([1.0, 0.0, 0.0])


def surface_strain(
    mesh: Mesh, displacement: Array, warp: Array | None = None, stretch: Array | None = None
) -> Array:
    """Return the logarithmic strain of the yarns at the middles of quads.

    Parameters
    ----------
    mesh : Mesh
    displacement : (nodes, 3) array, mm
    warp : (3,) or (quads, 3) array, optional
        Direction of the warp, laid on each quad; the mesh's unless given, x where that has none.
    stretch : (quads, 2, 2) array, optional
        Stretch of the yarns without stress over those of the mesh.

    Returns
    -------
    (quads, 3) array
        Along warp and fill, and shear.
    """
    corners = mesh.points[mesh.quads]
    tangents = np.einsum("mni,nj->mij", corners, MIDDLE)
    yarns = _yarn_directions(mesh, tangents, warp)
    # Slopes along the two yarns, from those along the quad's own two directions.
    inverse = np.linalg.inv(np.einsum("mki,mij->mkj", yarns, tangents))
    slopes = np.einsum("nj,mjk->mnk", MIDDLE, inverse)
    deformed = corners + displacement[mesh.quads]
    gradient = np.einsum("mni,mnk->mik", deformed, slopes)
    if stretch is not None:
        gradient = gradient @ np.linalg.inv(stretch)
    return log_strain_of(gradient)


def _yarn_directions(mesh: Mesh, tangents: Array, warp: Array | None) -> Array:
    """Return unit directions (quads, 2, 3) of warp and fill in the quads of tangents (m, 3, 2)."""
    given = mesh.warp if warp is None else warp
    direction = np.broadcast_to(X if given is None else given, (len(mesh.quads), 3))
    normal = np.cross(tangents[..., 0], tangents[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along_normal = np.einsum("mi,mi->m", direction, normal)[:, None]
    yarn = direction - along_normal * normal
    yarn = yarn / np.linalg.norm(yarn, axis=1, keepdims=True)
    return np.stack([yarn, np.cross(normal, yarn)], axis=1)


def log_strain_of(gradient: Array) -> Array:
    """Return log strains (..., 3) of gradients (..., 3, 2), images of unit warp and fill."""
    squared_stretch, axes = np.linalg.eigh(np.einsum("...ki,...kj->...ij", gradient, gradient))
    principal = 0.5 * np.log(squared_stretch)
    strain = np.einsum("...ia,...a,...ja->...ij", axes, principal, axes)
    shear = 2 * strain[..., 0, 1]
    return np.stack([strain[..., 0, 0], strain[..., 1, 1], shear], axis=-1)
