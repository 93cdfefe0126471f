"""Closed forms of thin walls, for the tests of every model of them."""

from __future__ import annotations

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from scipy.integrate import solve_ivp


def capped_strain(
    law: HypoelasticLaw, pressure: float, radius: float, thickness: float
) -> np.ndarray:
    """Axial and hoop log strain of a long capped tube: D(eps) deps = d(p r/(2 t), p r/t)."""
    parts = np.array([0.5, 1.0])

    def rate(p: float, strain: np.ndarray) -> np.ndarray:
        e1, e2 = float(law.E1(strain[0])), float(law.E2(strain[1]))
        den = 1 - law.nu12**2 * e2 / e1
        d = np.array([[e1, law.nu12 * e2], [law.nu12 * e2, e2]]) / den
        line = radius * np.exp(strain[1]) / thickness * parts
        return np.linalg.solve(d - p * np.outer(line, [0.0, 1.0]), line)

    return solve_ivp(rate, (0, pressure), [0.0, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
