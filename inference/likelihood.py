"""Profile likelihood of a number that is linear in the unknowns of a fit, as a modulus is.

The number is held at values ever farther from its best, the others are fitted anew. The growth of
the weighted sum of squares, divided by `LinearisedFit.spread_over_curvature`, is -2 log of the
likelihood ratio: to first order it passes a level where the fit's own posterior does; beyond that
it shows curvature, ends that lie unevenly about the best, or that do not exist."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ..materials.card import LEVEL
from ..materials.forms.base import Array
from .bounded_step import bounded_step
from .problem import Evaluation, FitProblem

#: Of -2 log L, beyond which a value is out: chi-square of one degree of freedom.
THRESHOLD = float(2 * scipy.special.gammaincinv(0.5, LEVEL))
STEP, MOST_PLACES = 0.5, 16  # roots of -2 log L from place to place, and places of a side
#: From one step to the next; a step that fails is halved so many times.
MOST_GROWTH, HALVINGS = 3.0, 4
#: Of -2 log L: what one more step would bring, which is not worth an analysis; analyses of a place.
SETTLED, MOST_ANALYSES = 0.02, 5
FIRST = 0.25  # of the way to the bounds, at most, for the first step
#: How a side ends that does not pass the threshold.
BOUND, FAILED, FAR = "bound", "no analysis", "too many steps"


@dataclass(frozen=True)
class ProfileSide:
    """A profile to one side of the best: MPa from there on, and -2 log L; `why` it ends early."""

    values: tuple[float, ...]
    ratios: tuple[float, ...]
    reason: str
    analyses: int

    @property
    def end(self) -> float | None:
        """Return the value at the threshold, by a monotone curve of the root; None without."""
        if self.reason:
            return None
        values = np.array(self.values)
        roots = np.maximum.accumulate(np.sqrt(np.maximum(self.ratios, 0.0)))
        away = np.abs(values - values[0])
        keep = np.concatenate([[True], np.diff(roots) > 0])
        curve = scipy.interpolate.PchipInterpolator(roots[keep], away[keep])
        out = float(curve(np.sqrt(THRESHOLD)))
        return float(values[0] + np.sign(values[-1] - values[0]) * out)


def profile_side(
    problem: FitProblem,
    best: Evaluation,
    row: Array,
    sign: float,
    sigma: float,
    tell: Callable[[], None] = lambda: None,
) -> ProfileSide:
    """Hold row @ unknowns ever farther from the best until -2 log L passes the threshold.
    problem : weighted so that its sum of squares is -2 log L. best : its optimum, with Jacobian.
    sign : 1 upwards, -1 downwards. sigma : one standard deviation. tell : called after each place.
    """
    before = problem.analyses
    end = problem.unknowns.extreme(row, sign)
    start = float(row @ best.unknowns)
    least = float(best.residual @ best.residual)
    values = [start]
    ratios = [0.0]
    why = FAR
    step = min(STEP * sigma, FIRST * abs(end - start))
    point = best
    for _ in range(MOST_PLACES):
        room = sign * (end - values[-1])
        if not room > 1e-9 * max(abs(start), 1e-9):
            why = BOUND
            break
        found = None
        for _ in range(HALVINGS + 1):
            target = values[-1] + sign * step
            # The last step lands on the bound, not just before it.
            if step > room / (1.0 + FIRST):
                target = end
            found = fitted_at(problem, point, row, target)
            if found is not None:
                break
            step = 0.5 * abs(target - values[-1])
        if found is None:
            why = FAILED
            break
        point = found
        values.append(target)
        ratios.append(float(point.residual @ point.residual) - least)
        tell()
        if ratios[-1] >= THRESHOLD:
            why = ""
            break
        last = abs(values[-1] - values[-2])
        roots = np.sqrt(np.maximum(ratios[-2:], 0.0))
        grown = float(roots[1] - roots[0])
        step = last * min(STEP / grown if grown > 0 else np.inf, MOST_GROWTH)
    return ProfileSide(tuple(values), tuple(ratios), why, problem.analyses - before)


def fitted_at(
    problem: FitProblem, point: Evaluation, row: Array, target: float
) -> Evaluation | None:
    """Fit with row @ unknowns held at the target, from a neighbour's optimum; None where that
    fails."""
    limit = problem.analyses + MOST_ANALYSES
    y, (curvature, gradient) = point.unknowns, _squares(point)
    step = bounded_step(problem.unknowns, curvature, gradient, y, plane=(row, target))
    if step is None:
        return None
    here = _stable(problem, y + step)
    while here is not None and problem.analyses < limit:
        curvature, gradient = _squares(here)
        at = here.unknowns
        step = bounded_step(problem.unknowns, curvature, gradient, at, plane=(row, target))
        if step is None or -(2.0 * gradient @ step + step @ curvature @ step) < SETTLED:
            break
        value = float(here.residual @ here.residual)
        there = _stable(problem, here.unknowns + step)
        if there is None or not float(there.residual @ there.residual) < value:
            there = _stable(problem, here.unknowns + 0.5 * step)
        if there is None or not float(there.residual @ there.residual) < value:
            break
        here = there
    return here


def _stable(problem: FitProblem, y: Array) -> Evaluation | None:
    point = problem.evaluate(y, True)
    return point if point is not None and point.stable else None


def _squares(point: Evaluation) -> tuple[Array, Array]:
    """Return half the curvature and slope of the sum of squares; flat directions stay put."""
    assert point.jacobian is not None
    curvature = point.jacobian.T @ point.jacobian
    curvature += np.diag(1e-12 * np.diag(curvature) + 1e-14 * np.trace(curvature))
    return curvature, point.jacobian.T @ point.residual
