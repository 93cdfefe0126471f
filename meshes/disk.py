"""Quadrilateral meshes of the flat specimen, whole or a quarter: core and two ring blocks."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..errors import InputError
from .gmsh_disk import quarter_disk_by_gmsh
from .mesh import Array, Mesh, Numbers, check_memory, grid_quads, snapped, with_mirror_image
from .outline import Outline


@dataclass(frozen=True)
class DiskProportions:
    """Proportions of the blocks of a quarter of the disk."""

    # Layers of the ring for each division of the core: beyond, elements are drawn out.
    fewest_layers: float = 1 / 3
    largest_layers: float = 1.0
    # Radial size of the ring's elements over the size of the core's: 1.2 keeps the largest element
    # of the thesis' mesh within 2.3 times the smallest.
    ring_to_core: float = 1.2


PROPORTIONS = DiskProportions()


def divided_quarter_disk(n: int, m: int) -> tuple[Array, Numbers]:
    """Mesh x, y >= 0 of the unit disk.

    Parameters
    ----------
    n, m : int
        Divisions of the core, and layers of the ring around it.

    Returns
    -------
    (nodes, 2) array, (quads, 4) array
        2 n + 1 nodes lie on the rim.
    """
    core, ring = _core_and_ring(n, m)
    core_nodes = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    # The core's two far sides, from the x axis to the y axis, are the ring's first layer.
    side = np.concatenate([core_nodes[n, :], core_nodes[-2::-1, n]])
    outer_nodes = core_nodes.size + np.arange(m * len(side)).reshape(m, len(side))
    ring_nodes = np.concatenate([side[None], outer_nodes])
    points = np.concatenate([core.reshape(-1, 2), ring[1:].reshape(-1, 2)])
    return points, np.concatenate([grid_quads(core_nodes), grid_quads(ring_nodes)])


def divisions(elements: float) -> tuple[int, int]:
    """Return core divisions n and ring layers m whose n^2 + 2 n m is nearest to `elements`."""
    best = (math.inf, math.inf, 1, 1)
    for n in range(1, math.isqrt(math.ceil(elements)) + 2):
        ideal = round((elements - n * n) / (2 * n))
        fewest = math.ceil(PROPORTIONS.fewest_layers * n)
        largest = max(1, math.floor(PROPORTIONS.largest_layers * n))
        m = min(max(ideal, fewest), largest)
        count = n * n + 2 * n * m
        best = min(best, (abs(count - elements), abs(m / n - 0.5), n, m))
    return best[2], best[3]


def _core_and_ring(n: int, m: int) -> tuple[Array, Array]:
    """Return points (n + 1, n + 1, 2) of the core and (m + 1, 2 n + 1, 2) of the ring."""
    # The last chord of a side should lie at 105 degrees: 60 from the diagonal, on either side
    # of it. A chord of n lags half a division behind its arc, hence the factor.
    turn = math.radians(15) * 2 * n / (2 * n - 1)
    # The ring is 1 - 1.27 k deep on average, the core's elements about k / n wide.
    k = 1 / (1.27 + PROPORTIONS.ring_to_core * m / n)
    t = np.linspace(0, 1, n + 1)
    foot = np.array([k * (1 + math.tan(turn / 2)), 0.0])
    right = _arc(foot, np.array([k, k]), turn, t)
    top = right[:, ::-1]
    floor = np.stack([right[0, 0] * t, np.zeros(n + 1)], axis=1)
    core = _transfinite(floor, top, floor[:, ::-1], right)
    inner = np.concatenate([right, top[-2::-1]])
    angle = np.linspace(0, np.pi / 2, 2 * n + 1)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    depth = np.linspace(0, 1, m + 1)[:, None, None]
    return core, (1 - depth) * inner + depth * rim


def _arc(start: Array, end: Array, turn: float, t: Array) -> Array:
    """Return points (len(t), 2) of an arc that turns left by `turn` between two points."""
    chord = end - start
    length = np.sin(turn * t / 2) / math.sin(turn / 2)
    lean = -turn * (1 - t) / 2
    cos = np.cos(lean)
    sin = np.sin(lean)
    x = cos * chord[0] - sin * chord[1]
    y = sin * chord[0] + cos * chord[1]
    direction = np.stack([x, y], axis=1)
    return np.asarray(start + length[:, None] * direction)


def _transfinite(floor: Array, top: Array, left: Array, right: Array) -> Array:
    """Return a Coons patch (u, v, 2): floor, top (u, 2) run along u, left, right (v, 2) along v."""
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


#: Quads on the full disk.
MIN_ELEMENTS = 8
MAX_ELEMENTS = 4_000_000
#: Nodes nearer to a symmetry line or the rim than this, in radii, are put on it.
ROUNDING = 1e-9


def check_disk_memory(elements: int, symmetry: str) -> None:
    """Raise InputError where an analysis of so many quads on the full disk is too large."""
    check_memory(elements if symmetry == "full" else elements // 4, "elements")


def disk_mesh(
    radius: float,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh a disk in the xy plane around the origin, or its quarter x, y >= 0.

    Parameters
    ----------
    radius : float
        mm.
    elements : int
        Quads wanted on the FULL disk, 8 or more; the mesh has as many within 16 below 200, and
        within 7 % above.
    symmetry : "full" or "quarter"
    generator : "blocks" or "gmsh"

    Returns
    -------
    Mesh
        Node sets: `rim`, `apex`; on a quarter also `symmetry_x` (u_x = 0), `symmetry_y`.

    Raises
    ------
    InputError
        For another number of elements, or more than the memory holds.
    """
    if not MIN_ELEMENTS <= elements <= MAX_ELEMENTS:
        problem = (
            f"expected {MIN_ELEMENTS} to {MAX_ELEMENTS} quads on the full disk, got {elements};"
            " 800 are usual"
        )
        raise InputError(None, "elements", problem)
    check_disk_memory(elements, symmetry)
    if generator == "gmsh":
        points, quads = quarter_disk_by_gmsh(elements / 4)
    else:
        points, quads = divided_quarter_disk(*divisions(elements / 4))
    points = snapped(points, ROUNDING)
    if symmetry == "full":
        for axis in (0, 1):
            points, quads, _ = with_mirror_image(points, quads, axis)
    # Sets are taken in unit radius, where the rim is 1 whatever the unit of length.
    distance = np.hypot(points[:, 0], points[:, 1])
    sets = {
        "rim": np.flatnonzero(distance > 1 - ROUNDING),
        "apex": np.flatnonzero((points == 0).all(axis=1)),
    }
    if symmetry == "quarter":
        sets["symmetry_x"] = np.flatnonzero(points[:, 0] == 0)
        sets["symmetry_y"] = np.flatnonzero(points[:, 1] == 0)
    flat = np.zeros((len(points), 3))
    flat[:, :2] = float(radius) * points
    return Mesh(flat, quads, sets)


#: Major over minor semi-axis: a more slender ellipse has quads that are hardly quads any more.
MOST_SLENDER = 4.0


def elliptic_disk_mesh(
    outline: Outline,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh the sheet within an outline, in the xy plane; a circle has the mesh of `disk_mesh`."""
    disk = disk_mesh(outline.major, elements, symmetry, generator)
    if outline.round:
        return disk
    if not 0 < outline.minor < outline.major:
        problem = f"expected a length above 0 and below the major {outline.major:g} mm"
        raise InputError(None, "minor", f"{problem}, got {outline.minor:g}")
    if outline.major > MOST_SLENDER * outline.minor:
        problem = f"expected at least the {MOST_SLENDER:g}th part of the major {outline.major:g} mm"
        raise InputError(None, "minor", f"{problem}, got {outline.minor:g}")
    if symmetry == "quarter" and not outline.doubly_symmetric:
        problem = f"axes at {outline.angle:g} degrees from the yarns need the whole: 'full'"
        raise InputError(None, "symmetry", problem)
    points = np.array(disk.points)
    points[:, :2] = outline.places(points[:, :2] / outline.major)
    return replace(disk, points=points)
