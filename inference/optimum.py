"""The result of a fit from one start."""

from __future__ import annotations

from dataclasses import dataclass

from ..materials.forms.base import Array
from .problem import Evaluation

# How a fit ends, as a user reads it.
CONVERGED = "converged"
LEVEL = "settled"
ANALYSES_USED_UP = "analyses used up"
RUNS_USED_UP = "runs used up"


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best feasible point of one start.

    Attributes
    ----------
    best : Evaluation
    status : str
        How the fit ended: CONVERGED, LEVEL, ANALYSES_USED_UP, RUNS_USED_UP, or a failure.
    analyses : int
        By all solvers.
    runs : int
        By the solver that counts, while a surrogate led; 0 without a surrogate.
    failure : str
        Failure of that solver, if it ended the fit.
    """

    best: Evaluation
    status: str
    analyses: int
    runs: int = 0
    failure: str = ""

    @property
    def value(self) -> float:
        """Return the objective e."""
        return self.best.value

    @property
    def coefficients(self) -> Array:
        """Return the free coefficients, MPa."""
        return self.best.coefficients
