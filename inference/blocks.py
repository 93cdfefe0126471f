"""Blocks of a residual vector, the sum of whose norms is the objective of a fit.

A block holds the residuals of one quantity, as one displacement component in one frame of a test.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..materials.forms.base import Array

MIN_NORM = 1e-14  # a block with a smaller norm counts as fitted exactly, and has no slope


class Blocks:
    """Where each block lies in a residual vector, and the norms of the blocks.

    Parameters
    ----------
    sizes : sequence of int
        Number of residuals of each block; m is their sum.

    Attributes
    ----------
    starts : (blocks,) int array
        Index of the first residual of each block.
    of : (m,) int array
        Index of the block that each residual belongs to.
    """

    def __init__(self, sizes: Sequence[int]) -> None:
        self.sizes = tuple(int(size) for size in sizes)
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]]).astype(np.intp)
        self.of = np.repeat(np.arange(len(self.sizes)), self.sizes)

    def norms(self, residual: Array) -> Array:
        """Return the norm of each block, (blocks,).

        With the scale of an objective it is an RMS error relative to what was measured.
        """
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
