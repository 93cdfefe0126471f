"""One fit from one start, by any method, for any solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .approach import approach
from .correction import corrected_fit
from .methods import FitOptions, method_named
from .optimum import Optimum
from .problem import FitProblem

Array = NDArray[np.float64]


def fit_from(
    problem: FitProblem, start: Array, options: FitOptions, near: bool = False
) -> Optimum | None:
    """Fit from the unknowns `start`; None when the analysis at the start fails.

    near : an optimum is near (a fit on another mesh ended there), so that nothing leads in.

    Raises
    ------
    InputError : there is no such method.
    """
    method = method_named(options.method)
    if not method.needs_slope:
        return method.minimise(problem, start, options)
    y = start if near else approach(problem.surrogate or problem, start, method, options)
    if problem.surrogate is not None:
        return corrected_fit(problem, y, method, options)
    return method.minimise(problem, y, options)
