"""Where a law stays positive definite while the fabric contracts under tension."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .forms.base import Form, moduli_on_grid

Array = NDArray[np.float64]

#: How far E1 stays above nu12^2 E2, where the law ceases to be positive definite.
DEFINITE = 1.02


def definite_rows(form: Form, nu12: float, strain_range: Sequence[float]) -> Array:
    """(n, size): the law is positive definite in a pull along either yarn where rows @ beta >= 0.

    That is E1 E2 > (nu12 E2)^2. A fabric that is pulled contracts, so that the modulus across is
    that at zero strain, and the condition is linear: E1(0) > nu12^2 E2(eps2) in a pull along the
    fill, E1(eps1) > nu12^2 E2(0) along the warp.
    """
    grid = moduli_on_grid(form, strain_range)
    e1, e2 = grid["E1"], grid["E2"]
    share = DEFINITE * nu12**2
    return np.vstack([e1[0] - share * e2, e1 - share * e2[0]])
