"""Displacement derivatives along the strain path: one increment after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..base import PARAMETERS
from .newton import Membrane
from .sensitivity import POINT, advance, explicit

Array = NDArray[np.float64]


class Derivatives:
    """Derivatives of displacement, strain and stress, carried along the strain path.

    Parameters
    ----------
    parameters : names among `solvers.base.PARAMETERS`.
    """

    def __init__(self, membrane: Membrane, parameters: Sequence[str]) -> None:
        self.membrane = membrane
        self.which = np.array([PARAMETERS.index(name) for name in parameters])
        shape = (len(membrane.quads), 4, 3, len(self.which))
        self.strain, self.stress, self.fresh = np.zeros(shape), np.zeros(shape), np.empty(shape)
        self.point = np.empty((len(membrane.quads), 4, POINT))
        self.rate = np.empty((membrane.reference.size, len(self.which)))

    def at_fixed_displacement(self, u: Array) -> Array:
        """Explicit derivative of the residual at the equilibrium u, (3 n, np)."""
        m, e, law = self.membrane, self.membrane.elements, self.membrane.law
        explicit(
            m.reference + u, m.quads, e.values, e.slopes, e.area, m.section, law.beta, law.nu12,
            law.limits, law.area_power, m.strain_old, m.stress_old, self.which,
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
