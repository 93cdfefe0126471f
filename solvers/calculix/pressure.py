"""Nodal forces of a follower pressure on shells of four or eight nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Corners, then midsides, of the square [-1, 1]^2.
_NATURAL = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0]], float)
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def pressure_forces(points: Array, elements: NDArray[np.intp], pressure: float) -> Array:
    """Forces (n, 3) N of `pressure` (MPa) along the normals of elements (m, 4 or 8) at `points`."""
    forces = np.zeros_like(points)
    corner = points[elements]
    for a, wa in zip(_GAUSS, _WEIGHTS, strict=True):
        for b, wb in zip(_GAUSS, _WEIGHTS, strict=True):
            values, slopes = _shape(np.array([a, b]), elements.shape[1])
            base = np.einsum("in,mnk->imk", slopes, corner)
            normal = np.cross(base[0], base[1])  # its length is the area
            part = wa * wb * pressure * values[None, :, None] * normal[:, None, :]
            np.add.at(forces, elements, part)
    return forces


def _shape(x: Array, nodes: int) -> tuple[Array, Array]:
    """Shape functions (nodes,) and their derivatives (2, nodes) at x (2,)."""
    s = _NATURAL[:4] * x
    values = 0.25 * (1 + s[:, 0]) * (1 + s[:, 1])
    slopes = 0.25 * np.stack([_NATURAL[:4, 0] * (1 + s[:, 1]), _NATURAL[:4, 1] * (1 + s[:, 0])])
    if nodes == 4:
        return values, slopes
    middle, rise = np.empty(4), np.empty((2, 4))
    for k, (u, v) in enumerate(_NATURAL[4:]):
        along = 0 if u == 0 else 1  # the coordinate that runs along the edge
        across, sign = 1 - along, v if u == 0 else u
        middle[k] = 0.5 * (1 - x[along] ** 2) * (1 + sign * x[across])
        rise[along, k] = -x[along] * (1 + sign * x[across])
        rise[across, k] = 0.5 * sign * (1 - x[along] ** 2)
    # A midside takes half from each of the corners beside it.
    beside = 0.5 * (np.eye(4) + np.roll(np.eye(4), 1, axis=0))  # corner x midside
    return (
        np.concatenate([values - beside @ middle, middle]),
        np.concatenate([slopes - rise @ beside.T, rise], axis=1),
    )
