"""The cavity inside a closed membrane: its volume, and the symmetry planes that close it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.mesh import Array
from ...meshes.volume import volume_and_gradient


@dataclass(frozen=True, eq=False)
class Cavity:
    """The space inside a closed surface, or inside a part of one that symmetry planes close.

    Attributes
    ----------
    quads : (m, 4) ndarray of int
    weight, origin : (3,) ndarray
        See `volume_and_gradient`. A direction that is normal to two symmetry planes, as in a slice
        of a long tube, has the weight zero.
    symmetric : (3,) ndarray of bool
        Whether there is a symmetry plane normal to each axis.
    planes : (n, 3) ndarray of bool
        Whether a node lies on an open edge in a symmetry plane, by the axis normal to the plane.
    """

    quads: NDArray[np.intp]
    weight: Array
    origin: Array
    symmetric: NDArray[np.bool_]
    planes: NDArray[np.bool_]

    def measure(self, position: Array) -> tuple[float, Array]:
        """Return the volume (mm^3) inside the meshed part, and its derivative (3 n,) in mm^2.

        position : of the nodes, (n, 3) mm; the derivative is by these.
        """
        volume, push = volume_and_gradient(position, self.quads, self.weight, self.origin)
        return volume, push.reshape(-1)


def closed_cavity(points: Array, quads: NDArray[np.intp], fixed: NDArray[np.intp]) -> Cavity:
    """Return the cavity inside a surface, with the symmetry planes that close its open edges.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (m, 4) array of int
    fixed : (k,) array of int
        Held unknowns, 3 * node + direction.

    Returns
    -------
    Cavity

    Raises
    ------
    InputError
        If an open edge lies in no symmetry plane, that is in no plane normal to an axis along which
        its nodes are held; or if planes close the cavity on all six sides.
    """
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    border = edges[count == 1]
    is_fixed = np.zeros(points.shape, dtype=bool)
    is_fixed.reshape(-1)[fixed] = True
    size = float(np.ptp(points, axis=0).max())
    level = np.abs(points[border[:, 0]] - points[border[:, 1]]) < 1e-9 * size
    in_plane = is_fixed[border].all(axis=1) & level  # (edges, 3)
    if not in_plane.any(axis=1).all():
        first, second = border[int(np.argmin(in_plane.any(axis=1)))]
        raise InputError(
            None,
            "mesh",
            f"the cavity is open between nodes {first} and {second}: close it, "
            "or hold the edge normal to a symmetry plane",
        )
    weight = np.ones(3)
    origin = points.mean(axis=0)
    for k in range(3):
        levels = points[border[in_plane[:, k], 0], k]
        if len(levels):
            origin[k] = levels[0]
            weight[k] = float(np.ptp(levels) < 1e-9 * size)
    if not weight.any():
        raise InputError(None, "mesh", "the cavity is closed by planes on all six sides")
    planes = np.zeros(points.shape, dtype=bool)
    for k in range(3):
        planes[border[in_plane[:, k]], k] = True
    return Cavity(quads, weight / weight.sum(), origin, in_plane.any(axis=0), planes)
