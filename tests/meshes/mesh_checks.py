"""Checks of meshes, and a field that smooth readings keep."""

import numpy as np


def scaled_jacobian(mesh):
    """Scaled Jacobian of each quadrilateral (m,), as Verdict and ParaView define it."""
    corner = mesh.points[mesh.quads]
    onward, back = (np.roll(corner, by, axis=1) - corner for by in (-1, 1))
    # The normal at the centre is half the cross product of the diagonals.
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal = row_norms(normal, np.linalg.norm(normal, axis=1)[:, None])
    area = np.einsum("mcx,mx->mc", np.cross(onward, back), normal)
    return row_norms(area, np.linalg.norm(onward, axis=2) * np.linalg.norm(back, axis=2)).min(
        axis=1
    )


def edges(mesh):
    ends = np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)


def least_scaled_jacobian(mesh):
    quality = scaled_jacobian(mesh)
    sets = {name: quality[numbers] for name, numbers in mesh.element_sets.items() if len(numbers)}
    return {name: values.min() for name, values in ({"all": quality} | sets).items()}


def row_norms(value, by):
    return np.divide(value, by, out=np.zeros_like(value), where=by > 0)


def quadratic_field(points):
    x, y = points[:, :2].T
    return 3.0 + 0.2 * x - 0.1 * y + 0.01 * x**2 - 0.02 * x * y + 0.03 * y**2
