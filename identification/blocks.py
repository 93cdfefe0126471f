"""Residual blocks laid end to end: the objective e is the sum of their norms (Eqs 3.7, 4.8)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Norm below which a block counts as fitted exactly: the slope of its norm does not exist.
SMALLEST = 1e-14


class Blocks:
    """Where each block of a residual (m,) lies, and what follows from its norm.

    Parameters
    ----------
    sizes : length of each block, in order; together m.
    """

    def __init__(self, sizes: Sequence[int]) -> None:
        self.sizes = tuple(int(size) for size in sizes)
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]]).astype(np.intp)
        #: Block of each residual, (m,).
        self.of = np.repeat(np.arange(len(self.sizes)), self.sizes)

    def norms(self, residual: Array) -> Array:
        """Norm of each block, (blocks,): an RMS error over its scale."""
        return np.sqrt(np.add.reduceat(residual**2, self.starts))

    def value(self, residual: Array) -> float:
        """The objective e."""
        return float(self.norms(residual).sum())

    def gradient(self, residual: Array, jacobian: Array) -> Array:
        """Slope of e, (unknowns,); a block that fits exactly contributes nothing."""
        norms = np.maximum(self.norms(residual), SMALLEST)
        return np.asarray((residual / norms[self.of]) @ jacobian)
