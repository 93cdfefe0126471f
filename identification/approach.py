"""The way from a random start to where all tests together can be fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .fit import levenberg_marquardt
from .problem import FitProblem

Array = NDArray[np.float64]


def approach(problem: FitProblem, start: Array, tolerance: float, max_analyses: int) -> Array:
    """Unknowns at the least of the misfit of the tests that lead in; `start` where there are none.

    From a random start a bubble asks for moduli that strips do not survive: nearly every step
    ends without an equilibrium of the bias strip, and the fit creeps. Strips alone get to their
    optimum from anywhere, and all tests together from there. `start` also where the other tests
    fail, or are unstable, at that optimum.
    """
    if not problem.lead_in:
        return start
    part = problem.part(problem.lead_in)
    found = levenberg_marquardt(part, start, tolerance, max_analyses)
    problem.analyses = part.analyses
    if found is None or problem.analyses >= max_analyses:
        return start
    point = problem.evaluate(found.best.unknowns, False, warm=False)
    return found.best.unknowns if point is not None and point.stable else start
