"""Nodal fields as a camera's correlation reads them: over a facet, and smoothed over a window.

Image correlation does not see the displacement of a point. It fits a polynomial (its shape
function) to all that lies in a square facet around it and takes its value in the middle; most
programs then smooth neighbouring points. Both are linear: weights at places around the point, the
same for a model as for the fabric, so that the model can be read in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from .smooth_reading import SmoothReading

Array = NDArray[np.float64]

#: Gauss points along a side of a facet: exact for polynomials to the ninth degree.
GAUSS = 5
#: Of a facet, that has to lie in the mesh.
LEAST_SHARE = 0.5


@dataclass(frozen=True)
class Facet:
    """How a camera's correlation sees a place.

    Parameters
    ----------
    size : mm, side of the square facet in the reference picture.
    order : of its shape function, 1 (the mean, and a slope) or 2.
    window : points along a side of the square over whose mean displacements are smoothed, odd.
    step : mm, between neighbouring points; needed for a window of more than one.

    Raises
    ------
    InputError : what is none of these.
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
        """(m, 2) mm from the middle of a facet, and the shares (m,) of its area there."""
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
        x, y = np.meshgrid(0.5 * self.size * nodes, 0.5 * self.size * nodes)
        return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel() / 4

    @cached_property
    def centres(self) -> Array:
        """(window^2, 2) mm, of the facets over which a point is smoothed."""
        half = (self.window - 1) // 2
        along = np.arange(-half, half + 1) * (self.step or 0.0)
        x, y = np.meshgrid(along, along)
        return np.column_stack([x.ravel(), y.ravel()])

    def weights(self, seen: NDArray[np.bool_]) -> Array:
        """(m,) weights of the places of which `seen` says that the camera sees them; zero else.

        By least squares over what is seen: a polynomial of the order keeps its value in the middle.
        """
        (x, y), share = self.places[0].T / self.size, self.places[1] * seen
        terms = [np.ones_like(x), x, y]
        if self.order == 2:
            terms += [x * x, x * y, y * y]
        v = np.column_stack(terms)
        first = np.linalg.pinv(v.T @ (share[:, None] * v))[0]
        return np.asarray((v @ first) * share)


@dataclass(frozen=True, eq=False)
class FacetReading:
    """A mesh in the xy plane whose nodal fields are read by facets."""

    reading: SmoothReading
    facet: Facet

    def matrix(self, points: Array) -> tuple[sp.csr_matrix, NDArray[np.bool_]]:
        """From the nodes to points (n, 2) mm; of a facet that reaches over the edge the rest.

        Returns
        -------
        matrix (inside points, nodes) and inside (n,): which points lie in the mesh at all.
        """
        _, inside = self.reading.matrix(points)
        own = points[inside]
        total = sp.csr_matrix((len(own), len(self.reading.mesh.points)))
        count = np.zeros(len(own))
        for centre in self.facet.centres:
            read, seen = self._facets(own + centre)
            total = total + read
            count += seen
        # A point whose facet is all but outside is read as it is.
        alone = count == 0
        if alone.any():
            plain, _ = self.reading.matrix(own)
            total = total + sp.diags(alone.astype(float)) @ plain
        return sp.csr_matrix(sp.diags(1.0 / np.maximum(count, 1.0)) @ total), inside

    def _facets(self, middles: Array) -> tuple[sp.csr_matrix, Array]:
        """Rows of facets, and 1 of each that counts; 0, with an empty row, of the others."""
        offsets, share = self.facet.places
        places = (middles[:, None] + offsets).reshape(-1, 2)
        read, inside = self.reading.matrix(places)
        seen = inside.reshape(len(middles), -1)
        counts = seen @ share >= LEAST_SHARE
        weights = np.zeros(seen.shape)
        known: dict[bytes, Array] = {}
        for row in np.flatnonzero(counts):
            key = seen[row].tobytes()
            if key not in known:
                known[key] = self.facet.weights(seen[row])
            weights[row] = known[key]
        columns = np.cumsum(inside) - 1
        rows = np.repeat(np.arange(len(middles)), seen.shape[1])
        flat = inside & np.repeat(counts, seen.shape[1])
        gather = sp.csr_matrix(
            (weights.reshape(-1)[flat], (rows[flat], columns[flat])),
            shape=(len(middles), read.shape[0]),
        )
        return sp.csr_matrix(gather @ read), counts.astype(float)
