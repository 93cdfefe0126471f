"""How far loads of a ratio may go before a yarn is at the end of its strain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .biaxial_response import biaxial_response
from .law import HypoelasticLaw

#: kN/m: no fabric carries more. Halvings by which the end is found; increments of the law.
MOST, HALVINGS, LOADS = 1000.0, 50, 20


def largest_load(
    law: HypoelasticLaw, thickness: float, shares: Sequence[tuple[float, float]], ends: ArrayLike
) -> float:
    """kN/m of the larger load up to which every ratio keeps within strains; 0 where none does.

    Parameters
    ----------
    thickness : mm. shares : loads along warp and fill of each ratio, the larger 1. ends : (2,)
        logarithmic strains along warp and fill.
    """
    known = np.asarray(ends, dtype=float)

    def within(load: float) -> bool:
        larger = np.linspace(0.0, load, LOADS + 1)[1:]
        for pair in shares:
            found = biaxial_response(law, np.outer(larger, pair), thickness)
            if found.reached < LOADS or not (found.strain <= known).all():
                return False
        return True

    low, high = 0.0, MOST
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if within(middle) else (low, middle)
    return low
