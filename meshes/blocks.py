"""A quarter of the unit disk in three structured blocks (an o-grid), by transfinite interpolation.

The core is a square with its far corner K pulled towards the rim and two bulging sides; two ring
blocks join those sides to the arc. Three quads meet in K, so the best any such mesh can do is
120 degrees there: scaled Jacobian sin(120) = 0.866. The sides are arcs that leave the axes at
right angles and turn just so far that all three angles in K are 120 degrees; every element of
every count then has 0.866 or more.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Layers of the ring for each division of the core, at least and at most: beyond, elements are
#: drawn out.
THINNEST, THICKEST = 1 / 3, 1.0
#: Radial size of the ring's elements over the size of the core's; 1.2 keeps the largest element
#: of the thesis' mesh within 2.3 times the smallest.
RING_TO_CORE = 1.2


def quarter_disk(elements: float) -> tuple[Array, NDArray[np.intp]]:
    """Mesh the quarter x, y >= 0 of the unit disk.

    Parameters
    ----------
    elements : quads wanted; the nearest count n^2 + 2 n m with good shapes is made.

    Returns
    -------
    points (p, 2), quads (q, 4) counter-clockwise.
    """
    return divided_quarter_disk(*divisions(elements))


def divided_quarter_disk(n: int, m: int) -> tuple[Array, NDArray[np.intp]]:
    """The same with n divisions of the core and m layers of the ring: n^2 + 2 n m quads.

    The 2 n + 1 nodes of the rim lie at equal angles.
    """
    core, ring = _core_and_ring(n, m)
    core_nodes = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    # The core's two far sides, from the x axis to the y axis, are the ring's first layer.
    side = np.concatenate([core_nodes[n, :], core_nodes[-2::-1, n]])
    outside = len(core_nodes.ravel()) + np.arange(m * len(side)).reshape(m, len(side))
    ring_nodes = np.concatenate([side[None], outside])
    points = np.concatenate([core.reshape(-1, 2), ring[1:].reshape(-1, 2)])
    return points, np.concatenate([_quads(core_nodes), _quads(ring_nodes)])


def divisions(elements: float) -> tuple[int, int]:
    """Core divisions n and ring layers m whose n^2 + 2 n m is nearest to `elements`.

    Ties go to m nearest to n / 2, where sizes are most even; 200 gives (10, 5).
    """
    best = (math.inf, math.inf, 1, 1)
    for n in range(1, math.isqrt(math.ceil(elements)) + 2):
        wanted = round((elements - n * n) / (2 * n))
        m = min(max(wanted, math.ceil(THINNEST * n)), max(1, math.floor(THICKEST * n)))
        best = min(best, (abs(n * n + 2 * n * m - elements), abs(m / n - 0.5), n, m))
    return best[2], best[3]


def _core_and_ring(n: int, m: int) -> tuple[Array, Array]:
    """Points (n + 1, n + 1, 2) of the core and (m + 1, 2 n + 1, 2) of the ring, inside out."""
    # The last chord of a side should lie at 105 degrees: 60 from the diagonal, on either side
    # of it. A chord of n lags half a division behind its arc, hence the factor.
    turn = math.radians(15) * 2 * n / (2 * n - 1)
    # The ring is 1 - 1.27 k deep on average, the core's elements about k / n wide.
    k = 1 / (1.27 + RING_TO_CORE * m / n)
    t = np.linspace(0, 1, n + 1)
    right = _arc(np.array([k * (1 + math.tan(turn / 2)), 0.0]), np.array([k, k]), turn, t)
    top = right[:, ::-1]
    floor = np.stack([right[0, 0] * t, np.zeros(n + 1)], axis=1)
    core = _transfinite(floor, top, floor[:, ::-1], right)
    inner = np.concatenate([right, top[-2::-1]])
    angle = np.linspace(0, np.pi / 2, 2 * n + 1)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    depth = np.linspace(0, 1, m + 1)[:, None, None]
    return core, (1 - depth) * inner + depth * rim


def _arc(start: Array, end: Array, turn: float, t: Array) -> Array:
    """Points (len(t), 2) of the circular arc that turns left by `turn` between two points."""
    chord = end - start
    length = np.sin(turn * t / 2) / math.sin(turn / 2)
    lean = -turn * (1 - t) / 2
    c, s = np.cos(lean), np.sin(lean)
    direction = np.stack([c * chord[0] - s * chord[1], s * chord[0] + c * chord[1]], axis=1)
    return np.asarray(start + length[:, None] * direction)


def _transfinite(floor: Array, top: Array, left: Array, right: Array) -> Array:
    """Coons patch (u, v, 2): floor and top (u, 2) run along u, left and right (v, 2) along v."""
    u = np.linspace(0, 1, len(floor))[:, None, None]
    v = np.linspace(0, 1, len(left))[None, :, None]
    corners = (
        (1 - u) * (1 - v) * floor[0]
        + u * (1 - v) * floor[-1]
        + (1 - u) * v * top[0]
        + u * v * top[-1]
    )
    along_u = (1 - v) * floor[:, None] + v * top[:, None]
    along_v = (1 - u) * left + u * right
    return np.asarray(along_u + along_v - corners)


def _quads(nodes: NDArray[np.intp]) -> NDArray[np.intp]:
    """Quads (q, 4) of a structured grid of node numbers (a, b)."""
    corners = [nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]]
    return np.stack(corners, axis=-1).reshape(-1, 4)
