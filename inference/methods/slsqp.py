"""Sequential quadratic programming on e itself (NLopt's SLSQP)."""

from __future__ import annotations

import nlopt
import numpy as np
from numpy.typing import NDArray

from ..problem import FitProblem, Optimum
from .base import FitOptions
from .nlopt_search import nlopt_minimise


class Slsqp:
    """With the exact gradient of e, or with differences where asked for or nothing else is."""

    name = "slsqp"
    needs_slope = False

    def minimise(
        self, problem: FitProblem, start: NDArray[np.float64], options: FitOptions
    ) -> Optimum | None:
        """Fit from the unknowns `start`; None when the analysis there fails."""
        return nlopt_minimise(nlopt.LD_SLSQP, problem, start, options)
