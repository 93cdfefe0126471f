"""Linear approximations without any gradient (NLopt's COBYLA)."""

from __future__ import annotations

import nlopt
import numpy as np
from numpy.typing import NDArray

from ..problem import FitProblem, Optimum
from .base import FitOptions
from .nlopt_search import nlopt_minimise

FIRST_STEP = 0.1  # of each bound's width


class Cobyla:
    """Only values of e: slow, and it asks nothing of the solver."""

    name = "cobyla"
    needs_slope = False

    def minimise(
        self, problem: FitProblem, start: NDArray[np.float64], options: FitOptions
    ) -> Optimum | None:
        """Fit from the unknowns `start`; None when the analysis there fails."""
        return nlopt_minimise(nlopt.LN_COBYLA, problem, start, options, FIRST_STEP)
