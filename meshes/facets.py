"""Evaluation of nodal fields as by digital image correlation: fitted over facets, and smoothed."""

from functools import cached_property

import numpy as np
import scipy

from ..errors import InputError
from ..light_dataclasses import dataclass
from .mesh import Array
from .sampling import Mask, SmoothReading, Sparse


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
