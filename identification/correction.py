"""A fit to a solver without derivatives: the membrane leads, the other corrects it.

Minimised is  membrane(beta) + [other(beta_k) - membrane(beta_k)] - data , with the membrane's exact
Jacobian; the other solver then runs once at the new beta, and so on until its own objective
settles. A step that worsens that objective is shortened (trust region). What counts, and what is
returned, is always the other solver's objective.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fit import levenberg_marquardt
from .optimum import Optimum
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

SETTLED = 0.1  # relative decrease of e by one run that is no longer worth another
SHORTER = 0.5
MOST_SHORTENED = 3  # in a row


def corrected_fit(
    problem: FitProblem, start: Array, tolerance: float, max_analyses: int, max_runs: int
) -> Optimum | None:
    """Fit from the unknowns `start`; None when the other solver fails wherever the membrane leads.

    Parameters
    ----------
    problem : with the solver that counts, and a `surrogate` that differentiates.
    max_analyses : of the surrogate, in each of its fits. max_runs : of the solver that counts.
    """
    surrogate = problem.surrogate
    assert surrogate is not None
    uncorrected = [experiment.objective for experiment in surrogate.experiments]
    best: Evaluation | None = None
    status, shortened = "runs used up", 0
    try:
        y = _led(surrogate, start, tolerance, max_analyses)
        while y is not None and problem.analyses < max_runs:
            point = problem.evaluate(y, False)
            if point is None or (best is not None and point.value >= best.value):
                level = (
                    point is not None
                    and best is not None
                    and point.value < (1 + SETTLED) * best.value
                )
                if level or shortened == MOST_SHORTENED:
                    status = "settled"
                    break
                shortened += 1
                origin = start if best is None else best.unknowns
                y = origin + SHORTER * (y - origin)
                continue
            settled = best is not None and point.value > (1 - SETTLED) * best.value
            best, shortened = point, 0
            if best.value < tolerance or settled:
                status = "settled" if settled else "converged"
                break
            beside = surrogate.evaluate(y, False, warm=False)
            if beside is None:
                status = f"{surrogate.solver.name} failed"
                break
            _restore(surrogate, uncorrected)
            surrogate.shift(point.histories, beside.histories)
            y = _led(surrogate, y, tolerance, max_analyses)
    finally:
        _restore(surrogate, uncorrected)
    if best is None:
        return None
    return Optimum(best, status, problem.analyses + surrogate.analyses, problem.analyses)


def _restore(surrogate: FitProblem, objectives: Sequence[Any]) -> None:
    for experiment, objective in zip(surrogate.experiments, objectives, strict=True):
        experiment.objective = objective


def _led(surrogate: FitProblem, y: Array, tolerance: float, analyses: int) -> Array | None:
    """Unknowns at the least of the surrogate's (corrected) objective."""
    surrogate.warm_starts = True
    found = levenberg_marquardt(surrogate, y, tolerance, surrogate.analyses + analyses)
    return None if found is None else found.best.unknowns
