"""Positive moduli as linear inequalities: A @ beta >= margin on a strain grid (Eqs 3.8, 4.9)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Strains a modulus. Between two of them a cubic that is positive there can dip by no more than
#: 0.7 % of its largest value (Markov's bound on its curvature).
GRID = 31


def modulus_grid(strain_range: Sequence[float], breaks: Array | None = None) -> Array:
    """(3 * GRID, 12): rows times beta are G12, E2, E1 on their strain grids.

    strain_range : ends (eps1, eps2, gamma12); every grid starts at zero strain. breaks : (3, 2) of
    a tri-linear law.
    """
    rows = np.zeros((3 * GRID, 12))
    for block, end in enumerate(reversed(list(strain_range))):
        strain = np.linspace(0.0, end, GRID)
        own = None if breaks is None else breaks[2 - block]
        part = slice(GRID * block, GRID * (block + 1)), slice(4 * block, 4 * block + 4)
        rows[part] = coefficient_rows(strain, own)
    return rows


def coefficient_rows(strain: Array, breaks: Array | None = None) -> Array:
    """(n, 4): rows times the four coefficients of a modulus are its values at `strain` (n,) >= 0.

    breaks : (2,) ends of the first two regions of a tri-linear law; its coefficients are nothing,
    and the moduli of the third, second and first region.
    """
    if breaks is None:
        return np.vander(strain, 4)
    region = np.searchsorted(breaks, strain, side="right")
    return np.asarray(np.eye(4)[3 - region])


def margins(margin_e: float, margin_g: float) -> Array:
    """(3 * GRID,) least moduli in the order of `modulus_grid`, in the units of the arguments."""
    return np.concatenate([np.full(GRID, margin_g), np.full(2 * GRID, margin_e)])
