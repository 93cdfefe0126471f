"""Feasible starts: inside the bounds, of positive moduli, and they can be analysed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import NoFeasibleStart
from .problem import FitProblem
from .starts import MOST_DRAWS

Array = NDArray[np.float64]

MOST_ANALYSES = 50


def feasible_start(problem: FitProblem, seed: int, number: int) -> Array:
    """Unknowns of start `number` of the study `seed`: the same on any machine.

    Candidates of the problem's `starts`, whose moduli are positive over the strain range, are tried
    until an analysis ends well, in a stable equilibrium.

    Raises
    ------
    NoFeasibleStart : none in 200,000 draws or 50 analyses.
    """
    # Where another solver counts, its runs are not spent on draws.
    starts, problem = problem.starts, problem.surrogate or problem
    unknowns = problem.unknowns
    tried = 0
    for coefficients in starts.candidates(unknowns, seed, number):
        tried += 1
        y = unknowns.at(coefficients)
        point = problem.evaluate(y, False, warm=False)
        if point is not None and point.stable:
            return y
        if tried >= MOST_ANALYSES:
            raise NoFeasibleStart(
                f"start {number}: the analysis failed at all of {tried} random points with "
                "positive moduli; raise the lower bounds or add increments"
            )
    raise NoFeasibleStart(
        f"start {number}: none of {MOST_DRAWS} random points inside the bounds has positive "
        "moduli over the strain range; check the bounds and the strain range"
    )
