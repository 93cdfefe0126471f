"""A fit's problem at a law that is given: only the nuisance is fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .methods.descent import descend
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

#: Analyses in which what is no law (offsets, the sheet's surface) is fitted to the tests.
MOST = 40
TOLERANCE = 1e-9


def evaluate_law(problem: FitProblem, y: Array, with_jacobian: bool = False) -> Evaluation | None:
    """At the law of unknowns y, the nuisance where it fits best; None where an analysis failed.

    The nuisance stays as in y where the problem's solver gives no derivatives.
    """
    if not problem.unknowns.nuisance.all or not problem.differentiates:
        return problem.evaluate(y, with_jacobian, warm=False)
    first = problem.evaluate(y, True)
    if first is None:
        return None
    free = np.arange(problem.unknowns.count) >= problem.unknowns.size
    best, _ = descend(problem, first, TOLERANCE, MOST, norms=True, only=free)
    return best
