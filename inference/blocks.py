"""Blocks of a residual: the objective of a fit is the sum of their norms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..materials.forms.base import Array

MIN_NORM = 1e-14  # of a block: if less, it counts as fitted exactly, and its norm has no slope


class Blocks:
    """Positions and norms of the blocks of a residual.

    Parameters
    ----------
    sizes : sequence of int
        Number of residuals of each block, m together.

    Attributes
    ----------
    starts : (blocks,) int array
        First row of each block.
    of : (m,) int array
        Block of each residual.
    """

    def __init__(self, sizes: Sequence[int]) -> None:
        self.sizes = tuple(int(size) for size in sizes)
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]]).astype(np.intp)
        self.of = np.repeat(np.arange(len(self.sizes)), self.sizes)

    def norms(self, residual: Array) -> Array:
        """Return the norm of each block, (blocks,): an RMS error over its scale."""
        return np.sqrt(np.add.reduceat(residual**2, self.starts))

    def value(self, residual: Array) -> float:
        """Return the objective e, the sum of the norms of the blocks of a residual (m,)."""
        return float(self.norms(residual).sum())

    def gradient(self, residual: Array, jacobian: Array) -> Array:
        """Return the slope of e, (unknowns,); a block that fits exactly contributes nothing.

        Parameters
        ----------
        residual : (m,) array
        jacobian : (m, unknowns) array
        """
        norms = np.maximum(self.norms(residual), MIN_NORM)
        return np.asarray((residual / norms[self.of]) @ jacobian)
