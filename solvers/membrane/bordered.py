"""A sparse tangent with one dense term: the gas of a cavity couples all nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .factorisation import Tangent

Array = NDArray[np.float64]


class BorderedTangent:
    """A sparse tangent plus c v v', solved by Sherman and Morrison's formula.

    A gas couples all nodes: dp/du = -c v with v = dV/du, which would fill the matrix.
    """

    def __init__(self, inner: Tangent) -> None:
        self.inner, self.data, self.slot = inner, inner.data, inner.slot
        self.stiffness, self.border = 0.0, np.empty(0)

    def factor(self) -> None:
        """Factorise the sparse part."""
        self.inner.factor()
        self.answer = self.inner.solve(self.border) if self.stiffness else self.border

    def definite(self) -> bool:
        """Whether the sparse part is (the rest is never negative)."""
        return self.inner.definite()

    def solve(self, rhs: Array) -> Array:
        x = self.inner.solve(rhs)
        if not self.stiffness:
            return x
        share = self.stiffness / (1.0 + self.stiffness * float(self.border @ self.answer))
        across = np.tensordot(self.border, x, axes=1)
        return np.asarray(x - share * np.multiply.outer(self.answer, across))
