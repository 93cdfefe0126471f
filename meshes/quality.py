"""Element shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .mesh import Mesh

Array = NDArray[np.float64]


def scaled_jacobian(mesh: Mesh) -> Array:
    """Smallest corner Jacobian of each quad over its edge lengths, (m,).

    1 for a rectangle, the sine of the worst corner angle otherwise, negative inside out.
    """
    corner = mesh.points[mesh.quads]
    ahead = np.roll(corner, -1, axis=1) - corner
    behind = np.roll(corner, 1, axis=1) - corner
    normal = np.cross(ahead, behind)
    mean = normal.sum(axis=1, keepdims=True)
    mean /= np.maximum(np.linalg.norm(mean, axis=2, keepdims=True), 1e-300)
    # The sign is that of the quad's own turning about +z where it is flat.
    mean = np.where((np.abs(corner[..., 2]).max() == 0.0), np.array([0.0, 0.0, 1.0]), mean)
    lengths = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    signed = (normal * mean).sum(axis=2)
    return np.asarray((signed / np.maximum(lengths, 1e-300)).min(axis=1))
