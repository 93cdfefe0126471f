"""Sequential quadratic programming on e itself (NLopt's SLSQP)."""

import nlopt

from ...materials.forms.base import Array
from ..nlopt_search import nlopt_minimise
from ..problem import FitProblem, Optimum
from . import FitOptions


class Slsqp:
    """NLopt's SLSQP with the exact gradient of e, or with differences where there is none."""

    needs_slope = False
    boolean = True
    max_analyses = 500

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Fit from the unknowns `start`; None when the analysis there fails."""
        return nlopt_minimise(nlopt.LD_SLSQP, problem, start, options)


METHOD = Slsqp()
