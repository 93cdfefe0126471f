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
        Number of analyses by all solvers, surrogates included.
    runs : int
        Number of runs of the solver proper, in a fit that a surrogate led; 0 without a surrogate.
    failure : str
        Failure of the solver proper, if it ended such a fit.
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
