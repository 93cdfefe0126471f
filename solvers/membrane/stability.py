"""Where equilibria are unstable, in words.

An equilibrium is stable where the tangent's symmetric part is positive definite (Hill, J. Mech.
Phys. Solids 6 (1958) 236): then every small motion away from it takes work, whatever it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def named(levels: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Loads (n,) by their number and unit."""
    return tuple(f"{level:.4g} {unit}" for level in levels.tolist())
