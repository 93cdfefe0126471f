"""Levenberg-Marquardt from one start: two stages, restarts, and a check from the unloaded state.

The sum of squared blocks is minimised while e is far from its least; once that is level at a
residual that is not zero, the blocks are weighted so that e itself (a sum of norms) is minimised.
"""

import numpy as np

from ...materials.forms.base import Array
from ..descent import bounded_step, descend
from ..problem import ANALYSES_USED_UP, LEVEL, Evaluation, FitProblem, Optimum
from . import FitOptions

SAME = 1e-5  # e of the same equilibrium, reached twice
MOST_OF_NORMS = 40  # analyses of the second stage
FEW = 20  # analyses of a fit without warm starts, at least
STIFFER = (2.0, 4.0)  # in shear: factors of the restarts away from instability


class LevenbergMarquardt:
    """Levenberg-Marquardt by convex quadratic programmes; needs the exact Jacobian."""

    needs_slope = True
    boolean = False
    max_analyses = 100

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Fit from the unknowns `start`; None when the analysis there fails.
        Stops below the tolerance, on no progress, or when the analyses are used up."""
        tolerance, most = options.tolerance, options.max_analyses
        before_last = most - 1  # the last one checks the optimum from the unloaded state
        met = problem.unstable  # where the start was drawn is no matter of the fit
        first = problem.evaluate(start, True)
        if first is None:
            return None
        best, status = _squares_then_norms(problem, first, tolerance, before_last)
        for factor in STIFFER:
            if best.value < tolerance or problem.unstable == met:
                break
            other, how = _from_stiffer(problem, best, factor, tolerance, before_last)
            if other.value < best.value:
                best, status = other, how
        if best.value < tolerance:
            return Optimum(best, status, problem.analyses)
        # What a card promises has to be reached from the unloaded state: make sure that the fit
        # did not end on a branch that only its own warm starts reach.
        cold = problem.evaluate(best.unknowns, True, warm=False)
        if cold is not None and not cold.stable:
            cold = None
        if cold is not None and abs(cold.value - best.value) <= SAME * best.value:
            return Optimum(cold, status, problem.analyses)
        problem.warm_starts = False
        again = cold if cold is not None else problem.evaluate(start, True)
        if again is None:
            return None
        # A fit that used up its analyses with warm starts gets as many as a usual one takes.
        limit = max(most, problem.analyses + FEW)
        best, status = _squares_then_norms(problem, again, tolerance, limit)
        return Optimum(best, status, problem.analyses)


def _squares_then_norms(
    problem: FitProblem, point: Evaluation, tolerance: float, max_analyses: int
) -> tuple[Evaluation, str]:
    best, status = descend(problem, point, tolerance, max_analyses)
    if status == LEVEL:
        limit = min(max_analyses, problem.analyses + MOST_OF_NORMS)
        best, status = descend(problem, best, tolerance, limit, norms=True)
    return best, status


def _from_stiffer(
    problem: FitProblem, best: Evaluation, factor: float, tolerance: float, max_analyses: int
) -> tuple[Evaluation, str]:
    """Fit again from a membrane `factor` times stiffer in shear, which is what keeps it stable.
    At the border of instability G12 usually makes up for others that are still wrong: these go
    first."""
    if problem.analyses >= max_analyses:
        return best, ANALYSES_USED_UP
    shear = problem.unknowns.shear
    y, target = best.unknowns, best.unknowns.copy()
    target[shear] *= factor
    a, c = problem.unknowns.inequalities
    step = bounded_step(np.eye(len(y)), y - target, a, c, y)
    point = None if step is None else problem.evaluate(y + step, True)
    if point is None or not point.stable:
        return best, LEVEL
    point, _ = descend(problem, point, tolerance, max_analyses, only=~shear)
    return _squares_then_norms(problem, point, tolerance, max_analyses)


METHOD = LevenbergMarquardt()
