"""Evaluation of nodal fields between the nodes: bilinear, by quadratics, or fitted over facets.

Quadratics at each node are smooth from quad to quad; digital image correlation fits facets.
"""

from functools import cached_property
from typing import Self, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from .mesh import Array, Mesh, Numbers

Mask: TypeAlias = NDArray[np.bool_]

#: A string, so that scipy.sparse is imported when a matrix is made and not to read a project.
Sparse: TypeAlias = "scipy.sparse.csr_matrix"

#: Natural coordinates (s, t) of the corners of a quad.
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def sampling_matrix(mesh: Mesh, points: Array, candidates: int = 12) -> tuple[Sparse, Mask]:
    """Return the matrix that interpolates nodal fields bilinearly at points.

    Parameters
    ----------
    mesh : Mesh
        Flat, in the xy plane.
    points : (n, 2) array, mm
    candidates : int
        Number of quads in which each point is searched, those with the nearest centres first.

    Returns
    -------
    sparse (points inside, nodes)
        Its product with nodal values is their value at the points that lie inside the mesh.
    mask (n,)
        Whether each point lies inside.
    """
    owner, natural = _quads_around(mesh, points, candidates)
    is_inside = owner >= 0
    s, t = natural[is_inside].T
    shape_functions = [0.25 * (1 + a * s) * (1 + b * t) for a, b in CORNERS]
    weights = np.stack(shape_functions, axis=1)
    count = len(weights)
    rows = np.repeat(np.arange(count), 4)
    columns = mesh.quads[owner[is_inside]].reshape(-1)
    entries = (weights.reshape(-1), (rows, columns))
    return scipy.sparse.csr_matrix(entries, shape=(count, len(mesh.points))), is_inside


def _quads_around(mesh: Mesh, points: Array, candidates: int) -> tuple[Numbers, Array]:
    """Return the quad in which each point lies, and the point's natural coordinates in it.

    They are (n,), -1 for a point outside the mesh, and (n, 2).

    Parameters
    ----------
    mesh : Mesh
    points : (n, 2) array, mm
    candidates : int
        Number of the nearest quads that are tried for each point.
    """
    tolerance = 1e-6  # of natural coordinates: points on an edge are inside
    corners = mesh.points[:, :2][mesh.quads]
    count = min(candidates, len(mesh.quads))
    _, nearest = scipy.spatial.cKDTree(corners.mean(axis=1)).query(points, k=count)
    nearest = nearest.reshape(len(points), count)
    owner = np.full(len(points), -1)
    natural = np.zeros((len(points), 2))
    for k in range(count):
        unowned = np.flatnonzero(owner < 0)
        if not len(unowned):
            break
        quads = nearest[unowned, k]
        trial = _natural_coordinates(corners[quads], points[unowned])
        is_hit = (np.abs(trial) <= 1.0 + tolerance).all(axis=1)
        owner[unowned[is_hit]] = quads[is_hit]
        natural[unowned[is_hit]] = trial[is_hit]
    return owner, natural


def _natural_coordinates(corners: Array, points: Array) -> Array:
    """Return natural coordinates (n, 2) of points (n, 2) mm, each in a quad of its own.

    Parameters
    ----------
    corners : array
        Of the quads, (n, 4, 2) mm. A point in a bilinear quad with the natural coordinates s, t is
        x = a + b s + c t + d s t, which Newton's method solves; the result is always finite.
    """
    iterations = 12
    smallest_determinant = 1e-12  # mm^2
    farthest = 10.0  # natural coordinate at which a point is kept that lies far outside
    rounding = 1e-14  # of a natural coordinate: smaller changes end the iteration
    first, second, third, fourth = np.swapaxes(corners, 0, 1)
    a = corners.mean(axis=1)
    b = 0.25 * (-first + second + third - fourth)
    c = 0.25 * (-first - second + third + fourth)
    d = 0.25 * (first - second + third - fourth)
    s = np.zeros(len(points))
    t = np.zeros(len(points))
    for _ in range(iterations):
        product = s * t
        gap = a + b * s[:, None] + c * t[:, None] + d * product[:, None] - points
        by_s = b + d * t[:, None]
        by_t = c + d * s[:, None]
        determinant = _cross(by_s, by_t)
        is_singular = np.abs(determinant) < smallest_determinant
        determinant = np.where(is_singular, smallest_determinant, determinant)
        step_s = _cross(gap, by_t) / determinant
        step_t = _cross(by_s, gap) / determinant
        before = s, t
        s = np.clip(s - step_s, -farthest, farthest)
        t = np.clip(t - step_t, -farthest, farthest)
        if np.abs(np.subtract((s, t), before)).max(initial=0.0) < rounding:
            break
    return np.stack([s, t], axis=1)


def _cross(first: Array, second: Array) -> Array:
    """Return the cross products (n,) of plane vectors.

    Parameters
    ----------
    first, second : (n, 2) array
    """
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]


#: Number of terms of a quadratic without its constant: x, y, x^2, xy, y^2.
TERMS = 5


@dataclass(frozen=True, eq=False)
class SmoothReading:
    """Interpolation of nodal fields in the xy plane by a quadratic at each node.

    Parameters
    ----------
    mesh : Mesh
    quadratics : sparse (5 nodes, nodes)
        Its product with nodal values are the coefficients of the quadratics, 5 for each node.
    """

    mesh: Mesh
    quadratics: Sparse

    @classmethod
    def of(cls, mesh: Mesh) -> Self:
        """Return the interpolation of fields on a mesh."""
        return cls(mesh, _quadratics(mesh))

    def matrix(self, points: Array) -> tuple[Sparse, Mask]:
        """Return the interpolation at points (n, 2) mm, as `sampling_matrix` does.

        It is a matrix (points inside, nodes), and a mask (n,) of the points inside the mesh.
        """
        bilinear, is_inside = sampling_matrix(self.mesh, points)
        shares = bilinear.tocoo()
        node = shares.col
        offset = points[is_inside][shares.row] - self.mesh.points[node, :2]
        values = shares.data[:, None] * _quadratic_terms(offset)
        columns = TERMS * node[:, None] + np.arange(TERMS)
        rows = np.repeat(shares.row, TERMS)
        entries = (values.reshape(-1), (rows, columns.reshape(-1)))
        shape = (bilinear.shape[0], TERMS * len(self.mesh.points))
        curved = scipy.sparse.csr_matrix(entries, shape=shape)
        return scipy.sparse.csr_matrix(bilinear + curved @ self.quadratics), is_inside


def _quadratic_terms(offset: Array) -> Array:
    """Return the terms (..., 5) of a quadratic in the distances from its node.

    Parameters
    ----------
    offset : (..., 2) array, mm
    """
    x = offset[..., 0]
    y = offset[..., 1]
    return np.stack([x, y, x * x, x * y, y * y], axis=-1)


def _quadratics(mesh: Mesh) -> Sparse:
    """Return the matrix (5 nodes, nodes) from nodal values to the coefficients of quadratics."""
    nodes = mesh.points[:, :2]
    count = len(nodes)
    neighbours_of = _neighbours(mesh)
    sizes = np.array([len(neighbours) for neighbours in neighbours_of])
    rows = []
    columns = []
    values = []
    for size in np.unique(sizes):
        fitted = np.flatnonzero(sizes == size)
        neighbours = np.stack([neighbours_of[node] for node in fitted])
        coefficients = _fitted_quadratics(nodes[neighbours] - nodes[fitted, None])
        terms = TERMS * fitted[:, None] + np.arange(TERMS)
        rows += [np.repeat(terms, size), terms.reshape(-1)]
        columns += [np.repeat(neighbours, TERMS, axis=0).reshape(-1), np.repeat(fitted, TERMS)]
        values += [coefficients.reshape(-1), -coefficients.sum(axis=2).reshape(-1)]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return scipy.sparse.csr_matrix(entries, shape=(TERMS * count, count))


def _fitted_quadratics(offset: Array) -> Array:
    """Return matrices (nodes, 5, n) from differences to a node's neighbours to its coefficients.

    Parameters
    ----------
    offset : array
        Of the n neighbours from each node, (nodes, n, 2) mm; nearer ones have more weight. If they
        do not determine all terms, as on the coarsest meshes, the smallest coefficients are taken.
    """
    distance = np.hypot(offset[..., 0], offset[..., 1])
    size = distance.max(axis=1)[:, None]
    weight = size / distance
    weighted_terms = weight[..., None] * _quadratic_terms(offset / size[..., None])
    coefficients = np.linalg.pinv(weighted_terms, rcond=1e-8) * weight[:, None]
    scale = size ** np.array([1, 1, 2, 2, 2])
    return coefficients / scale[..., None]


def _neighbours(mesh: Mesh, sufficient: int = 8) -> list[Numbers]:
    """Return for each node the numbers (k,) of the nodes to which its quadratic is fitted.

    They are those that share a quad with it and, if there are fewer than `sufficient`, those that
    share a quad with these.
    """
    count = len(mesh.points)
    quad_of_corner = np.repeat(np.arange(len(mesh.quads)), mesh.quads.shape[1])
    ones = np.ones(mesh.quads.size, dtype=np.int64)
    entries = (ones, (quad_of_corner, mesh.quads.reshape(-1)))
    belongs = scipy.sparse.csr_matrix(entries, shape=(len(mesh.quads), count))
    shares_quad = scipy.sparse.csr_matrix(belongs.T @ belongs)
    first_ring = _columns_by_row(shares_quad)
    second_ring = _columns_by_row(scipy.sparse.csr_matrix(shares_quad @ shares_quad))
    neighbours = []
    for node in range(count):
        is_sufficient = len(first_ring[node]) > sufficient
        nodes = first_ring[node] if is_sufficient else second_ring[node]
        neighbours.append(np.sort(nodes[nodes != node]).astype(np.intp))
    return neighbours


def _columns_by_row(matrix: Sparse) -> list[Numbers]:
    """Return the columns (k,) of the stored entries, for each row of a matrix."""
    return np.split(matrix.indices, matrix.indptr[1:-1])


@dataclass(frozen=True)
class Facet:
    """Settings of digital image correlation: its facets and its smoothing.

    Parameters
    ----------
    size : float
        Side of the square facet, mm.
    order : int
        Degree of the polynomial that is fitted to a facet, 1 or 2.
    window : int
        Odd number of points along a side of the square over which results are averaged; 1 for no
        smoothing.
    step : float, optional
        Distance of these points, mm.

    Raises
    ------
    InputError
        For other values, or smoothing without a step.
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
        """Return the Gauss points of a facet, and their weights.

        They are (m, 2) mm from its middle, and (m,) shares of its area. Five along a side are exact
        for polynomials up to the ninth degree.
        """
        nodes, weights = np.polynomial.legendre.leggauss(5)
        half = 0.5 * self.size
        x, y = np.meshgrid(half * nodes, half * nodes)
        shares = np.outer(weights, weights).ravel() / 4
        return np.column_stack([x.ravel(), y.ravel()]), shares

    @cached_property
    def centres(self) -> Array:
        """Return the middles of the facets averaged for a point, (window^2, 2) mm from it."""
        half = (self.window - 1) // 2
        along = np.arange(-half, half + 1) * (self.step or 0.0)
        x, y = np.meshgrid(along, along)
        return np.column_stack([x.ravel(), y.ravel()])

    def weights(self, is_seen: Mask) -> Array:
        """Return the weights (m,) of the Gauss points in the value at the middle of a facet.

        That value is the one of the polynomial that is fitted to the visible points.

        Parameters
        ----------
        is_seen : (m,) array
            Whether a point is visible, that is lies on the mesh.
        """
        places, areas = self.places
        x, y = places.T / self.size
        share = areas * is_seen
        terms = [np.ones_like(x), x, y]
        if self.order == 2:
            terms += [x * x, x * y, y * y]
        polynomial = np.column_stack(terms)
        moments = polynomial.T @ (share[:, None] * polynomial)
        middle = np.linalg.pinv(moments)[0]
        return (polynomial @ middle) * share


@dataclass(frozen=True, eq=False)
class FacetReading:
    """Evaluation of nodal fields as by digital image correlation.

    Parameters
    ----------
    reading : SmoothReading
        Interpolation of the fields at single points.
    facet : Facet
    smallest_share : float
        Share of a facet's area that has to lie on the mesh for the facet to be used.
    """

    reading: SmoothReading
    facet: Facet
    smallest_share: float = 0.5

    def matrix(self, points: Array) -> tuple[Sparse, Mask]:
        """Return the matrix (points inside, nodes) that evaluates nodal fields, and the mask (n,).

        Parameters
        ----------
        points : (n, 2) array, mm
            The mask says which of them lie on the mesh. Of a facet that extends beyond the edge of
            the mesh, the part on the mesh is used.
        """
        _, is_inside = self.reading.matrix(points)
        points_inside = points[is_inside]
        total = scipy.sparse.csr_matrix((len(points_inside), len(self.reading.mesh.points)))
        count = np.zeros(len(points_inside))
        for centre in self.facet.centres:
            facet_values, is_counted = self._facets(points_inside + centre)
            total = total + facet_values
            count += is_counted
        # A point whose facet is all but outside is read as it is.
        is_without_facet = count == 0
        if is_without_facet.any():
            plain, _ = self.reading.matrix(points_inside)
            total = total + scipy.sparse.diags(is_without_facet.astype(float)) @ plain
        shares = scipy.sparse.diags(1.0 / np.maximum(count, 1.0))
        return scipy.sparse.csr_matrix(shares @ total), is_inside

    def _facets(self, middles: Array) -> tuple[Sparse, Array]:
        """Return the matrix (facets, nodes) of facets with the given middles (facets, 2) mm.

        It is followed by 1 for each facet with enough area on the mesh, and 0, with an empty row,
        for each of the others.
        """
        offsets, share = self.facet.places
        places = (middles[:, None] + offsets).reshape(-1, 2)
        values, is_inside = self.reading.matrix(places)
        is_seen = is_inside.reshape(len(middles), -1)
        is_counted = is_seen @ share >= self.smallest_share
        weights = self._weights_of_facets(is_seen, is_counted)
        is_weighted = is_inside & np.repeat(is_counted, is_seen.shape[1])
        rows = np.repeat(np.arange(len(middles)), is_seen.shape[1])
        columns = np.cumsum(is_inside) - 1
        entries = (
            weights.reshape(-1)[is_weighted],
            (rows[is_weighted], columns[is_weighted]),
        )
        gather = scipy.sparse.csr_matrix(entries, shape=(len(middles), values.shape[0]))
        return scipy.sparse.csr_matrix(gather @ values), is_counted.astype(float)

    def _weights_of_facets(self, is_seen: Mask, is_counted: Mask) -> Array:
        """Return the weights (facets, points) of the Gauss points of all facets.

        They are computed once for all facets of which the same points are visible; `is_seen`
        (facets, points) says which, `is_counted` (facets,) which facets are used.
        """
        weights = np.zeros(is_seen.shape)
        weights_by_pattern: dict[bytes, Array] = {}
        for facet in np.flatnonzero(is_counted):
            pattern = is_seen[facet].tobytes()
            if pattern not in weights_by_pattern:
                weights_by_pattern[pattern] = self.facet.weights(is_seen[facet])
            weights[facet] = weights_by_pattern[pattern]
        return weights
