"""Volume inside a surface of quadrilaterals, with its derivative; a compiled kernel."""

import numpy as np

from ..compilation import compiled
from .mesh import Array, Numbers

#: Corners of a quad and its 2 x 2 Gauss points, natural coordinates (4, 2).
_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_GAUSS_POINTS = _CORNERS / np.sqrt(3)
#: Factors 1 + s s_n and 1 + t t_n of the bilinear shape functions, (point, corner).
_BY_S = 1 + _GAUSS_POINTS[:, None, 0] * _CORNERS[:, 0]
_BY_T = 1 + _GAUSS_POINTS[:, None, 1] * _CORNERS[:, 1]
#: Bilinear shape functions (point, corner) at the Gauss points, and their slopes.
GAUSS_VALUES = 0.25 * _BY_S * _BY_T
_SLOPES = 0.25 * np.stack([_CORNERS[:, 0] * _BY_T, _CORNERS[:, 1] * _BY_S])
_EQUAL_WEIGHTS = np.full(3, 1 / 3)
_ORIGIN = np.zeros(3)


def enclosed_volume(points: Array, quads: Numbers) -> float:
    """Return the volume (mm^3) inside a surface that planes through the origin may close.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (m, 4) array of int
    """
    return volume_and_gradient(points, quads)[0]


def volume_and_gradient(
    points: Array,
    quads: Numbers,
    weight: Array = _EQUAL_WEIGHTS,
    origin: Array = _ORIGIN,
) -> tuple[float, Array]:
    """Return the volume inside a surface and its derivative, exact for bilinear quads.

    V = sum_k weight_k * integral of (x_k - origin_k) n_k.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (m, 4) array
        Counter-clockwise seen from outside.
    weight : (3,) array
        Adding to one; 0 where the surface is open along the axis.
    origin : (3,) array, mm
        In planes of symmetry.

    Returns
    -------
    float, (n, 3) array
        mm^3 and mm^2.
    """
    gradient = np.zeros(points.shape)
    points = np.ascontiguousarray(points, dtype=float)
    return _enclosed(
        points,
        quads,
        GAUSS_VALUES,
        _SLOPES,
        weight,
        origin,
        gradient,
    ), gradient


@compiled()
def _enclosed(  # type: ignore[no-untyped-def]
    points,
    quads,
    values,
    slopes,
    weight,
    origin,
    gradient,
):
    """Return the volume; add its derivative to `gradient` (n, 3). All Gauss weights are one."""
    volume = 0.0
    x = np.empty((4, 3))
    a = np.empty((2, 3))
    normal = np.empty(3)
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
