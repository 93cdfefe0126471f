"""What a fit from one start gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .problem import Evaluation

# How a fit ends, as a user reads it.
CONVERGED = "converged"
LEVEL = "settled"
ANALYSES_USED_UP = "analyses used up"
RUNS_USED_UP = "runs used up"


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best feasible point of one start.

    status : how the fit ended. analyses : all of them; runs : those of them that the solver that
    counts ran while a surrogate led (0 where there is none). failure : why the solver that counts
    failed, where that and nothing else ended the fit.
    """

    best: Evaluation
    status: str
    analyses: int
    runs: int = 0
    failure: str = ""

    @property
    def value(self) -> float:
        """The objective e at the best feasible point."""
        return self.best.value

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """The law's free coefficients (MPa) at the best feasible point."""
        return self.best.coefficients
