"""How many neighbouring values of a residual err as one.

A facet of a camera's correlation is wider than the step between two of its points, and what a
model cannot follow is smooth: neighbouring residuals are alike, and say less than as many
independent ones. Where the derivatives vary slowly over such a neighbourhood, the variance of what
is fitted grows by  1 + sum of rho(d) over the neighbours of a point,  rho the correlation at the
distance d; the sum is broken off where rho is first no more than chance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from .comparison import Objective

Array = NDArray[np.float64]

#: Rings around a point that others are compared with, unless told.
RINGS = 60
#: Distances looked at in a block, and blocks looked at, evenly spread.
DISTANCES, BLOCKS = 500_000, 60
#: Standard deviations of a correlation of independent values, which are no correlation.
CHANCE = 2.0
#: Of the largest extent: beyond, there are no neighbours any more, unless told.
REACH = 0.5


def alike_in(objective: Objective, residual: Array) -> float:
    """Of a comparison's residual (m,); 1 where its objective does not say where its values lie.

    Blocks count alike, whatever they are normalised with.
    """
    places = getattr(objective, "places", ())
    if not places:
        return 1.0
    ends = np.cumsum(objective.sizes)[:-1]
    return alike(np.split(residual, ends), places)


def alike(
    residuals: Sequence[Array], places: Sequence[Array], reach: float = REACH, rings: int = RINGS
) -> float:
    """Number of values that err as one, 1 where they are independent.

    Parameters
    ----------
    residuals : blocks (n,), each of one quantity in one frame. places : (n, 2) mm or (n, 1) of
        each. reach : of the largest extent, beyond which there are no neighbours any more.
        rings : of distances, up to there.
    """
    products, pairs, asked = np.zeros(rings), np.zeros(rings), 0
    random = np.random.default_rng(0)
    step = max(1, -(-len(residuals) // BLOCKS))
    for own, at in zip(residuals[::step], places[::step], strict=True):
        if len(own) < 2:
            continue
        few = random.permutation(len(own))[: max(20, DISTANCES // len(own))]
        extent = float(np.ptp(at, axis=0).max())
        ring = np.minimum(cdist(at[few], at) / (reach * extent) * rings, rings).astype(int)
        ring[np.arange(len(few)), few] = rings  # a point is no neighbour of its own
        value = own[few, None] * own
        inside = ring < rings
        # Every block counts alike, whatever its size.
        unit = float(np.mean(own**2))
        if not unit > 0:
            continue
        products += np.bincount(ring[inside], value[inside] / unit, minlength=rings)
        pairs += np.bincount(ring[inside], minlength=rings)
        asked += len(few)
    if not asked:
        return 1.0
    known = pairs > 0
    rho = products[known] / pairs[known]
    neighbours = pairs[known] / asked
    # Every pair was met twice, at most; of few pairs a correlation is chance.
    chance = rho <= CHANCE / np.sqrt(np.maximum(pairs[known] / 2, 1.0))
    positive = int(np.argmax(chance)) if chance.any() else len(rho)
    return float(1.0 + (rho * neighbours)[:positive].sum())
