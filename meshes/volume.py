"""The volume that a surface of quads encloses, and its derivative.

By the divergence theorem V = 1/3 * integral of x . n over the surface. A plane of symmetry through
the origin adds nothing, so that a quarter needs no lids: its volume is a quarter of the whole for
as long as its open edges stay in their planes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Both ways to cut a quad into two triangles; their mean is the volume below the bilinear patch.
TRIANGLES = ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3))
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


def enclosed_volume(points: Array, quads: NDArray[np.intp]) -> float:
    """Volume inside a surface, mm^3, exact for bilinear quads; negative when normals point in.

    Parameters
    ----------
    points : (n, 3) mm, deformed or not. quads : (m, 4), closed but for edges in planes through
        the origin.
    """
    corner = points[quads]
    total = 0.0
    for a, b, c in TRIANGLES:
        normal = np.cross(corner[:, b], corner[:, c])
        total += float(np.einsum("mx,mx->", corner[:, a], normal))
    return total / 12


def volume_gradient(points: Array, quads: NDArray[np.intp]) -> Array:
    """Derivative (n, 3) mm^2 of the enclosed volume with respect to the nodes' positions.

    The integral of shape function times normal, exact for bilinear quads: times a pressure it is
    the force of that pressure on each node. On an open edge it is the derivative for moves in the
    plane of that edge, and the force on the part that is meshed.
    """
    corner = points[quads]
    base = np.einsum("ipn,mnx->impx", _SLOPES, corner)
    normal = np.cross(base[0], base[1])  # its length is the area of a Gauss point
    gradient = np.zeros_like(points, dtype=float)
    np.add.at(gradient, quads, np.einsum("pn,mpx->mnx", _VALUES, normal))
    return gradient
