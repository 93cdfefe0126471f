"""How good the elements of a mesh are, and how they hang together."""

from __future__ import annotations

import numpy as np
from bubblefit.meshes.mesh import Mesh
from numpy.typing import NDArray


def scaled_jacobian(mesh: Mesh) -> NDArray[np.float64]:
    """Scaled Jacobian of each quadrilateral, as Verdict and ParaView define it.

    The smallest, over the four corners, of the sine of the angle between the two edges, counted
    against the element's own normal: 1 is a rectangle, 0 a collapsed corner or edge, negative a
    corner that turns in. Warped quads are judged by the normal in their middle.

    Returns
    -------
    (m,), between -1 and 1.
    """
    corner = mesh.points[mesh.quads]
    onward = np.roll(corner, -1, axis=1) - corner
    back = np.roll(corner, 1, axis=1) - corner
    # The normal at the centre is half the cross product of the diagonals.
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal = _over(normal, np.linalg.norm(normal, axis=1)[:, None])
    area = np.einsum("mcx,mx->mc", np.cross(onward, back), normal)
    edges = np.linalg.norm(onward, axis=2) * np.linalg.norm(back, axis=2)
    return np.asarray(_over(area, edges).min(axis=1))


def edges(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each edge once, (k, 2), and how many quads it belongs to."""
    ends = np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)


def least_scaled_jacobian(mesh: Mesh) -> dict[str, float]:
    """Scaled Jacobian of the worst quad of the mesh (`all`) and of each element set."""
    quality = scaled_jacobian(mesh)
    sets = {name: quality[numbers] for name, numbers in mesh.element_sets.items() if len(numbers)}
    return {name: float(values.min()) for name, values in ({"all": quality} | sets).items()}


def _over(value: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quotient, zero where the divisor is: collapsed edges are bad elements, not NaN."""
    return np.divide(value, by, out=np.zeros_like(value), where=by > 0)
