"""Closed surfaces whose answers are known: an octant of a sphere, half a tube with a flat cap."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh


def merged(points: np.ndarray, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes at one place made one."""
    _, first, inverse = np.unique(
        np.round(points, 6), axis=0, return_index=True, return_inverse=True
    )
    return points[first], inverse.ravel()[quads]


def block(surface: np.ndarray, first: int) -> np.ndarray:
    """Quads of a grid of points (rows, columns, 3) numbered from `first`."""
    rows, columns = surface.shape[:2]
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel() + first
    return np.stack([corner, corner + columns, corner + columns + 1, corner + 1], axis=1)


def surface_mesh(blocks: list[np.ndarray]) -> Mesh:
    """Blocks joined, outward seen from the middle of the surface; sets by plane and pole."""
    starts = np.cumsum([0] + [b.shape[0] * b.shape[1] for b in blocks])
    points = np.concatenate([b.reshape(-1, 3) for b in blocks])
    quads = np.concatenate([block(b, s) for b, s in zip(blocks, starts, strict=False)])
    points, quads = merged(points, quads)
    p = points[quads]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    inward = np.einsum("mk,mk->m", normal, p.mean(axis=1)) < 0
    quads[inward] = quads[inward, ::-1]
    sets = {
        f"symmetry_{n}": np.flatnonzero(np.abs(points[:, k]) < 1e-6) for k, n in enumerate("xyz")
    }
    return Mesh(points, quads, sets)


def sphere_octant(n: int, radius: float) -> Mesh:
    """3 n^2 facets of a cube blown up, in x, y, z >= 0."""
    side = np.tan(np.linspace(0, np.pi / 4, n + 1))
    a, b = np.meshgrid(side, side, indexing="ij")
    cube = np.stack([np.ones_like(a), a, b], axis=-1)
    patch = radius * cube / np.linalg.norm(cube, axis=2, keepdims=True)
    return surface_mesh([np.roll(patch, k, axis=2) for k in range(3)])


def half_tube(across: int, along: int, radius: float, length: float, caps: bool = True) -> Mesh:
    """x >= 0 half of a tube along z from 0 to length, at `length` a flat cap (or nothing).

    `across` facets (a multiple of 4) around the half circle; set "end" at z = length, "foot" on
    the lowest line.
    """
    angle = np.linspace(-np.pi / 2, np.pi / 2, across + 1)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    circle[[0, -1], 0] = 0.0
    z = np.linspace(0, length, along + 1)
    side = np.empty((across + 1, along + 1, 3))
    side[..., :2], side[..., 2] = circle[:, None], z
    blocks = [side]
    if caps:
        quarter, c = across // 4, 0.5 * radius
        up = np.linspace(-c, c, across - 2 * quarter + 1)
        out = np.linspace(0, c, quarter + 1)
        core = np.concatenate(
            [
                np.stack([out, np.full_like(out, -c)], axis=1),
                np.stack([np.full_like(up, c), up], axis=1)[1:-1],
                np.stack([out, np.full_like(out, c)], axis=1)[::-1],
            ]
        )
        share = np.linspace(0, 1, max(2, quarter) + 1)[None, :, None]
        rings = circle[:, None] * (1 - share) + core[:, None] * share
        square = np.stack(np.meshgrid(out, up, indexing="ij"), axis=-1)
        blocks += [np.dstack([flat, np.full(flat.shape[:2], length)]) for flat in (rings, square)]
    mesh = surface_mesh(blocks)
    p = mesh.points
    sets = {
        **mesh.node_sets,
        "end": np.flatnonzero(p[:, 2] > length - 1e-6),
        "foot": np.flatnonzero((np.abs(p[:, 0]) < 1e-6) & (p[:, 1] < -radius + 1e-6)),
    }
    return Mesh(p, mesh.quads, sets)


def tube_warp(mesh: Mesh, length: float) -> np.ndarray:
    """Warp along the tube; along x in the cap."""
    cap = mesh.points[mesh.quads][..., 2].min(axis=1) > length - 1e-6
    return np.where(cap[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
