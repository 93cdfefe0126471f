"""Profile likelihood of a number that is linear in the unknowns of a fit, as a modulus is.

The number is held at values ever farther from its best value, and all other degrees of freedom of
the unknowns are fitted anew at each. The increase of the weighted sum of squares, divided by
`LinearisedFit.spread_over_curvature`, is -2 log of the likelihood ratio. To first order the
interval in which it stays below a threshold is that of the fit's own posterior. Beyond first order
it shows where the interval is not symmetric about the best value, or has no end.

References
----------
D. J. Venzon, S. H. Moolgavkar, A method for computing profile-likelihood-based confidence
intervals, Appl. Statist. 37 (1988) 87.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import scipy

from ..materials.card import LEVEL
from ..materials.forms.base import Array
from .descent import bounded_step, predicted_decrease, with_small_diagonal
from .problem import Evaluation, FitProblem

#: Value of -2 log L at the ends of the interval: the quantile of chi-square with one degree of
#: freedom at `LEVEL`.
THRESHOLD = NormalDist().inv_cdf((1.0 + LEVEL) / 2.0) ** 2
# Why a profile to one side ends before it passes the threshold.
BOUND = "bound"
FAILED = "no analysis"
TOO_MANY_STEPS = "too many steps"


@dataclass(frozen=True)
class ProfileSettings:
    """Settings of a profile to one side; L is the likelihood ratio, a place one held value."""

    step: float = 0.5  # wanted change of the square root of -2 log L from place to place
    max_places: int = 16
    max_growth: float = 3.0  # factor from one step to the next
    max_halvings: int = 4  # halvings of a step that fails
    bound_share: float = 0.25  # largest first step, as a share of the way to the bound
    settled: float = 0.02  # a place is fitted if one more step would lower -2 log L by less
    max_analyses: int = 5  # analyses per place


SETTINGS = ProfileSettings()


@dataclass(frozen=True)
class ProfileSide:
    """A profile to one side of the best.

    Attributes
    ----------
    values : tuple of float
        Values at which the number was held, the best value first.
    ratios : tuple of float
        -2 log of the likelihood ratio at each of them.
    reason : str
        Why it ends before the threshold: BOUND, FAILED, TOO_MANY_STEPS; "" if it does not.
    analyses : int
    """

    values: tuple[float, ...]
    ratios: tuple[float, ...]
    reason: str
    analyses: int

    @property
    def end(self) -> float | None:
        """Return the value at which -2 log L passes the threshold; None if it does not.

        It is interpolated by a monotone curve of the value over the square root of -2 log L.
        """
        if self.reason:
            return None
        values = np.array(self.values)
        roots = np.maximum.accumulate(np.sqrt(np.maximum(self.ratios, 0.0)))
        distance = np.abs(values - values[0])
        rises = np.concatenate([[True], np.diff(roots) > 0])
        curve = scipy.interpolate.PchipInterpolator(roots[rises], distance[rises])
        end_distance = float(curve(np.sqrt(THRESHOLD)))
        return float(values[0] + np.sign(values[-1] - values[0]) * end_distance)


def profile_side(
    problem: FitProblem,
    best: Evaluation,
    row: Array,
    sign: float,
    sigma: float,
    on_place: Callable[[], None] = lambda: None,
) -> ProfileSide:
    """Hold a number ever farther from its best until -2 log L passes the threshold.

    Parameters
    ----------
    problem : FitProblem
        Weighted so that its sum of squares is -2 log L.
    best : Evaluation
        Its optimum, with Jacobian.
    row : (unknowns,) array
        Coefficients of the number, which is row @ unknowns.
    sign : float
        1 upwards, -1 downwards.
    sigma : float
        One standard deviation of the number.
    on_place : callable
        Called after each place, for a display of progress.
    """
    return _Profile(problem, best, row, sign).run(sigma, on_place)


@dataclass(eq=False)
class _Profile:
    """A profile under way: its places, and the point at the last of them, at first the best."""

    problem: FitProblem
    point: Evaluation
    row: Array
    sign: float

    def __post_init__(self) -> None:
        best = self.point
        self.bound = self.problem.unknowns.extreme(self.row, self.sign)
        self.start = float(self.row @ best.unknowns)
        self.smallest_squares = float(best.residual @ best.residual)
        self.values = [self.start]
        self.ratios = [0.0]

    def run(self, sigma: float, on_place: Callable[[], None]) -> ProfileSide:
        """Go from place to place to the end of the side."""
        previous_analyses = self.problem.analyses
        reason = self._reason_of_end(sigma, on_place)
        analyses = self.problem.analyses - previous_analyses
        return ProfileSide(tuple(self.values), tuple(self.ratios), reason, analyses)

    def _reason_of_end(self, sigma: float, on_place: Callable[[], None]) -> str:
        """Add places until the side ends; return why it does, "" at the threshold."""
        way_to_bound = abs(self.bound - self.start)
        step = min(SETTINGS.step * sigma, SETTINGS.bound_share * way_to_bound)
        for _ in range(SETTINGS.max_places):
            room = self.sign * (self.bound - self.values[-1])
            if not room > 1e-9 * max(abs(self.start), 1e-9):
                return BOUND
            if not self._add_place(step, room):
                return FAILED
            on_place()
            if self.ratios[-1] >= THRESHOLD:
                return ""
            step = self._next_step()
        return TOO_MANY_STEPS

    def _add_place(self, step: float, room: float) -> bool:
        """Fit at a place a step on, or less far; return whether that succeeds."""
        value = self.values[-1]
        for _ in range(SETTINGS.max_halvings + 1):
            target = value + self.sign * step
            # The last step lands on the bound, not just before it.
            if step > room / (1.0 + SETTINGS.bound_share):
                target = self.bound
            point = fitted_at(self.problem, self.point, self.row, target)
            if point is not None:
                self.point = point
                self.values.append(target)
                squares = float(point.residual @ point.residual)
                self.ratios.append(squares - self.smallest_squares)
                return True
            step = 0.5 * abs(target - value)
        return False

    def _next_step(self) -> float:
        """Return the step that makes the root of -2 log L grow as it should."""
        step = abs(self.values[-1] - self.values[-2])
        roots = np.sqrt(np.maximum(self.ratios[-2:], 0.0))
        growth = float(roots[1] - roots[0])
        factor = SETTINGS.step / growth if growth > 0 else np.inf
        return step * min(factor, SETTINGS.max_growth)


def fitted_at(
    problem: FitProblem,
    point: Evaluation,
    row: Array,
    target: float,
) -> Evaluation | None:
    """Fit with the number row @ unknowns held at a target.

    Parameters
    ----------
    problem : FitProblem
        Weighted so that its sum of squares is -2 log L.
    point : Evaluation
        The fit at a neighbouring value of the number, with Jacobian.
    row : (unknowns,) array
    target : float
        Value of the number.

    Returns
    -------
    Evaluation or None
        None where no analysis ends well.
    """
    limit = problem.analyses + SETTINGS.max_analyses
    step, _ = _step_in_plane(problem, point, row, target)
    if step is None:
        return None
    current = _stable(problem, point.unknowns + step)
    while current is not None and problem.analyses < limit:
        step, decrease = _step_in_plane(problem, current, row, target)
        if step is None or decrease < SETTINGS.settled:
            break
        trial = _lower(problem, current, step)
        if trial is None:
            break
        current = trial
    return current


def _step_in_plane(
    problem: FitProblem,
    point: Evaluation,
    row: Array,
    target: float,
) -> tuple[Array | None, float]:
    """Return the step to the least squares with row @ unknowns at the target, and its decrease.

    The step is None where the programme has no solution.
    """
    hessian, gradient = _squares(point)
    plane = (row, target)
    step = bounded_step(problem.unknowns, hessian, gradient, point.unknowns, plane=plane)
    if step is None:
        return None, 0.0
    return step, predicted_decrease(gradient, hessian, step)


def _lower(problem: FitProblem, current: Evaluation, step: Array) -> Evaluation | None:
    """Return a point of smaller squares a step, or half of it, on; None without one."""
    squares = float(current.residual @ current.residual)
    for share in (1.0, 0.5):
        trial = _stable(problem, current.unknowns + share * step)
        if trial is not None and float(trial.residual @ trial.residual) < squares:
            return trial
    return None


def _stable(problem: FitProblem, y: Array) -> Evaluation | None:
    """Return the evaluation with its Jacobian at y (unknowns,); None if it fails or is unstable."""
    point = problem.evaluate(y, True)
    return point if point is not None and point.stable else None


def _squares(point: Evaluation) -> tuple[Array, Array]:
    """Return half the Hessian, made definite, and half the gradient of the sum of squares."""
    jacobian = point.jacobian
    assert jacobian is not None
    return with_small_diagonal(jacobian.T @ jacobian), jacobian.T @ point.residual
