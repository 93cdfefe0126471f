"""What an optimiser is to a fit, and how a fit is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..problem import FitProblem, Optimum

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FitOptions:
    """How each start is fitted.

    Parameters
    ----------
    method : name of an optimiser in the registry.
    gradient : "exact" or forward "differences", for an optimiser that takes either.
    constraints : "margin" (linear inequalities) or "boolean" (flags without a slope), likewise.
    tolerance : of the objective e, below which the fit has converged.
    max_analyses : of the problem, those counted already included.
    max_runs : of a solver that a differentiating surrogate leads to the least of its objective.
    """

    method: str = "lm"
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"
    tolerance: float = 1e-7
    max_analyses: int = 100
    max_runs: int = 10


class Method(Protocol):
    """An optimiser: it goes from a start to the least of a problem's objective e.

    It sees a `FitProblem`: `evaluate` (residual, exact Jacobian, e; None where the analysis
    failed), `blocks`, and of its `unknowns` the linear `inequalities` and the box. An analysis
    that fails and an equilibrium that is not `stable` are no points to go to.
    """

    @property
    def name(self) -> str:
        """What a project and the command line call it."""

    @property
    def needs_slope(self) -> bool:
        """Whether it cannot do without derivatives.

        A fit with it is led in by the comparisons that are easy to run, and to a solver without
        derivatives by a surrogate.
        """

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Fit from the unknowns `start`; None when the analysis there fails."""
