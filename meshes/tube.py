"""The cylinder of the bending test: a tube with a seam, closed by flat caps.

z runs along the cylinder, y up (the collar pushes along -y), the origin is the middle of the axis.
Angles go from the bottom, where the seam lies (thesis section 6.2), by x > 0 to the top.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .disk import divided_quarter_disk
from .mesh import Array, Mesh, Numbers, check_memory, grid_quads, snapped, with_mirror_image

NEAR = 1e-9  # in radii


def angles(n: int, seam: float) -> Array:
    """Return angles (4 n + 1,) from the bottom (0) to the top (pi), even but for one at `seam`."""
    step = math.pi / (4 * n)
    angle = np.linspace(0.0, math.pi, 4 * n + 1)
    if seam:
        in_seam = min(max(1, round(seam / step)), 2 * n - 1)
        angle[: in_seam + 1] = np.linspace(0.0, seam, in_seam + 1)
        angle[in_seam : 2 * n + 1] = np.linspace(seam, 0.5 * math.pi, 2 * n - in_seam + 1)
    return angle


def tube_grid(angle: Array, z: Array, radius: float) -> tuple[Array, Numbers, Numbers]:
    """Return points, quads row by row, node numbers (along, around); radius : mm, of the nodes."""
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
    """Return the tube with the half disk that closes it; and how many quads are the tube's."""
    quarter, pattern = divided_quarter_disk(n, max(1, round(n / 2)))
    disk, pattern, _ = with_mirror_image(snapped(quarter, NEAR), pattern, 1)
    at = np.arctan2(disk[:, 0], -disk[:, 1])
    distance = np.hypot(disk[:, 0], disk[:, 1])
    even = np.linspace(0.0, math.pi, len(angle))
    # Turned with the square of the radius, so that the rim meets the tube's rows of nodes.
    at += distance**2 * (np.interp(at, even, angle) - at)
    end = points[grid[-1, 0], 2]
    radius = -points[grid[0, 0], 1]
    flat = radius * snapped(np.stack([distance * np.sin(at), -distance * np.cos(at)], axis=1), NEAR)
    rim = distance > 1 - NEAR
    number = np.empty(len(disk), dtype=np.intp)
    number[rim] = grid[-1, np.argmin(np.abs(at[rim, None] - angle), axis=1)]
    number[~rim] = len(points) + np.arange(np.count_nonzero(~rim))
    inner = np.column_stack([flat[~rim], np.full(np.count_nonzero(~rim), end)])
    return np.concatenate([points, inner]), np.concatenate([quads, number[pattern]]), len(quads)


#: mm of element size for each mm away from a refined zone: neighbours differ by less than half.
GROWTH = 0.35
#: Points at which the wanted density of rows is looked at, for each row.
SAMPLES = 20


@dataclass(frozen=True)
class RefinedZone:
    """Elements of `size` mm up to `reach` mm around `position`, and there a row, the set `name`."""

    name: str
    position: float
    reach: float
    size: float


def rows(end: float, size: float, refinements: Sequence[RefinedZone] = ()) -> Array:
    """Return positions (mm) from 0 to `end`, closer at refinements; InputError : these too near."""
    places = sorted({0.0, float(end)} | {float(r.position) for r in refinements})
    for r in refinements:
        gap = min(abs(p - r.position) for p in places if p != r.position)
        if gap < 0.5 * r.size:
            problem = (
                f"{r.position:g} mm is {gap:.3g} mm from the end, the middle or another row, less"
                f" than half an element of {r.size:g} mm; move it or make it the same place"
            )
            raise InputError(None, f"refinements.{r.name}.position", problem)
    pieces = [_between(a, b, size, refinements) for a, b in pairwise(places)]
    return np.concatenate([[0.0], *pieces])


def _between(start: float, end: float, size: float, refinements: Sequence[RefinedZone]) -> Array:
    """Return rows after `start` up to `end`: equal parts of the integral of the wanted density."""
    finest = min([size, *(r.size for r in refinements)])
    count = max(SAMPLES, math.ceil(SAMPLES * (end - start) / finest))
    z = np.linspace(start, end, count + 1)
    sizes = np.full(len(z), float(size))
    for r in refinements:
        distance = np.maximum(np.abs(z - r.position) - r.reach, 0.0)
        sizes = np.minimum(sizes, r.size + GROWTH * distance)
    density = 1 / sizes
    total = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(z))])
    parts = max(1, round(total[-1]))
    places = np.interp(np.linspace(0.0, total[-1], parts + 1)[1:], total, z)
    places[-1] = end
    return np.asarray(places)


Masks = dict[str, NDArray[np.bool_]]
MAX_ELEMENTS = 1_000_000
#: Core divisions of a cap, at least: eight quads around half of the tube.
FEWEST = 2
#: How much longer than asked for a side around the tube may be: where a whole number does not go
#: around, rather more quads than longer ones.
LONGEST = 1.05
#: Half of the seam in sides, at least: with less the cap's quads next to it are bad.
NARROWEST = 0.25
#: Directions of the warp yarn that are symmetric in both planes.
CAP_WARP = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}


def cylinder_mesh(
    length: float,
    diameter: float,
    size: float,
    seam_width: float = 0.0,
    symmetry: Literal["quarter", "full"] = "quarter",
    refinements: Sequence[RefinedZone] = (),
    cap_warp: Literal["x", "y"] = "x",
    around: float = 1.0,
) -> Mesh:
    """Mesh the middle surface of a cylinder with flat caps.

    Nodes of the tube lie further out than the radius, so that polygons have the area of the circle.
    length, diameter, size, seam_width (at the bottom) : mm. symmetry : the quarter x, z >= 0, or
    the whole. refinements : along z >= 0. around : sides around the tube, a multiple of eight
    quads. Normals point out; `warp` is z on the tube, `cap_warp` on caps. Element sets: `body`,
    `seam`, `caps`. Node sets: the nodes of each, `ends`, `mid_span` (z = 0), `top_line`,
    `bottom_line`, `side_line`, `cap_centres`, each refinement's row, and NAME_bottom; on a quarter
    `symmetry_x`, `symmetry_z`.
    """
    _check(length, diameter, size, seam_width, around)
    radius = 0.5 * diameter
    z = rows(0.5 * length, size, refinements)
    n = max(FEWEST, math.ceil(math.pi * radius / (4 * LONGEST * around * size)))
    half = 8 * n * (len(z) - 1) + 3 * n * n
    if half > MAX_ELEMENTS:
        problem = f"{size:g} mm gives more than {MAX_ELEMENTS} elements a half; make them larger"
        raise InputError(None, "size", problem)
    check_memory(half // 2 if symmetry == "quarter" else 2 * half, "size")
    angle = angles(n, 0.5 * seam_width / radius)
    # Nodes are so far out that they enclose the area of the circle.
    out = radius * math.sqrt(math.pi / float(np.sin(np.diff(angle)).sum()))
    points, quads, grid = tube_grid(angle, z, out)
    points, quads, tube = with_cap(points, quads, grid, angle, n)

    seam = np.zeros(len(quads), bool)
    if seam_width:
        seam[:tube] = np.tile(angle[1:] <= 0.5 * seam_width / radius * (1 + NEAR), len(z) - 1)
    cap = np.arange(len(quads)) >= tube
    elements: Masks = {"body": ~seam & ~cap, "caps": cap} | ({"seam": seam} if seam_width else {})
    nodes = {name: np.isin(np.arange(len(points)), quads[m]) for name, m in elements.items()}
    nodes |= _lines(len(points), grid, points, z, refinements)
    if symmetry == "full":
        for axis in (0, 2):
            points, quads, source = with_mirror_image(points, quads, axis)
            nodes = {name: mask[source] for name, mask in nodes.items()}
            elements = {name: np.tile(mask, 2) for name, mask in elements.items()}
    else:
        nodes |= {"symmetry_x": points[:, 0] == 0, "symmetry_z": points[:, 2] == 0}
    warp = np.where(elements["caps"][:, None], CAP_WARP[cap_warp], (0.0, 0.0, 1.0))
    return Mesh(
        points,
        quads,
        {name: np.flatnonzero(mask) for name, mask in nodes.items()},
        {name: np.flatnonzero(mask) for name, mask in elements.items()},
        warp,
    )


def _check(length: float, diameter: float, size: float, seam_width: float, around: float) -> None:
    if not size <= 0.5 * min(diameter, length):
        problem = f"expected at most the radius and half the length, got {size:g} mm"
        raise InputError(None, "size", problem)
    if seam_width > math.pi * diameter / 4:
        problem = f"{seam_width:g} mm is more than a quarter of the tube's circumference"
        raise InputError(None, "seam_width", problem)
    if 0 < seam_width < 2 * NARROWEST * around * size:
        problem = (
            f"{seam_width:g} mm is too narrow for elements of {size:g} mm; make them"
            f" {seam_width / (2 * NARROWEST * around):g} mm or smaller"
        )
        raise InputError(None, "seam_width", problem)


def _lines(
    count: int, grid: Numbers, points: Array, z: Array, refinements: Sequence[RefinedZone]
) -> Masks:
    middle = grid.shape[1] // 2
    members = {
        "ends": grid[-1],
        "mid_span": grid[0],
        "bottom_line": grid[:, 0],
        "side_line": grid[:, middle],
        "top_line": grid[:, -1],
        "cap_centres": np.flatnonzero((points[:, :2] == 0).all(axis=1)),
    }
    for r in refinements:
        row = grid[int(np.argmin(np.abs(z - r.position)))]
        fresh = {r.name: row, f"{r.name}_bottom": row[:1]}
        members |= fresh
    return {name: np.isin(np.arange(count), nodes) for name, nodes in members.items()}


def surface_mesh(blocks: list[np.ndarray]) -> Mesh:
    """Join blocks, outward seen from the middle of the surface; sets by plane and pole."""
    points = np.concatenate([b.reshape(-1, 3) for b in blocks])
    ends = np.cumsum([b[..., 0].size for b in blocks])[:-1]
    nodes = zip(np.split(np.arange(len(points)), ends), blocks, strict=True)
    quads = np.concatenate(
        [grid_quads(nodes_of_block.reshape(b.shape[:2])) for nodes_of_block, b in nodes]
    )
    rounded = np.round(points, 6)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    points = points[first]
    quads = inverse.ravel()[quads]
    p = points[quads]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    inward = np.einsum("mk,mk->m", normal, p.mean(axis=1)) < 0
    quads[inward] = quads[inward, ::-1]
    sets = {
        f"symmetry_{n}": np.flatnonzero(np.abs(points[:, k]) < 1e-6) for k, n in enumerate("xyz")
    }
    return Mesh(points, quads, sets)


def sphere_octant(n: int, radius: float) -> Mesh:
    """Return 3 n^2 facets of a cube blown up, in x, y, z >= 0."""
    side = np.tan(np.linspace(0, np.pi / 4, n + 1))
    a, b = np.meshgrid(side, side, indexing="ij")
    cube = np.stack([np.ones_like(a), a, b], axis=-1)
    patch = radius * cube / np.linalg.norm(cube, axis=2, keepdims=True)
    return surface_mesh([np.roll(patch, k, axis=2) for k in range(3)])


def half_tube(across: int, along: int, radius: float, length: float, caps: bool = True) -> Mesh:
    """Mesh the x >= 0 half of a tube along z from 0 to length, closed at `length` by a flat cap.

    across : a multiple of 4; set "end" at z = length, "foot" on the lowest line.
    """
    angle = np.linspace(-np.pi / 2, np.pi / 2, across + 1)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    circle[[0, -1], 0] = 0.0
    z = np.linspace(0, length, along + 1)
    side = np.empty((across + 1, along + 1, 3))
    side[..., :2] = circle[:, None]
    side[..., 2] = z
    blocks = [side]
    if caps:
        quarter = across // 4
        c = 0.5 * radius
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
    cap = mesh.points[mesh.quads][..., 2].min(axis=1) > length - 1e-6
    return np.where(cap[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
