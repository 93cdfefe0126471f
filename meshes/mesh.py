"""Quadrilateral surface meshes as plain data: strain, enclosed volume, interpolation, facets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..lazy_modules import psutil

if TYPE_CHECKING:
    import meshio


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of four-node quadrilaterals, counter-clockwise from where pressure inflates to.

    points : (n, 3) mm. quads : (m, 4). node_sets, element_sets : numbers by name, sorted. warp :
    (m, 3) unit direction (x where None); the fill is a quarter turn counter-clockwise.
    """

    points: NDArray[np.float64]
    quads: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
    element_sets: Mapping[str, NDArray[np.intp]] = field(default_factory=dict)
    warp: NDArray[np.float64] | None = None

    def unknowns(self, fixed: Mapping[str, Sequence[int]]) -> NDArray[np.intp]:
        """Return unknowns (3 * node + direction), sorted, of directions by node set, if there."""
        dofs = [
            3 * self.node_sets[name] + direction
            for name, directions in fixed.items()
            if name in self.node_sets
            for direction in directions
        ]
        return np.unique(np.concatenate([*dofs, np.empty(0, np.intp)])).astype(np.intp)


#: What an analysis takes, most of it factors of the tangent: 28,500 bytes a quad at 60,000 quads.
BYTES_A_QUAD = 30_000
#: Meshes up to this size (0.6 GB) are not compared with the memory that is free.
SMALL = 20_000


def check_memory(quads: int, field: str) -> None:
    """Raise InputError, about a key, where an analysis of so many quads does not fit in memory."""
    if quads <= SMALL:
        return
    needed = BYTES_A_QUAD * quads
    free = psutil.virtual_memory().available
    if needed > free:
        problem = (
            f"an analysis of {quads} quads takes about {needed / 1e9:.0f} GB of memory, and "
            f"{free / 1e9:.3g} GB are free; take fewer and larger ones"
        )
        raise InputError(None, field, problem)


def meshio_of(
    mesh: Mesh,
    displacement: ArrayLike,
    point_data: Mapping[str, ArrayLike],
    cell_data: Mapping[str, ArrayLike],
) -> meshio.Mesh:
    """Return the mesh displaced by (n, 3) mm with its data; ValueError : not one row a node."""
    import meshio

    u = np.asarray(displacement, dtype=float)
    points = {"displacement": u} | {name: np.asarray(values) for name, values in point_data.items()}
    for name, values in points.items():
        if len(values) != len(mesh.points):
            raise ValueError(f"{name}: {len(values)} rows for {len(mesh.points)} nodes")
    cells = {name: [np.asarray(values)] for name, values in cell_data.items()}
    return meshio.Mesh(mesh.points + u, [("quad", mesh.quads)], points, cells)


Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


def grid_quads(nodes: Numbers) -> Numbers:
    """Return quads (q, 4) of a structured grid of node numbers (a, b)."""
    corners = [nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def snapped(points: Array, tolerance: float) -> Array:
    """Return points (n, k) with coordinates within `tolerance` of zero exactly zero."""
    return np.where(np.abs(points) < tolerance, 0.0, points)


def with_mirror_image(points: Array, quads: Numbers, axis: int) -> tuple[Array, Numbers, Numbers]:
    """Return points, quads and their image in the plane x[axis] = 0, and each node's original."""
    off = points[:, axis] != 0
    image = np.arange(len(points))
    image[off] = len(points) + np.arange(np.count_nonzero(off))
    sign = np.where(np.arange(points.shape[1]) == axis, -1.0, 1.0)
    # A mirror turns quads round: read them backwards to keep the side that faces out.
    mirrored_quads = image[quads[:, ::-1]]
    source = np.concatenate([np.arange(len(points)), np.flatnonzero(off)])
    return (
        np.concatenate([points, points[off] * sign]),
        np.concatenate([quads, mirrored_quads]),
        source,
    )
