"""The way from a random start to where all comparisons together can be fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .methods import FitOptions, Method
from .problem import FitProblem

Array = NDArray[np.float64]


def approach(problem: FitProblem, start: Array, method: Method, options: FitOptions) -> Array:
    """Unknowns at the least of the misfit of the comparisons that lead in; `start` without any.

    Those of the lowest stage are matched first, then those of the lowest two, and so on; the fit
    of all begins where the last but one ended. From a random start nearly every step of a fit of
    several tests can end without an equilibrium of one that is hard to run, and the fit creeps:
    strips along the yarns get to their optimum from anywhere; from there a bias strip does, which
    mostly has the shear modulus to find; and from there all tests together. `start` also where a
    comparison fails, or is unstable, at the optimum of the others.
    """
    stages = sorted({c.stage for c in problem.comparisons})
    if len(stages) < 2:
        return start
    y = start
    for last in stages[:-1]:
        part = problem.part([k for k, c in enumerate(problem.comparisons) if c.stage <= last])
        optimum = method.minimise(part, y, options)
        problem.analyses = part.analyses
        if problem.analyses >= options.max_analyses:
            return start
        y = start if optimum is None else optimum.best.unknowns
    point = problem.evaluate(y, False, warm=False)
    return y if point is not None and point.stable else start
