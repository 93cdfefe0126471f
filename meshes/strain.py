"""Logarithmic strain of a surface: in the middle of each quad of a mesh, or at points."""

import numpy as np

from .mesh import Array, Mesh

#: Derivatives of the bilinear shape functions in the middle of a quad, (corner, direction).
MIDDLE = 0.25 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
#: Direction of the warp where none is given.
X = np.array([1.0, 0.0, 0.0])


def surface_strain(
    mesh: Mesh,
    displacement: Array,
    warp: Array | None = None,
    stretch: Array | None = None,
) -> Array:
    """Return the logarithmic strain of the yarns in the middle of each quad.

    Parameters
    ----------
    mesh : Mesh
    displacement : (nodes, 3) array, mm
    warp : (3,) or (quads, 3) array, optional
        Direction of the warp, which is projected on each quad; that of the mesh unless given, and x
        if the mesh has none.
    stretch : (quads, 2, 2) array, optional
        Stretch from the mesh to the stress-free yarns, in axes along warp and fill.

    Returns
    -------
    (quads, 3) array
        eps1 along the warp, eps2 along the fill, and the engineering shear gamma12.
    """
    corners = mesh.points[mesh.quads]
    tangents = np.einsum("mni,nj->mij", corners, MIDDLE)
    yarns = _yarn_directions(tangents, mesh.warp if warp is None else warp)
    # Slopes along the two yarns, from those along the quad's own two directions.
    inverse = np.linalg.inv(np.einsum("mki,mij->mkj", yarns, tangents))
    slopes = np.einsum("nj,mjk->mnk", MIDDLE, inverse)
    deformed = corners + displacement[mesh.quads]
    gradient = np.einsum("mni,mnk->mik", deformed, slopes)
    if stretch is not None:
        gradient = gradient @ np.linalg.inv(stretch)
    return log_strain_of(gradient)


def strain_of_tangents(tangents: Array, deformed: Array, warp: Array | None = None) -> Array:
    """Return the logarithmic strain of the yarns at points of a surface.

    Parameters
    ----------
    tangents, deformed : (n, 3, 2) arrays
        Two tangent vectors of the surface at each point, and what the deformation makes of them.
    warp : (3,) or (n, 3) array, optional
        Direction of the warp, which is projected on the surface; x unless given.

    Returns
    -------
    (n, 3) array
        eps1 along the warp, eps2 along the fill, and the engineering shear gamma12.
    """
    in_yarns = np.einsum("mki,mij->mkj", _yarn_directions(tangents, warp), tangents)
    return log_strain_of(deformed @ np.linalg.inv(in_yarns))


def _yarn_directions(tangents: Array, warp: Array | None) -> Array:
    """Return the unit vectors (n, 2, 3) of warp and fill at points with tangents (n, 3, 2)."""
    direction = np.broadcast_to(X if warp is None else warp, tangents.shape[:2])
    normal = np.cross(tangents[..., 0], tangents[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along_normal = np.einsum("mi,mi->m", direction, normal)[:, None]
    yarn = direction - along_normal * normal
    yarn = yarn / np.linalg.norm(yarn, axis=1, keepdims=True)
    return np.stack([yarn, np.cross(normal, yarn)], axis=1)


def log_strain_of(gradient: Array) -> Array:
    """Return the log strains eps1, eps2, gamma12, (..., 3), of deformation gradients.

    Parameters
    ----------
    gradient : (..., 3, 2) array
        Whose columns are the images of the unit vectors along warp and fill.
    """
    squared_stretch, axes = np.linalg.eigh(np.einsum("...ki,...kj->...ij", gradient, gradient))
    principal = 0.5 * np.log(squared_stretch)
    strain = np.einsum("...ia,...a,...ja->...ij", axes, principal, axes)
    shear = 2 * strain[..., 0, 1]
    return np.stack([strain[..., 0, 0], strain[..., 1, 1], shear], axis=-1)
