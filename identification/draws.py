"""Random laws inside the bounds of a fit, and which of them have positive moduli."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from .unknowns import Unknowns

Array = NDArray[np.float64]

#: Values of one modulus that are drawn.
MOST_VALUES = 4


def draw(unknowns: Unknowns, random: np.random.Generator, count: int) -> Array:
    """`count` random free coefficients (count, size) MPa, not all of them feasible."""
    return coefficients_at(unknowns, random.random((count, dimensions(unknowns))))


def dimensions(unknowns: Unknowns) -> int:
    """How many numbers between 0 and 1 say where a law is inside the bounds."""
    if unknowns.bounds.largest is None:
        return unknowns.size
    return _between(unknowns.form.modulus_of).shape[1]


def coefficients_at(unknowns: Unknowns, share: Array) -> Array:
    """Free coefficients (count, size) MPa at places (count, dimensions) between 0 and 1.

    Even in the box of their bounds; where the moduli themselves are bounded, even in the
    logarithm of their values at the control strains.
    """
    if unknowns.bounds.largest is None:
        lower, upper = unknowns.box
        return np.asarray(lower + (upper - lower) * share)
    between = _between(unknowns.form.modulus_of)
    ends = [np.log(end) for end in unknowns.bounds.control(unknowns.form)]
    values = np.exp(ends[0] + (ends[1] - ends[0]) * (share @ between.T))
    return np.asarray(values @ unknowns.from_values.T)


def _between(modulus_of: Sequence[str]) -> Array:
    """(size, drawn): from what is drawn to the control values of every modulus.

    Values of their own where a modulus has few; more are interpolated, because a curve through
    many independent ones hardly ever stays inside its bounds between them.
    """
    blocks = []
    for name in dict.fromkeys(modulus_of):
        count = sum(own == name for own in modulus_of)
        few = min(count, MOST_VALUES)
        at = np.linspace(0.0, few - 1.0, count)
        blocks.append(np.column_stack([np.interp(at, range(few), row) for row in np.eye(few)]))
    return np.asarray(block_diag(*blocks))


def allowed(unknowns: Unknowns, coefficients: Array) -> NDArray[np.bool_]:
    """Which of the free coefficients (n, size) MPa make moduli inside their bounds, (n,)."""
    grid, margin = unknowns.positivity
    moduli = coefficients @ grid.T
    good = (moduli >= margin).all(axis=1)
    if unknowns.ceiling is not None:
        good &= (moduli <= unknowns.ceiling).all(axis=1)
    return np.asarray(good)
