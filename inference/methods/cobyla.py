"""Linear approximations from values of e alone (NLopt's COBYLA): slow, and needs no derivatives."""

import nlopt

from ...materials.forms.base import Array
from ..problem import FitProblem, Optimum
from . import FitOptions
from .slsqp import nlopt_minimise

FIRST_STEP = 0.1  # of each bound's width


class Cobyla:
    """NLopt's COBYLA with linear or boolean constraints."""

    needs_slope = False
    boolean = True
    max_analyses = 2000

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        return nlopt_minimise(nlopt.LN_COBYLA, problem, start, options, FIRST_STEP)


METHOD = Cobyla()
