"""Recording of displacements, forces and strains, increment by increment of a membrane."""

import numpy as np
from numpy.typing import NDArray

from .membrane import Membrane


class IncrementRecord:
    """Record of a membrane's increments.

    Attributes
    ----------
    path : (increments, nodes, 3) ndarray, mm
        Displacements.
    forces : (increments, nodes, 3) ndarray, N
        Residuals, which are the reactions at unknowns that are held.
    low, high : (3,) ndarray
        Extremes of the log strains eps1, eps2, gamma12 so far, zero included.
    """

    def __init__(self, membrane: Membrane, count: int) -> None:
        self.membrane = membrane
        self.path = np.zeros((count, *membrane.reference.shape))
        self.forces = np.zeros((count, *membrane.reference.shape))
        self.low = np.zeros(3)
        self.high = np.zeros(3)

    def accept(self, i: int, u: NDArray[np.float64]) -> None:
        """Accept the equilibrium u (n, 3) mm as the end of increment i, and record it."""
        self.membrane.accept()
        self.path[i] = u
        self.forces[i] = self.membrane.residual.reshape(u.shape)
        strain = self.membrane.strain_old[..., :3]
        np.minimum(self.low, strain.min(axis=(0, 1)), out=self.low)
        np.maximum(self.high, strain.max(axis=(0, 1)), out=self.high)


def load_labels(levels: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Return loads (n,) in words, each as its number and the unit."""
    return tuple(f"{level:.4g} {unit}" for level in levels.tolist())
