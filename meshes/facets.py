"""Nodal fields as image correlation sees them: over square facets, smoothed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from ..errors import InputError
from .mesh import Array
from .sampling import Mask, SmoothReading, Sparse


@dataclass(frozen=True)
class Facet:
    """The way in which a camera's correlation sees a place.

    Parameters
    ----------
    size : float
        Side of the facet, mm.
    order : int
        Of the facet's shape function, 1 or 2.
    window : int
        Points along a side of the square over which is smoothed, odd.
    step : float, optional
        Distance of these points, mm.

    Raises
    ------
    InputError
        For other values.
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
        """Return Gauss points (m, 2) mm from a facet's middle, and the shares (m,) of its area.

        Five along a side are exact for polynomials to the ninth degree.
        """
        nodes, weights = np.polynomial.legendre.leggauss(5)
        half = 0.5 * self.size
        x, y = np.meshgrid(half * nodes, half * nodes)
        shares = np.outer(weights, weights).ravel() / 4
        return np.column_stack([x.ravel(), y.ravel()]), shares

    @cached_property
    def centres(self) -> Array:
        """Return the middles (window^2, 2) mm of the facets over which a point is smoothed."""
        half = (self.window - 1) // 2
        along = np.arange(-half, half + 1) * (self.step or 0.0)
        x, y = np.meshgrid(along, along)
        return np.column_stack([x.ravel(), y.ravel()])

    def weights(self, is_seen: Mask) -> Array:
        """Return weights (m,) of the places seen: a polynomial keeps its value in the middle."""
        places, areas = self.places
        x, y = places.T / self.size
        share = areas * is_seen
        terms = [np.ones_like(x), x, y]
        if self.order == 2:
            terms += [x * x, x * y, y * y]
        polynomial = np.column_stack(terms)
        moments = polynomial.T @ (share[:, None] * polynomial)
        middle = np.linalg.pinv(moments)[0]
        return np.asarray((polynomial @ middle) * share)


@dataclass(frozen=True, eq=False)
class FacetReading:
    """Reading of nodal fields as the facets of a camera see them.

    Parameters
    ----------
    reading : SmoothReading
    facet : Facet
    smallest_share : float
        Share of a facet's area that has to lie in the mesh.
    """

    reading: SmoothReading
    facet: Facet
    smallest_share: float = 0.5

    def matrix(self, points: Array) -> tuple[Sparse, Mask]:
        """Return as `SmoothReading.matrix`; of a facet over the edge the part inside is read."""
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
        """Return rows of facets, and 1 of each that counts; 0, with an empty row, of the others."""
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
        """Return weights (facets, places): alike where the same places of a facet are seen."""
        weights = np.zeros(is_seen.shape)
        weights_by_pattern: dict[bytes, Array] = {}
        for facet in np.flatnonzero(is_counted):
            pattern = is_seen[facet].tobytes()
            if pattern not in weights_by_pattern:
                weights_by_pattern[pattern] = self.facet.weights(is_seen[facet])
            weights[facet] = weights_by_pattern[pattern]
        return weights
