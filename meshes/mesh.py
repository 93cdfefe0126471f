"""Surface meshes of quadrilaterals as plain data: yarns, log strain, mirror images, load levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..lazy_modules import psutil
from ..light_dataclasses import dataclass

if TYPE_CHECKING:
    import meshio


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface mesh of four-node quadrilaterals.

    Attributes
    ----------
    points : (n, 3) ndarray, mm
    quads : (m, 4) ndarray of int
        Nodes of each quad, counter-clockwise seen from the side towards which pressure inflates.
    node_sets, element_sets : mapping of str to ndarray of int
        Sorted numbers of the nodes, and of the quads, by the name of a set.
    warp : (m, 3) ndarray or None
        Unit vector of the warp in each quad, x if None; the fill is a quarter turn
        counter-clockwise from it.
    """

    points: NDArray[np.float64]
    quads: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
    element_sets: Mapping[str, NDArray[np.intp]] = field(default_factory=dict)
    warp: NDArray[np.float64] | None = None

    def unknowns(self, fixed: Mapping[str, Sequence[int]]) -> NDArray[np.intp]:
        """Return the sorted numbers of unknowns, 3 * node + direction, on node sets.

        Parameters
        ----------
        fixed : mapping of str to sequence of int
            Directions (0, 1, 2) by the name of a node set; sets that the mesh lacks are left out.
        """
        dofs = [
            3 * self.node_sets[name] + direction
            for name, directions in fixed.items()
            if name in self.node_sets
            for direction in directions
        ]
        return np.unique(np.concatenate([*dofs, np.empty(0, np.intp)])).astype(np.intp)


#: Length of a warp direction in the plane of a quad, over its own, from which it lies in the plane.
SMALLEST_IN_PLANE = 1e-6


def fabric_frames(mesh: Mesh, warp: ArrayLike) -> tuple[Array, Array]:
    """Return the directions of the yarns in the plane of each quad.

    Parameters
    ----------
    mesh : Mesh
    warp : (3,) or (quads, 3) array_like
        Direction of the warp, of any length.

    Returns
    -------
    warp, fill : (quads, 3) ndarray
        Unit vectors.

    Raises
    ------
    InputError
        If a direction is zero, not finite, or normal to its quad.
    """
    corner = mesh.points[mesh.quads]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    yarn = np.broadcast_to(np.asarray(warp, dtype=float), normal.shape)
    length = np.linalg.norm(yarn, axis=1, keepdims=True)
    absent = np.flatnonzero(~(np.isfinite(length) & (length > 0)))
    if len(absent):
        first = absent[0]
        problem = f"the direction of the warp in element {first + 1} is {yarn[first].tolist()}"
        raise InputError(None, "warp", f"{problem}: give a vector in its plane")
    yarn = yarn / length
    along = yarn - np.einsum("mk,mk->m", yarn, normal)[:, None] * normal
    length = np.linalg.norm(along, axis=1, keepdims=True)
    upright = np.flatnonzero(length < SMALLEST_IN_PLANE)
    if len(upright):
        raise InputError(None, "warp", _normal_warp(mesh, upright))
    along /= length
    return along, np.cross(normal, along)


def _normal_warp(mesh: Mesh, upright: Numbers) -> str:
    """Return what is wrong with a warp that is normal to some quads, and what to do.

    Parameters
    ----------
    upright : (n,) array
        Numbers of these quads.
    """
    count = f"{len(upright)} of {len(mesh.quads)} elements, the first is {upright[0] + 1}"
    problem = f"the warp direction is normal to a facet ({count})"
    if np.isin(upright, mesh.element_sets.get("caps", [])).all():
        return (
            f"{problem}: they are end caps, which lie across the cylinder's axis; give the warp "
            "there a direction in their plane (cap_warp)"
        )
    return f"{problem}: give a vector in its plane"


#: Memory in bytes for each quad that an analysis takes, mostly for the factors of the tangent;
#: 28,500 were measured with 60,000 quads.
BYTES_A_QUAD = 30_000
#: Number of quads (0.6 GB) up to which the memory is not checked.
SMALL = 20_000


def check_memory(quads: int, field: str) -> None:
    """Raise InputError if an analysis of a number of quads would not fit into the free memory.

    Parameters
    ----------
    field : str
        Key of the setting that determines the number, for the message.
    """
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
    """Return a displaced mesh with data at its nodes and quads as a mesh of meshio.

    Parameters
    ----------
    displacement : (n, 3) array, mm
    point_data, cell_data : mapping of str to array_like
        Arrays of n and m rows by name.

    Raises
    ------
    ValueError
        Data of the nodes have another number of rows.
    """
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
    """Return the quads (q, 4) of a structured grid.

    Parameters
    ----------
    nodes : (a, b) array
        Numbers of its nodes.
    """
    corners = [
        nodes[:-1, :-1],
        nodes[1:, :-1],
        nodes[1:, 1:],
        nodes[:-1, 1:],
    ]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def turned_over(quads: Numbers) -> Numbers:
    """Return quads (m, 4) from the same first corners whose normals point to the other side."""
    return np.take(quads, [0, 3, 2, 1], axis=1)


def snapped(points: Array, tolerance: float) -> Array:
    """Return points (n, k) whose coordinates within `tolerance` of zero are set to zero."""
    return np.where(np.abs(points) < tolerance, 0.0, points)


def with_mirror_image(points: Array, quads: Numbers, axis: int) -> tuple[Array, Numbers, Numbers]:
    """Return a mesh joined with its mirror image in the plane x[axis] = 0.

    Nodes in the plane are shared. The three arrays are the points, the quads (the given ones
    first), and for each node the number of the given node of which it is the image or the same.
    """
    is_off_plane = points[:, axis] != 0
    image = np.arange(len(points))
    image[is_off_plane] = len(points) + np.arange(np.count_nonzero(is_off_plane))
    sign = np.where(np.arange(points.shape[1]) == axis, -1.0, 1.0)
    # A mirror turns quads round: read them backwards to keep the side that faces out.
    mirrored_quads = image[quads[:, ::-1]]
    source = np.concatenate([np.arange(len(points)), np.flatnonzero(is_off_plane)])
    return (
        np.concatenate([points, points[is_off_plane] * sign]),
        np.concatenate([quads, mirrored_quads]),
        source,
    )


def places_of(levels: Sequence[float], steps: Sequence[float]) -> Numbers:
    """Return the index (levels,) of the step that is nearest to each level."""
    all_steps = np.array(steps)
    return np.array([int(np.argmin(np.abs(all_steps - level))) for level in levels])


def keep_levels(
    model: Any,
    unit: str = "",
    unloaded: bool = False,
    **levels_by_name: Sequence[float],
) -> None:
    """Validate load levels and store them as attributes of a frozen model.

    Parameters
    ----------
    model : frozen dataclass
    unit : str
        Unit of the levels, for the message of an error.
    unloaded : bool
        Whether levels may also fall, and need only differ from one to the next.
    **levels_by_name : sequences of float
        Levels by the name of the attribute.

    Raises
    ------
    InputError
        Unless levels are finite, positive and increasing.
    """
    for name, levels in levels_by_name.items():
        values = np.array(levels, dtype=float)
        change = np.diff(values, prepend=0.0)
        is_admissible = (change > 0).all()
        if unloaded:
            is_admissible = (change != 0).all() and (values > 0).all()
        if not (len(values) and np.isfinite(values).all() and is_admissible):
            raise InputError(None, name, f"expected positive, increasing, got {values}{unit}")
        object.__setattr__(model, name, tuple(values.tolist()))


#: Derivatives of the bilinear shape functions in the middle of a quad, (corner, direction).
MIDDLE = 0.25 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
#: Direction of the warp where none is given.
X = np.array([1.0, 0.0, 0.0])


def surface_strain(
    mesh: Mesh,
    displacement: Array,
    warp: Array | None = None,
    stretch: Array | None = None,
) -> Array:
    """Return the logarithmic strain of the yarns in the middle of each quad.

    Parameters
    ----------
    mesh : Mesh
    displacement : (nodes, 3) array, mm
    warp : (3,) or (quads, 3) array, optional
        Direction of the warp, which is projected on each quad; that of the mesh unless given, and x
        if the mesh has none.
    stretch : (quads, 2, 2) array, optional
        Stretch from the mesh to the stress-free yarns, in axes along warp and fill.

    Returns
    -------
    (quads, 3) array
        eps1 along the warp, eps2 along the fill, and the engineering shear gamma12.
    """
    corners = mesh.points[mesh.quads]
    tangents = np.einsum("mni,nj->mij", corners, MIDDLE)
    yarns = _yarn_directions(tangents, mesh.warp if warp is None else warp)
    # Slopes along the two yarns, from those along the quad's own two directions.
    inverse = np.linalg.inv(np.einsum("mki,mij->mkj", yarns, tangents))
    slopes = np.einsum("nj,mjk->mnk", MIDDLE, inverse)
    deformed = corners + displacement[mesh.quads]
    gradient = np.einsum("mni,mnk->mik", deformed, slopes)
    if stretch is not None:
        gradient = gradient @ np.linalg.inv(stretch)
    return log_strain_of(gradient)


def strain_of_tangents(tangents: Array, deformed: Array, warp: Array | None = None) -> Array:
    """Return the logarithmic strain of the yarns at points of a surface.

    Parameters
    ----------
    tangents, deformed : (n, 3, 2) arrays
        Two tangent vectors of the surface at each point, and what the deformation makes of them.
    warp : (3,) or (n, 3) array, optional
        Direction of the warp, which is projected on the surface; x unless given.

    Returns
    -------
    (n, 3) array
        eps1 along the warp, eps2 along the fill, and the engineering shear gamma12.
    """
    in_yarns = np.einsum("mki,mij->mkj", _yarn_directions(tangents, warp), tangents)
    return log_strain_of(deformed @ np.linalg.inv(in_yarns))


def _yarn_directions(tangents: Array, warp: Array | None) -> Array:
    """Return the unit vectors (n, 2, 3) of warp and fill at points with tangents (n, 3, 2)."""
    direction = np.broadcast_to(X if warp is None else warp, tangents.shape[:2])
    normal = np.cross(tangents[..., 0], tangents[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along_normal = np.einsum("mi,mi->m", direction, normal)[:, None]
    yarn = direction - along_normal * normal
    yarn = yarn / np.linalg.norm(yarn, axis=1, keepdims=True)
    return np.stack([yarn, np.cross(normal, yarn)], axis=1)


def log_strain_of(gradient: Array) -> Array:
    """Return the log strains eps1, eps2, gamma12, (..., 3), of deformation gradients.

    Parameters
    ----------
    gradient : (..., 3, 2) array
        Whose columns are the images of the unit vectors along warp and fill.
    """
    squared_stretch, axes = np.linalg.eigh(np.einsum("...ki,...kj->...ij", gradient, gradient))
    principal = 0.5 * np.log(squared_stretch)
    strain = np.einsum("...ia,...a,...ja->...ij", axes, principal, axes)
    shear = 2 * strain[..., 0, 1]
    return np.stack([strain[..., 0, 0], strain[..., 1, 1], shear], axis=-1)
