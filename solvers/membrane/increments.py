"""What is recorded of a membrane's increments."""

import numpy as np
from numpy.typing import NDArray

from .membrane import Membrane


class IncrementRecord:
    """Record of increments: path (increments, nodes, 3) mm, forces N, extremes of strain (3,)."""

    def __init__(self, membrane: Membrane, count: int) -> None:
        self.membrane = membrane
        self.path = np.zeros((count, *membrane.reference.shape))
        self.forces = np.zeros((count, *membrane.reference.shape))
        self.low = np.zeros(3)
        self.high = np.zeros(3)

    def accept(self, i: int, u: NDArray[np.float64]) -> None:
        """End increment i of the membrane at the displacement u (n, 3) mm, and record it."""
        self.membrane.accept()
        self.path[i] = u
        self.forces[i] = self.membrane.residual.reshape(u.shape)
        strain = self.membrane.strain_old[..., :3]
        np.minimum(self.low, strain.min(axis=(0, 1)), out=self.low)
        np.maximum(self.high, strain.max(axis=(0, 1)), out=self.high)


def load_labels(levels: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Return loads (n,) in words, by number and unit."""
    return tuple(f"{level:.4g} {unit}" for level in levels.tolist())
