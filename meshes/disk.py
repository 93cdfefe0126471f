"""A flat disk of quadrilaterals: o-grid of our own, or gmsh where it is asked for."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .mesh import Mesh

Array = NDArray[np.float64]

# Core corner over core half-width on the axis, root of 6 x^2 - 6 x + 1: the three quads that meet
# there then have 120 degrees each, which is the best that three can have.
CORNER = 0.5 + np.sqrt(1.0 / 12.0)
LEAST = 12
MOST = 4_000_000


def disk_mesh(
    radius: float,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh a disk around the origin, counter-clockwise quads in the plane z = 0.

    Parameters
    ----------
    radius : mm.
    elements : quads of the full disk (the thesis: 800); the nearest count that a good o-grid has
        is taken (800 is met exactly), a fourth of it for the quarter x, y >= 0.
    symmetry : "full" or "quarter".
    generator : "blocks" (needs nothing) or "gmsh" (needs its X and GL libraries).

    Returns
    -------
    Mesh with node sets "rim" and "apex" (one node), and "symmetry_x" (x = 0), "symmetry_y"
    (y = 0) for the quarter.

    Raises
    ------
    InputError : a radius that is not positive, a count below 12 or above four million.
    BubblefitError : gmsh is asked for and cannot be loaded.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(None, "radius", f"expected > 0 mm, got {radius}")
    if not LEAST <= elements <= MOST:
        raise InputError(None, "elements", f"expected {LEAST} to {MOST} quads, got {elements}")
    if symmetry not in ("full", "quarter"):
        raise InputError(None, "symmetry", f"expected 'full' or 'quarter', got {symmetry!r}")
    if generator == "gmsh":
        from .gmsh_disk import gmsh_quarter

        points, quads = gmsh_quarter(radius, elements)
    elif generator == "blocks":
        points, quads = _quarter(*divisions(elements))
        points = radius * points
    else:
        raise InputError(None, "generator", f"expected 'blocks' or 'gmsh', got {generator!r}")
    if symmetry == "full":
        points, quads = _reflect(points, quads)
    return Mesh(np.column_stack([points, np.zeros(len(points))]), quads, _sets(points, symmetry))


def divisions(elements: int) -> tuple[int, int]:
    """Core and ring divisions (n, m): 4 (n^2 + 2 n m) quads near `elements`, ring about n/2."""
    target = elements / 4.0
    best, chosen = np.inf, (1, 1)
    for n in range(1, int(np.sqrt(target)) + 2):
        for m in {max(1, int(np.floor((target / n - n) / 2))), max(1, round((target / n - n) / 2))}:
            count = n * n + 2 * n * m
            score = 20.0 * abs(count / target - 1.0) + abs(np.log(m / (0.55 * n)))
            if score < best:
                best, chosen = score, (n, m)
    return chosen


def _quarter(n: int, m: int) -> tuple[Array, NDArray[np.intp]]:
    """Unit quarter disk: core n x n, two ring blocks n x m along the core's outer sides."""
    half = n / (n + 1.1 * m)  # cells of core and ring about equally long
    corner = CORNER * half * np.ones(2)
    right, top = np.array([half, 0.0]), np.array([0.0, half])
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij")
    core = (
        (u * (1 - v))[..., None] * right
        + (u * v)[..., None] * corner
        + ((1 - u) * v)[..., None] * top
    )
    # The core's outer sides, from the x axis over the corner to the y axis, and the rim.
    side = np.concatenate([core[n, :, :], core[n - 1 :: -1, n, :]])
    angle = np.linspace(0, np.pi / 2, 2 * n + 1)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    rim[0, 1] = rim[-1, 0] = 0.0
    w = np.linspace(0, 1, m + 1)[1:, None, None]
    ring = (1 - w) * side + w * rim
    points = np.concatenate([core.reshape(-1, 2), ring.reshape(-1, 2)])
    inner = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    first = np.concatenate([inner[n, :], inner[n - 1 :: -1, n]])
    layers = np.vstack([first, (n + 1) ** 2 + np.arange(m * (2 * n + 1)).reshape(m, -1)])
    return points, np.concatenate([_cells(inner), _cells(layers)])


def _cells(grid: NDArray[np.intp]) -> NDArray[np.intp]:
    """Quads of a logically rectangular grid of node numbers, first index outward or along x."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.stack([a, b, c, d], axis=-1).reshape(-1, 4)


def _reflect(points: Array, quads: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """The full disk from its quarter; nodes on the axes are shared."""
    size = float(np.abs(points).max())
    for axis in (0, 1):
        on = np.abs(points[:, axis]) <= 1e-9 * size
        points = points.copy()
        points[on, axis] = 0.0
        other = np.arange(len(points))
        other[~on] = len(points) + np.arange(int((~on).sum()))
        mirrored = points[~on].copy()
        mirrored[:, axis] *= -1.0
        points = np.concatenate([points, mirrored])
        quads = np.concatenate([quads, other[quads][:, ::-1]])
    return points, quads


def _sets(points: Array, symmetry: str) -> dict[str, NDArray[np.intp]]:
    distance = np.hypot(points[:, 0], points[:, 1])
    near = 1e-6 * distance.max()
    sets = {
        "rim": np.flatnonzero(distance >= distance.max() - near),
        "apex": np.array([int(np.argmin(distance))]),
    }
    if symmetry == "quarter":
        sets["symmetry_x"] = np.flatnonzero(np.abs(points[:, 0]) <= near)
        sets["symmetry_y"] = np.flatnonzero(np.abs(points[:, 1]) <= near)
    return sets
