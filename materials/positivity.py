"""Positive moduli as linear inequalities: A @ beta >= margin on a strain grid (Eqs 3.8, 4.9)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .moduli import coefficient_rows

Array = NDArray[np.float64]

#: Strains a modulus. Between two of them a cubic that is positive there can dip by no more than
#: 0.7 % of its largest value (Markov's bound on its curvature).
GRID = 31


def modulus_grid(strain_range: Sequence[float], breaks: Array | None = None) -> Array:
    """(3 * GRID, 12): rows times beta are G12, E2, E1 on their strain grids.

    strain_range : ends (eps1, eps2, gamma12); every grid starts at zero strain.
    breaks : (3, 2) of a tri-linear law: every region that the range reaches is in the grid.
    """
    rows = np.zeros((3 * GRID, 12))
    for block, component in enumerate((2, 1, 0)):
        own = None if breaks is None else breaks[component]
        part = coefficient_rows(_grid(strain_range[component], own), own)
        rows[GRID * block : GRID * (block + 1), 4 * block : 4 * block + 4] = part
    return rows


def _grid(end: float, breaks: Array | None) -> Array:
    if breaks is None:
        return np.linspace(0.0, end, GRID)
    # As many strains in a narrow region as in a wide one.
    knots = np.concatenate([[0.0], breaks[breaks < end], [end]])
    at = np.linspace(0.0, len(knots) - 1, GRID)
    return np.interp(at, np.arange(len(knots)), knots)


def margins(margin_e: float, margin_g: float) -> Array:
    """(3 * GRID,) least moduli in the order of `modulus_grid`, in the units of the arguments."""
    return np.concatenate([np.full(GRID, margin_g), np.full(2 * GRID, margin_e)])
