"""Half of a tube along z as a grid of quads, and the half disk that closes its end.

Angles go from the bottom (y < 0) by the side x > 0 to the top.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .blocks import divided_quarter_disk
from .mirror import snapped, with_mirror_image

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

NEAR = 1e-9  # in radii


def angles(n: int, seam: float) -> Array:
    """Angles (4 n + 1,) of the rows of nodes from the bottom (0) to the top (pi).

    Equal but for the lowest quarter, where a row is put on the edge of the seam, at `seam`.
    """
    step = math.pi / (4 * n)
    angle = np.linspace(0.0, math.pi, 4 * n + 1)
    if seam:
        inside = min(max(1, round(seam / step)), 2 * n - 1)
        angle[: inside + 1] = np.linspace(0.0, seam, inside + 1)
        angle[inside : 2 * n + 1] = np.linspace(seam, 0.5 * math.pi, 2 * n - inside + 1)
    return angle


def of_equal_area(angle: Array, radius: float) -> float:
    """How far (mm) from the axis the nodes at these angles enclose the area of the circle.

    A polygon inscribed in the circle has too little area, 2.6 % of it with 16 sides: too little gas
    in it, and too little force of the gas on a cross-section. Half of the polygon with its corners
    at a distance r has r^2/2 times the sum of the sines of the angles between them, half of the
    circle pi/2 radius^2.
    """
    return radius * math.sqrt(math.pi / float(np.sin(np.diff(angle)).sum()))


def tube_grid(angle: Array, z: Array, radius: float) -> tuple[Array, Numbers, Numbers]:
    """Points, quads row by row, and the grid of node numbers (along, around).

    radius : mm, of the nodes, as `of_equal_area` has it.
    """
    circle = radius * snapped(np.stack([np.sin(angle), -np.cos(angle)], axis=1), NEAR)
    points = np.concatenate(
        [np.tile(circle, (len(z), 1)), np.repeat(z, len(angle))[:, None]], axis=1
    )
    grid = np.arange(len(points)).reshape(len(z), len(angle))
    # Around the tube from the bottom to the top, then along z: the normal points out.
    corners = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
    return points, np.stack(corners, axis=-1).reshape(-1, 4), grid


def with_cap(
    points: Array, quads: Numbers, grid: Numbers, angle: Array, n: int
) -> tuple[Array, Numbers, int]:
    """The tube with the half disk that closes it sewn on; and how many quads are the tube's."""
    quarter, pattern = divided_quarter_disk(n, max(1, round(n / 2)))
    disk, pattern, _ = with_mirror_image(snapped(quarter, NEAR), pattern, 1)
    at, far = np.arctan2(disk[:, 0], -disk[:, 1]), np.hypot(disk[:, 0], disk[:, 1])
    even = np.linspace(0.0, math.pi, len(angle))
    # Turned with the square of the radius, so that the rim meets the tube's rows of nodes.
    at += far**2 * (np.interp(at, even, angle) - at)
    end, radius = points[grid[-1, 0], 2], -points[grid[0, 0], 1]
    flat = radius * snapped(np.stack([far * np.sin(at), -far * np.cos(at)], axis=1), NEAR)
    rim = far > 1 - NEAR
    number = np.empty(len(disk), dtype=np.intp)
    number[rim] = grid[-1, np.argmin(np.abs(at[rim, None] - angle), axis=1)]
    number[~rim] = len(points) + np.arange(np.count_nonzero(~rim))
    inner = np.column_stack([flat[~rim], np.full(np.count_nonzero(~rim), end)])
    return np.concatenate([points, inner]), np.concatenate([quads, number[pattern]]), len(quads)
