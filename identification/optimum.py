"""What an optimiser returns for one start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .problem import Evaluation


@dataclass(frozen=True, eq=False)
class Optimum:
    """Best feasible point of one start, how it ended, all its analyses, and those of them that
    the solver that counts ran while a surrogate led (0 where there is none)."""

    best: Evaluation
    status: str
    analyses: int
    runs: int = 0

    @property
    def value(self) -> float:
        """e of Eq. 4.8 at the best feasible point."""
        return self.best.value

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Free coefficients (MPa) at the best feasible point."""
        return self.best.coefficients
