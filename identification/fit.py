"""A Levenberg-Marquardt fit from one start: two stages, restarts, and a check from flat.

The sum of squared blocks is minimised while e is far from its least; once that has settled at a
residual that is not zero, the blocks are reweighted so that e itself (a sum of norms, Eq. 4.8) is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .least_squares import bounded_step, descend
from .optimum import Optimum
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

SAME = 1e-5  # e of the same equilibrium, found twice
MOST_REWEIGHTED = 40  # analyses of the second stage
FEW = 20  # analyses of a fit without warm starts, at least
STIFFER = (2.0, 4.0)  # shear moduli of the restarts away from instability


def levenberg_marquardt(
    problem: FitProblem, start: Array, tolerance: float, max_analyses: int
) -> Optimum | None:
    """Fit from the unknowns `start`; None when the analysis at the start fails.

    Stops when e is below `tolerance`, on no progress, or after `max_analyses` (some more only
    where the fit turns out to hang on its warm starts).
    """
    kept = max_analyses - 1  # the last one checks what was found from the unloaded state
    met = problem.unstable  # where the start was drawn is no matter of the fit
    first = problem.evaluate(start, True)
    if first is None:
        return None
    best, status = _both_stages(problem, first, tolerance, kept)
    for factor in STIFFER:
        if best.value < tolerance or problem.unstable == met:
            break
        other, how = _from_stiffer(problem, best, factor, tolerance, kept)
        if other.value < best.value:
            best, status = other, how
    if best.value < tolerance:
        return Optimum(best, status, problem.analyses)
    # What a card promises has to be found from the flat state: make sure that the fit did not
    # settle on a branch that only its own warm starts reach.
    cold = problem.evaluate(best.unknowns, True, warm=False)
    if cold is not None and abs(cold.value - best.value) <= SAME * best.value:
        return Optimum(cold, status, problem.analyses)
    problem.warm_starts = False
    again = cold if cold is not None else problem.evaluate(start, True)
    if again is None:
        return None
    # A fit that used up its analyses with warm starts gets as many as a usual one takes.
    limit = max(max_analyses, problem.analyses + FEW)
    best, status = _both_stages(problem, again, tolerance, limit)
    return Optimum(best, status, problem.analyses)


def _both_stages(
    problem: FitProblem, point: Evaluation, tolerance: float, max_analyses: int
) -> tuple[Evaluation, str]:
    best, status = descend(problem, point, tolerance, max_analyses)
    if status == "settled":
        limit = min(max_analyses, problem.analyses + MOST_REWEIGHTED)
        best, status = descend(problem, best, tolerance, limit, reweighted=True)
    return best, status


def _from_stiffer(
    problem: FitProblem, best: Evaluation, factor: float, tolerance: float, max_analyses: int
) -> tuple[Evaluation, str]:
    """Again from a membrane `factor` times stiffer in shear, which is what keeps it stable.

    At the border of instability a fit stops short of a minimum, usually because G12 makes up for
    E1 and E2 that are still wrong: so these go first, and then all.
    """
    if problem.analyses >= max_analyses:
        return best, "analyses used up"
    shear = slice(problem.parameters.degree + 1)
    wanted = best.unknowns.copy()
    wanted[shear] *= factor
    a, c = problem.parameters.inequalities
    y = best.unknowns
    step = bounded_step(np.eye(len(y)), y - wanted, a, c, y)
    point = None if step is None else problem.evaluate(y + step, True)
    if point is None or not point.stable:
        return best, "settled"
    point, _ = descend(problem, point, tolerance, max_analyses, held=shear)
    return _both_stages(problem, point, tolerance, max_analyses)
