"""Levenberg-Marquardt from one start: two stages, restarts, and a check from the unloaded state.

The sum of squared blocks is minimised while e is far from its least; once that is level at a
residual that is not zero, the blocks are weighted so that e itself (a sum of norms) is minimised.
"""

import numpy as np

from ...materials.forms.base import Array
from ..bounded_step import bounded_step
from ..descent import DescentSettings, descend
from ..optimum import ANALYSES_USED_UP, LEVEL, Optimum
from ..problem import Evaluation, FitProblem
from . import FitOptions

SAME = 1e-5  # e of the same equilibrium, reached twice
MOST_OF_NORMS = 40  # analyses of the second stage
FEW = 20  # analyses of a fit without warm starts, at least
#: The first stage ends early, as what follows goes on from there.
FIRST_STAGE = DescentSettings(settled_decrease=5e-4, settled_steps=2)
#: A restart shows where it leads before it is exact.
ROUGH = DescentSettings(negligible_decrease=1e-4)
AT_THE_END = 8  # analyses, among which an unstable one shows that the optimum lies at that border
STIFFER = (2.0, 4.0)  # in shear: factors of the restarts away from instability
NEAR = 1e-3  # of the squares, within which a restart leads back


class LevenbergMarquardt:
    """Levenberg-Marquardt by convex quadratic programmes; needs the exact Jacobian."""

    needs_slope = True
    boolean = False
    max_analyses = 100

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Fit from the unknowns `start`; None when the analysis there fails.
        Stops below the tolerance, on no progress, or when the analyses are used up."""
        tolerance = options.tolerance
        most = options.max_analyses
        before_last = most - 1  # the last one checks the optimum from the unloaded state
        begun = problem.analyses
        first = problem.evaluate(start, True)
        if first is None:
            return None
        level, status = descend(problem, first, tolerance, before_last, settings=FIRST_STAGE)
        if options.leads:
            return Optimum(level, status, problem.analyses)
        best, status = _then_norms(problem, level, status, tolerance, before_last)
        # Where the start was drawn, and the way far from its end, are no matter of the optimum.
        at_border = problem.last_unstable > max(begun, problem.analyses - AT_THE_END)
        for factor in STIFFER if at_border else ():
            if best.value < tolerance:
                break
            other, how = _from_stiffer(problem, best, level, factor, tolerance, before_last)
            if other.value < best.value:
                best = other
                status = how
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
        level, status = descend(problem, again, tolerance, limit)
        best, status = _then_norms(problem, level, status, tolerance, limit)
        return Optimum(best, status, problem.analyses)


def _then_norms(
    problem: FitProblem, point: Evaluation, status: str, tolerance: float, max_analyses: int
) -> tuple[Evaluation, str]:
    if status != LEVEL:
        return point, status
    limit = min(max_analyses, problem.analyses + MOST_OF_NORMS)
    return descend(problem, point, tolerance, limit, norms=True)


def _from_stiffer(
    problem: FitProblem,
    best: Evaluation,
    level: Evaluation,
    factor: float,
    tolerance: float,
    max_analyses: int,
) -> tuple[Evaluation, str]:
    """Fit again from a membrane `factor` times stiffer in shear, which is what keeps it stable.
    At the border of instability G12 usually makes up for others that are still wrong: these go
    first. Returns `best` as soon as the way back leads to `level`, the least squares behind it."""
    if problem.analyses >= max_analyses:
        return best, ANALYSES_USED_UP
    shear = problem.unknowns.shear
    y = best.unknowns
    target = best.unknowns.copy()
    target[shear] *= factor
    step = bounded_step(problem.unknowns, np.eye(len(y)), y - target, y)
    point = None if step is None else problem.evaluate(y + step, True)
    if point is None or not point.stable:
        return best, LEVEL
    for may_change in (~shear, None):
        point, _ = descend(
            problem, point, tolerance, max_analyses, may_change=may_change, settings=ROUGH
        )
    assert level.jacobian is not None
    away = level.jacobian @ (point.unknowns - level.unknowns)
    squares = np.sum(level.residual**2)
    higher = np.sum(point.residual**2) - squares
    if max(float(away @ away), abs(higher)) <= NEAR * squares:
        return best, LEVEL
    point, status = descend(problem, point, tolerance, max_analyses)
    return _then_norms(problem, point, status, tolerance, max_analyses)


METHOD = LevenbergMarquardt()
