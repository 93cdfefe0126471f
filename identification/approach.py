"""The way from a random start to where all tests together can be fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .fit import levenberg_marquardt
from .problem import FitProblem

Array = NDArray[np.float64]


def approach(problem: FitProblem, start: Array, tolerance: float, max_analyses: int) -> Array:
    """Unknowns at the least of the misfit of the tests that lead in; `start` where there are none.

    From a random start nearly every step of a joint fit can end without an equilibrium of the bias
    strip, and the fit creeps. Strips along the yarns get to their optimum from anywhere; from there
    the bias strip does, which mostly has G12 to find; and from there all tests together. `start`
    also where a test fails, or is unstable, at the optimum of the others.
    """
    if not problem.lead_in:
        return start
    y = start
    for tests in problem.lead_in:
        part = problem.part(tests)
        found = levenberg_marquardt(part, y, tolerance, max_analyses)
        problem.analyses = part.analyses
        if problem.analyses >= max_analyses:
            return start
        y = start if found is None else found.best.unknowns
    point = problem.evaluate(y, False, warm=False)
    return y if point is not None and point.stable else start
