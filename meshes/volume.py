"""The volume that a surface of quads encloses, and its derivative.

By the divergence theorem V = 1/3 * integral of x . n over the surface. A plane of symmetry through
the origin adds nothing, so that a quarter needs no lids: its volume is a quarter of the whole for
as long as its open edges stay in their planes. One compiled loop serves meshes, CalculiX' results
and every iteration of the membrane solver.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..caching import compiled

Array = NDArray[np.float64]

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
    """Volume inside a surface, mm^3, exact for bilinear quads; negative when normals point in.

    Parameters
    ----------
    points : (n, 3) mm, deformed or not. quads : (m, 4), closed but for edges in planes through
        the origin.
    """
    return volume_and_gradient(points, quads)[0]


def volume_gradient(points: Array, quads: NDArray[np.intp]) -> Array:
    """Derivative (n, 3) mm^2 of the enclosed volume with respect to the nodes' positions.

    The integral of shape function times normal, exact for bilinear quads: times a pressure it is
    the force of that pressure on each node. On an open edge it is the derivative for moves in the
    plane of that edge, and the force on the part that is meshed.
    """
    return volume_and_gradient(points, quads)[1]


def volume_and_gradient(
    points: Array, quads: NDArray[np.intp], weight: Array = _EVEN, origin: Array = _ORIGIN
) -> tuple[float, Array]:
    """Volume (mm^3) and its derivative (n, 3) mm^2.

    Parameters
    ----------
    weight : (3,) adding to one: V = sum_k weight_k * integral of (x_k - origin_k) n_k. A surface
        that is open in direction k at both ends has weight 0 there.
    origin : (3,) mm, in the planes of symmetry.
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
