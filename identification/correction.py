"""A fit to a solver without derivatives: a surrogate leads, the other corrects it.

Minimised is  surrogate(beta) + [other(beta_k) - surrogate(beta_k)] - data , with the surrogate's
exact Jacobian; the other solver then runs once at the new beta, and so on until its own objective
is level. A step that worsens that objective is shortened (trust region). What counts, and what is
returned, is always the other solver's objective.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .comparison import Objective
from .methods import FitOptions, Method
from .optimum import CONVERGED, LEVEL, RUNS_USED_UP, Optimum
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

NOT_WORTH_A_RUN = 0.1  # relative decrease of e by one run
SHORTER = 0.5
MOST_SHORTER = 3  # steps in a row


def corrected_fit(
    problem: FitProblem, start: Array, method: Method, options: FitOptions
) -> Optimum | None:
    """Fit from the unknowns `start`; None when the other solver fails wherever the surrogate leads.

    Parameters
    ----------
    problem : with the solver that counts, and a `surrogate` that differentiates.
    method : for the surrogate's fits.
    options : `max_analyses` of the surrogate in each of its fits, `max_runs` of the solver that
        counts.
    """
    surrogate = problem.surrogate
    assert surrogate is not None
    with _corrections_of(surrogate) as objectives:
        best: Evaluation | None = None
        status, shorter, failure = RUNS_USED_UP, 0, ""
        y = _lead(surrogate, start, method, options)
        while y is not None and problem.analyses < options.max_runs:
            point = problem.evaluate(y, False)
            worse = point is not None and best is not None and point.value >= best.value
            if point is None or not point.stable or worse:
                if shorter == MOST_SHORTER or _is_level(point, best):
                    status, failure = LEVEL, problem.failure if point is None else ""
                    break
                shorter += 1
                origin = start if best is None else best.unknowns
                y = origin + SHORTER * (y - origin)
                continue
            level = best is not None and point.value > (1 - NOT_WORTH_A_RUN) * best.value
            best, shorter = point, 0
            if level or best.value < options.tolerance:
                status = LEVEL if level else CONVERGED
                break
            beside = surrogate.evaluate(y, False, warm=False)
            if beside is None:
                status = f"{surrogate.solver.name} failed"
                break
            _restore(surrogate, objectives)
            surrogate.shift(point.histories, beside.histories)
            y = _lead(surrogate, y, method, options)
    if best is None:
        return None
    status = f"{problem.solver.name} failed: {failure}" if failure else status
    runs = problem.analyses
    return Optimum(best, status, runs + surrogate.analyses, runs, failure)


def _is_level(point: Evaluation | None, best: Evaluation | None) -> bool:
    """Whether a run that went wrong was not much worse than the best."""
    if point is None or best is None or not point.stable:
        return False
    return point.value < (1 + NOT_WORTH_A_RUN) * best.value


@contextmanager
def _corrections_of(surrogate: FitProblem) -> Iterator[list[Objective]]:
    """The surrogate's own objectives, which it has again at the end."""
    objectives = [comparison.objective for comparison in surrogate.comparisons]
    try:
        yield objectives
    finally:
        _restore(surrogate, objectives)


def _restore(surrogate: FitProblem, objectives: Sequence[Objective]) -> None:
    for comparison, objective in zip(surrogate.comparisons, objectives, strict=True):
        comparison.objective = objective


def _lead(surrogate: FitProblem, y: Array, method: Method, options: FitOptions) -> Array | None:
    """Unknowns at the least of the surrogate's (corrected) objective."""
    surrogate.warm_starts = True
    most = surrogate.analyses + options.max_analyses
    optimum = method.minimise(surrogate, y, replace(options, max_analyses=most))
    return None if optimum is None else optimum.best.unknowns
