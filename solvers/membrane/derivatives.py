"""Displacement derivatives along the strain path: one increment after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...materials.forms.base import map_in_range
from .newton import Membrane
from .sensitivity import POINT, advance, explicit

Array = NDArray[np.float64]


class Derivatives:
    """Derivatives of displacement, strain and stress, carried along the strain path.

    Parameters
    ----------
    parameters : "beta_i" (entry i of the law's beta), "nu12", "pressure_offset".
    """

    def __init__(self, membrane: Membrane, parameters: Sequence[str]) -> None:
        self.membrane = membrane
        law, names = membrane.law, list(parameters)
        shape = (len(membrane.quads), 4, 3, len(names))
        of_beta = map_in_range(law.form, law.strain_range.tolist())
        self.rows = np.zeros((*of_beta.shape[:3], len(names)))
        for j, name in enumerate(names):
            if name.startswith("beta_"):
                self.rows[..., j] = of_beta[..., int(name.removeprefix("beta_"))]
        self.by_nu = np.array([float(name == "nu12") for name in names])
        self.push = names.index("pressure_offset") if "pressure_offset" in names else -1
        self.strain, self.stress, self.fresh = np.zeros(shape), np.zeros(shape), np.empty(shape)
        self.point = np.empty((len(membrane.quads), 4, POINT))
        self.rate = np.empty((membrane.reference.size, len(names)))

    def at_fixed_displacement(self, u: Array) -> Array:
        """Explicit derivative of the residual at the equilibrium u, (3 n, np)."""
        m, e, law = self.membrane, self.membrane.elements, self.membrane.law
        explicit(
            m.reference + u, m.quads, e.values, e.slopes, e.area, m.section, law.pieces, law.nu12,
            law.area_power, m.strain_old, m.stress_old, self.rows, self.by_nu, self.push,
            self.strain, self.stress, self.fresh, self.point, self.rate,
        )  # fmt: skip
        return self.rate

    def advance(self, du: Array) -> None:
        """Take strain and stress derivatives to the end of the increment, du (3 n, np)."""
        m = self.membrane
        self.stress, self.fresh = self.fresh, self.stress
        advance(m.quads, m.elements.slopes, self.point, du, self.strain, self.stress)

    def increment(self, u: Array) -> Array:
        """d u / d parameters (3 n, np) at the equilibrium u, factorised and not yet accepted."""
        m = self.membrane
        rate = self.at_fixed_displacement(u)
        du = np.zeros_like(rate)
        du[m.free] = -m.tangent.solve(rate[m.free])
        self.advance(du)
        return du
