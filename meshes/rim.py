"""The curve that the rim nodes of a sheet lie on: a circle or an ellipse about the origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rim_form(points: Array) -> Array:
    """The symmetric matrix Q (2, 2), 1/mm^2, with p Q p = 1 at the rim nodes p (n, 2) mm.

    By least squares; of a circle 1 / radius^2 times the unit matrix.
    """
    size = float(np.abs(points).max())
    x, y = points.T / size
    terms = np.stack([x * x, 2 * x * y, y * y], axis=1)
    (xx, xy, yy), *_ = np.linalg.lstsq(terms, np.ones(len(points)), rcond=None)
    return np.array([[xx, xy], [xy, yy]]) / size**2


def rim_share(form: Array, points: Array) -> Array:
    """(n,) of points (n, 2) mm: 0 at the centre, 1 on the curve of the form."""
    return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", points, form, points)))
