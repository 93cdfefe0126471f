"""Closed surfaces of quads: meshes that are joined from blocks, and the volume inside.

The meshes are of part of a sphere, and of half of a tube. A compiled kernel gives the volume with
its derivative.
"""

from collections.abc import Sequence

import numpy as np

from ..compilation import compiled
from .mesh import Array, Mesh, Numbers, grid_quads

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


#: mm: points closer to a plane lie in it.
TOLERANCE = 1e-6


def surface_mesh(blocks: Sequence[Array]) -> Mesh:
    """Join structured blocks of points, (a, b, 3) mm each, into one mesh.

    Normals point away from the origin. The node sets `symmetry_x`, `symmetry_y` and `symmetry_z`
    hold the nodes with x = 0, y = 0 and z = 0.
    """
    points = np.concatenate([block.reshape(-1, 3) for block in blocks])
    quads = []
    first = 0
    for block in blocks:
        grid = np.arange(first, first + block[..., 0].size).reshape(block.shape[:2])
        quads.append(grid_quads(grid))
        first += grid.size
    points, joined_quads = _joined(points, np.concatenate(quads))
    corners = points[joined_quads]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    is_inward = np.einsum("mk,mk->m", normal, corners.mean(axis=1)) < 0
    joined_quads[is_inward] = joined_quads[is_inward, ::-1]
    sets = {}
    for axis, name in enumerate("xyz"):
        sets[f"symmetry_{name}"] = np.flatnonzero(np.abs(points[:, axis]) < TOLERANCE)
    return Mesh(points, joined_quads, sets)


def _joined(points: Array, quads: Numbers) -> tuple[Array, Numbers]:
    """Return points (n, 3) mm and quads (m, 4) in which nodes at the same place are merged."""
    rounded = np.round(points, 6)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.ravel()[quads]


def sphere_octant(n: int, radius: float) -> Mesh:
    """Mesh the octant x, y, z >= 0 of a sphere by 3 n^2 quads, projected from a cube's faces.

    Parameters
    ----------
    radius : float, mm
    """
    side = np.tan(np.linspace(0, np.pi / 4, n + 1))
    a, b = np.meshgrid(side, side, indexing="ij")
    cube = np.stack([np.ones_like(a), a, b], axis=-1)
    patch = radius * cube / np.linalg.norm(cube, axis=2, keepdims=True)
    return surface_mesh([np.roll(patch, k, axis=2) for k in range(3)])


def half_tube(
    across: int,
    along: int,
    radius: float,
    length: float,
    caps: bool = True,
) -> Mesh:
    """Mesh the x >= 0 half of a tube along z from 0 to length, closed at `length` by a flat cap.

    Parameters
    ----------
    across, along : int
        Number of quads around the half, a multiple of 4, and along it.
    radius, length : float, mm
    caps : bool
        Whether the cap is meshed.

    Returns
    -------
    Mesh
        With the sets "end" at z = length and "foot" on the lowest line.
    """
    angle = np.linspace(-np.pi / 2, np.pi / 2, across + 1)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    circle[[0, -1], 0] = 0.0
    side = np.empty((across + 1, along + 1, 3))
    side[..., :2] = circle[:, None]
    side[..., 2] = np.linspace(0, length, along + 1)
    blocks = [side]
    if caps:
        for flat in _cap_blocks(circle, radius):
            height = np.full(flat.shape[:2], length)
            blocks.append(np.dstack([flat, height]))
    mesh = surface_mesh(blocks)
    x, y, z = mesh.points.T
    is_foot = (np.abs(x) < TOLERANCE) & (y < -radius + TOLERANCE)
    sets = {
        **mesh.node_sets,
        "end": np.flatnonzero(z > length - TOLERANCE),
        "foot": np.flatnonzero(is_foot),
    }
    return Mesh(mesh.points, mesh.quads, sets)


def _cap_blocks(circle: Array, radius: float) -> tuple[Array, Array]:
    """Return the two blocks (a, b, 2) mm of a half disk: the ring, and the square core.

    Parameters
    ----------
    circle : array
        Nodes of the rim, (n, 2) mm.
    """
    across = len(circle) - 1
    quarter = across // 4
    half_side = 0.5 * radius
    up = np.linspace(-half_side, half_side, across - 2 * quarter + 1)
    out = np.linspace(0, half_side, quarter + 1)
    floor = np.stack([out, np.full_like(out, -half_side)], axis=1)
    wall = np.stack([np.full_like(up, half_side), up], axis=1)
    ceiling = np.stack([out, np.full_like(out, half_side)], axis=1)
    core = np.concatenate([floor, wall[1:-1], ceiling[::-1]])
    share = np.linspace(0, 1, max(2, quarter) + 1)[None, :, None]
    rings = circle[:, None] * (1 - share) + core[:, None] * share
    square = np.stack(np.meshgrid(out, up, indexing="ij"), axis=-1)
    return rings, square


def tube_warp(mesh: Mesh, length: float) -> Array:
    """Return the direction of the warp (quads, 3) on a `half_tube`: z, and x on its cap."""
    is_cap = mesh.points[mesh.quads][..., 2].min(axis=1) > length - TOLERANCE
    return np.where(is_cap[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
