"""Strain regions of a load curve: where three straight lines follow it best."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError

#: Places that a break may take between zero and the last strain.
PLACES = 40


def strain_regions(strain: ArrayLike, load: ArrayLike) -> tuple[float, float]:
    """The two breaks of the broken line through the origin that follows the curve best.

    How Ambroziak and Klosowski read the regions of a coated fabric off its curve by eye, by
    least squares. Of the pairs on a grid of 40 places, the best.

    Parameters
    ----------
    strain, load : (n,) of one curve, strain above zero.

    Raises
    ------
    InputError : fewer than five points, or none with strain.
    """
    x, f = np.asarray(strain, dtype=float), np.asarray(load, dtype=float)
    if len(x) < 5 or not x.max() > 0:
        raise InputError(None, "load curve", f"five points are needed for regions, got {len(x)}")
    places = np.linspace(0.0, x.max(), PLACES + 2)[1:-1]
    hinges = np.maximum(x[:, None] - places, 0.0)
    best, least = (places[0], places[-1]), np.inf
    for a, b in itertools.combinations(range(PLACES), 2):
        terms = np.stack([x, hinges[:, a], hinges[:, b]], axis=1)
        slopes, *_ = np.linalg.lstsq(terms, f, rcond=None)
        error = float(np.sum((terms @ slopes - f) ** 2))
        if error < least:
            best, least = (places[a], places[b]), error
    return float(best[0]), float(best[1])
