"""Quadrilateral surface meshes as plain data: strain, enclosed volume, interpolation, facets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..compilation import compiled
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


NEIGHBOURS = 12  # candidate quads of a point, nearest centre first
INSIDE = 1.0 + 1e-6


def sampling_matrix(mesh: Mesh, points: Array) -> tuple[scipy.sparse.csr_matrix, NDArray[np.bool_]]:
    """Return bilinear interpolation (inside points, nodes) to points (n, 2) mm, and inside (n,)."""
    corner = mesh.points[:, :2][mesh.quads]
    count = min(NEIGHBOURS, len(mesh.quads))
    _, candidate = scipy.spatial.cKDTree(corner.mean(axis=1)).query(points, k=count)
    candidate = candidate.reshape(len(points), count)
    owner = np.full(len(points), -1)
    where = np.zeros((len(points), 2))
    for k in range(count):
        open_ = np.flatnonzero(owner < 0)
        if not len(open_):
            break
        natural = _natural(corner[candidate[open_, k]], points[open_])
        hit = (np.abs(natural) <= INSIDE).all(axis=1)
        owner[open_[hit]] = candidate[open_[hit], k]
        where[open_[hit]] = natural[hit]
    is_inside = owner >= 0
    s = where[is_inside, 0]
    t = where[is_inside, 1]
    weights = 0.25 * np.stack(
        [(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)], axis=1
    )
    rows = np.repeat(np.arange(int(is_inside.sum())), 4)
    columns = mesh.quads[owner[is_inside]].reshape(-1)
    shape = (int(is_inside.sum()), len(mesh.points))
    return scipy.sparse.csr_matrix((weights.reshape(-1), (rows, columns)), shape=shape), is_inside


def _natural(corner: Array, point: Array) -> Array:
    """Return natural coordinates (n, 2) of point (n, 2) in quads (n, 4, 2), by Newton; NaN-free."""
    a = corner.mean(axis=1)
    b = 0.25 * (-corner[:, 0] + corner[:, 1] + corner[:, 2] - corner[:, 3])
    c = 0.25 * (-corner[:, 0] - corner[:, 1] + corner[:, 2] + corner[:, 3])
    d = 0.25 * (corner[:, 0] - corner[:, 1] + corner[:, 2] - corner[:, 3])
    s = np.zeros(len(point))
    t = np.zeros(len(point))
    for _ in range(12):
        gap = a + b * s[:, None] + c * t[:, None] + d * (s * t)[:, None] - point
        by_s = b + d * t[:, None]
        by_t = c + d * s[:, None]
        det = by_s[:, 0] * by_t[:, 1] - by_s[:, 1] * by_t[:, 0]
        det = np.where(np.abs(det) < 1e-12, 1e-12, det)
        # A point far outside may have no answer: keep it bounded, it is then outside.
        s = np.clip(s - (gap[:, 0] * by_t[:, 1] - gap[:, 1] * by_t[:, 0]) / det, -10, 10)
        t = np.clip(t - (by_s[:, 0] * gap[:, 1] - by_s[:, 1] * gap[:, 0]) / det, -10, 10)
    return np.stack([s, t], axis=1)


#: Slopes of the bilinear shape functions at the middle, (corner, direction).
MIDDLE = 0.25 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


#: Direction of the warp where none is given.
X = np.array([1.0, 0.0, 0.0])


def surface_strain(
    mesh: Mesh, displacement: Array, warp: Array | None = None, stretch: Array | None = None
) -> Array:
    """Return (quads, 3) log strain at the middles; warp : (3,) or one a quad, else the mesh's.

    It is laid on each quad, x where there is none. stretch : (quads, 2, 2) of the yarns without
    stress, over those of the mesh; none unless given.
    """
    yarn = mesh.warp if warp is None else warp
    yarn = np.broadcast_to(X if yarn is None else yarn, (len(mesh.quads), 3))
    corners = mesh.points[mesh.quads]
    tangents = np.einsum("mni,nj->mij", corners, MIDDLE)
    normal = np.cross(tangents[..., 0], tangents[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.einsum("mi,mi->m", yarn, normal)[:, None]
    yarn = yarn - along * normal
    yarn = yarn / np.linalg.norm(yarn, axis=1, keepdims=True)
    yarns = np.stack([yarn, np.cross(normal, yarn)], axis=1)
    # Slopes along the two yarns, from those along the quad's own two directions.
    inverse = np.linalg.inv(np.einsum("mki,mij->mkj", yarns, tangents))
    slopes = np.einsum("nj,mjk->mnk", MIDDLE, inverse)
    gradient = np.einsum("mni,mnk->mik", corners + displacement[mesh.quads], slopes)
    if stretch is not None:
        gradient = gradient @ np.linalg.inv(stretch)
    return log_strain_of(gradient)


def log_strain_of(gradient: Array) -> Array:
    """Return log strain (..., 3) of gradients (..., 3, 2): images of unit warp and fill."""
    stretch, axes = np.linalg.eigh(np.einsum("...ki,...kj->...ij", gradient, gradient))
    h = np.einsum("...ia,...a,...ja->...ij", axes, 0.5 * np.log(stretch), axes)
    return np.stack([h[..., 0, 0], h[..., 1, 1], 2 * h[..., 0, 1]], axis=-1)


_G = 1 / np.sqrt(3)
_AT = _G * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_CORNER = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
#: Bilinear shape functions (point, corner) at 2 x 2 Gauss points, and their slopes.
GAUSS_VALUES = 0.25 * (1 + _AT[:, None, 0] * _CORNER[:, 0]) * (1 + _AT[:, None, 1] * _CORNER[:, 1])
_SLOPES = 0.25 * np.stack(
    [
        _CORNER[:, 0] * (1 + _AT[:, None, 1] * _CORNER[:, 1]),
        _CORNER[:, 1] * (1 + _AT[:, None, 0] * _CORNER[:, 0]),
    ]
)
_EVEN, _ORIGIN = np.full(3, 1 / 3), np.zeros(3)


def enclosed_volume(points: Array, quads: NDArray[np.intp]) -> float:
    """Return the volume (mm^3) inside a surface that planes through the origin may close."""
    return volume_and_gradient(points, quads)[0]


def volume_and_gradient(
    points: Array, quads: NDArray[np.intp], weight: Array = _EVEN, origin: Array = _ORIGIN
) -> tuple[float, Array]:
    """Return the volume (mm^3) and its derivative (n, 3) mm^2, exact for bilinear quads.

    V = sum_k weight_k * integral of (x_k - origin_k) n_k, weight (3,) adding to one, 1/3 each
    unless given: 0 where the surface is open along k. origin : (3,) mm, in planes of symmetry.
    """
    gradient = np.zeros(points.shape)
    points = np.ascontiguousarray(points, dtype=float)
    return _enclosed(points, quads, GAUSS_VALUES, _SLOPES, weight, origin, gradient), gradient


@compiled()
def _enclosed(points, quads, values, slopes, weight, origin, gradient):  # type: ignore[no-untyped-def]
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


# Nodal fields of a curved sheet read between its nodes: without the sag of flat quads.
#
# A quad of edge h under a surface of curvature k sags by up to k h^2 / 4: 0.2 to 0.4 mm of a bubble
# on a hundred quads. So every node has a quadratic of its own, through its value and near its
# neighbours', and a point in a quad reads those of the four corners, weighted by its bilinear shape
# functions: exact for quadratics, continuous, linear in the nodal values. Image correlation fits a
# polynomial to a square facet, takes its value in the middle, and may smooth neighbouring points;
# both are linear, so that the model is read in the same way.

#: Neighbours that a node needs for its quadratic; with fewer, theirs are asked, too.
ENOUGH = 8
#: Of a quadratic without its constant: x, y, x^2, xy, y^2.
TERMS = 5


@dataclass(frozen=True, eq=False)
class SmoothReading:
    """Reading of nodal fields in the xy plane; quadratics : (5 nodes, nodes), of each node."""

    mesh: Mesh
    quadratics: scipy.sparse.csr_matrix

    @classmethod
    def of(cls, mesh: Mesh) -> Self:
        return cls(mesh, _quadratics(mesh))

    def matrix(self, points: Array) -> tuple[scipy.sparse.csr_matrix, NDArray[np.bool_]]:
        """Return the matrix (inside points, nodes) to points (n, 2) mm, and inside (n,)."""
        bilinear, is_inside = sampling_matrix(self.mesh, points)
        shares = bilinear.tocoo()
        away = points[is_inside][shares.row] - self.mesh.points[shares.col, :2]
        values = shares.data[:, None] * _terms(away)
        columns = TERMS * shares.col[:, None] + np.arange(TERMS)
        rows = np.repeat(shares.row, TERMS)
        shape = (bilinear.shape[0], TERMS * len(self.mesh.points))
        flat = values.reshape(-1), (rows, columns.reshape(-1))
        curved = scipy.sparse.csr_matrix(flat, shape=shape)
        return scipy.sparse.csr_matrix(bilinear + curved @ self.quadratics), is_inside


def _terms(away: Array) -> Array:
    x, y = away.T
    return np.stack([x, y, x * x, x * y, y * y], axis=1)


def _quadratics(mesh: Mesh) -> scipy.sparse.csr_matrix:
    nodes = mesh.points[:, :2]
    count = len(nodes)
    rows = []
    columns = []
    values = []
    for node, neighbours in enumerate(_neighbours(mesh)):
        away = nodes[neighbours] - nodes[node]
        distance = np.hypot(*away.T)
        size = float(distance.max())
        weight = size / distance
        # Of the fewest-noded meshes not all terms are determined: the least of them are taken.
        solution = np.linalg.pinv(weight[:, None] * _terms(away / size), rcond=1e-8) * weight
        solution /= np.array([size, size, size**2, size**2, size**2])[:, None]
        terms = TERMS * node + np.arange(TERMS)
        rows += [np.repeat(terms, len(neighbours)), terms]
        columns += [np.tile(neighbours, TERMS), np.full(TERMS, node)]
        values += [solution.reshape(-1), -solution.sum(axis=1)]
    shape = (TERMS * count, count)
    flat = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return scipy.sparse.csr_matrix(flat, shape=shape)


def _neighbours(mesh: Mesh) -> list[NDArray[np.intp]]:
    count = len(mesh.points)
    corners = mesh.quads.shape[1]
    of_quad = np.repeat(np.arange(len(mesh.quads)), corners)
    ones = np.ones(mesh.quads.size, dtype=np.int64)
    belongs = scipy.sparse.csr_matrix(
        (ones, (of_quad, mesh.quads.reshape(-1))), shape=(len(mesh.quads), count)
    )
    shares_quad = scipy.sparse.csr_matrix(belongs.T @ belongs)
    further = scipy.sparse.csr_matrix(shares_quad @ shares_quad)
    first_ring, second_ring = (
        np.split(adjacency.indices, adjacency.indptr[1:-1]) for adjacency in (shares_quad, further)
    )
    chosen = (a if len(a) > ENOUGH else b for a, b in zip(first_ring, second_ring, strict=True))
    return [np.sort(nodes[nodes != node]).astype(np.intp) for node, nodes in enumerate(chosen)]


#: Gauss points along a side of a facet: exact for polynomials to the ninth degree.
GAUSS = 5
#: Of a facet, that has to lie in the mesh.
LEAST_SHARE = 0.5


@dataclass(frozen=True)
class Facet:
    """The way in which a camera's correlation sees a place.

    size : mm, side of the facet. order : of its shape function, 1 or 2. window : points along a
    side of the square of smoothing. step : mm apart.
    """

    size: float
    order: int = 1
    window: int = 1
    step: float | None = None

    def __post_init__(self) -> None:
        if not self.size > 0:
            raise InputError(None, "facet", f"expected more than 0 mm, got {self.size:g}")
        if self.order not in (1, 2):
            raise InputError(None, "order", f"expected 1 or 2, got {self.order}")
        if self.window < 1 or self.window % 2 == 0:
            raise InputError(None, "smoothing", f"expected 1, 3, 5 ... points, got {self.window}")
        if self.window > 1 and self.step is None:
            raise InputError(None, "step", "this key is missing; smoothing needs it")

    @cached_property
    def places(self) -> tuple[Array, Array]:
        """Return (m, 2) mm from the middle of a facet, and the shares (m,) of its area there."""
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
        x, y = np.meshgrid(0.5 * self.size * nodes, 0.5 * self.size * nodes)
        return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel() / 4

    @cached_property
    def centres(self) -> Array:
        """Return (window^2, 2) mm, of the facets over which a point is smoothed."""
        half = (self.window - 1) // 2
        along = np.arange(-half, half + 1) * (self.step or 0.0)
        x, y = np.meshgrid(along, along)
        return np.column_stack([x.ravel(), y.ravel()])

    def weights(self, is_seen: NDArray[np.bool_]) -> Array:
        """Return weights (m,) of the places seen: a polynomial keeps its value in the middle."""
        (x, y), share = self.places[0].T / self.size, self.places[1] * is_seen
        terms = [np.ones_like(x), x, y]
        if self.order == 2:
            terms += [x * x, x * y, y * y]
        v = np.column_stack(terms)
        first = np.linalg.pinv(v.T @ (share[:, None] * v))[0]
        return np.asarray((v @ first) * share)


@dataclass(frozen=True, eq=False)
class FacetReading:
    reading: SmoothReading
    facet: Facet

    def matrix(self, points: Array) -> tuple[scipy.sparse.csr_matrix, NDArray[np.bool_]]:
        """Return as `SmoothReading.matrix`; a facet over the edge reads the rest."""
        _, is_inside = self.reading.matrix(points)
        points_inside = points[is_inside]
        total = scipy.sparse.csr_matrix((len(points_inside), len(self.reading.mesh.points)))
        count = np.zeros(len(points_inside))
        for centre in self.facet.centres:
            read, is_seen = self._facets(points_inside + centre)
            total = total + read
            count += is_seen
        # A point whose facet is all but outside is read as it is.
        alone = count == 0
        if alone.any():
            plain, _ = self.reading.matrix(points_inside)
            total = total + scipy.sparse.diags(alone.astype(float)) @ plain
        shares = scipy.sparse.diags(1.0 / np.maximum(count, 1.0))
        return scipy.sparse.csr_matrix(shares @ total), is_inside

    def _facets(self, middles: Array) -> tuple[scipy.sparse.csr_matrix, Array]:
        """Return rows of facets, and 1 of each that counts; 0, with an empty row, of the others."""
        offsets, share = self.facet.places
        places = (middles[:, None] + offsets).reshape(-1, 2)
        read, is_inside = self.reading.matrix(places)
        is_seen = is_inside.reshape(len(middles), -1)
        counts = is_seen @ share >= LEAST_SHARE
        weights = np.zeros(is_seen.shape)
        weights_by_pattern: dict[bytes, Array] = {}
        for row in np.flatnonzero(counts):
            key = is_seen[row].tobytes()
            if key not in weights_by_pattern:
                weights_by_pattern[key] = self.facet.weights(is_seen[row])
            weights[row] = weights_by_pattern[key]
        columns = np.cumsum(is_inside) - 1
        rows = np.repeat(np.arange(len(middles)), is_seen.shape[1])
        flat = is_inside & np.repeat(counts, is_seen.shape[1])
        gather = scipy.sparse.csr_matrix(
            (weights.reshape(-1)[flat], (rows[flat], columns[flat])),
            shape=(len(middles), read.shape[0]),
        )
        return scipy.sparse.csr_matrix(gather @ read), counts.astype(float)


def places_of(levels: Sequence[float], steps: Sequence[float]) -> NDArray[np.intp]:
    """Return the number of the step nearest to each wanted one."""
    return np.array([int(np.argmin(np.abs(np.array(steps) - level))) for level in levels])


def keep_levels(
    model: Any, unit: str = "", unloaded: bool = False, **levels_by_name: Sequence[float]
) -> None:
    """Keep levels of a load, by name, in a frozen model; InputError unless positive and rising.

    unloaded : they need only change.
    """
    for name, levels in levels_by_name.items():
        values = np.array(levels, dtype=float)
        change = np.diff(values, prepend=0.0)
        moves = (change != 0).all() and (values > 0).all() if unloaded else (change > 0).all()
        if not (len(values) and np.isfinite(values).all() and moves):
            raise InputError(None, name, f"expected positive, increasing, got {values}{unit}")
        object.__setattr__(model, name, tuple(values.tolist()))
