"""Where a law stays positive definite while the fabric contracts under tension."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .forms.base import EVEN, RATIO_ENDS, Form, modulus_rows

Array = NDArray[np.float64]

#: How far E1 stays above nu12^2 E2, where the law ceases to be positive definite.
DEFINITE = 1.02


def definite_rows(form: Form, nu12: float, strain_range: Sequence[float]) -> Array:
    """(n, size): the law is positive definite in a pull along either yarn where rows @ beta >= 0.

    That is E1 E2 > (nu12 E2)^2. A fabric that is pulled contracts, so that the modulus across is
    that at zero strain, and the condition is linear: E1(0) > nu12^2 E2(eps2) in a pull along the
    fill, E1(eps1) > nu12^2 E2(0) along the warp. Moduli that go with the load ratio are those of
    the pull, and those of equal loads without strain, where every path begins.
    """
    share = DEFINITE * nu12**2
    none, most = RATIO_ENDS

    def rows(name: str, strain: ArrayLike, ratio: float) -> Array:
        return modulus_rows(form, name, strain, strain_range, ratio)

    warp, fill = (form.grid(k, strain_range[k]) for k in range(2))
    return np.vstack(
        [
            rows("E1", [0.0], none) - share * rows("E2", fill, most),
            rows("E1", warp, most) - share * rows("E2", [0.0], none),
            rows("E1", [0.0], EVEN) - share * rows("E2", [0.0], EVEN),
        ]
    )
