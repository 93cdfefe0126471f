"""NLopt's SLSQP and COBYLA on the objective e, with boolean or linear constraints.

What is respected, because NLopt does not say it: a NaN makes SLSQP run on to maxeval and COBYLA
report success at the start; boolean +-1 constraints have no slope; COBYLA can return an
infeasible point as a success. So NLopt never sees NaN or infinity, always has limits, and the
best feasible point is our own record, not NLopt's answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import nlopt
import numpy as np
from numpy.typing import NDArray

from .optimum import Optimum
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

# An analysis that failed, or a point that may not be analysed, is this many times worse than the
# start: finite, and worse than anything a line search would accept.
FAILED = 10.0
DIFFERENCE = 1e-4  # forward difference, of the width of the bounds
CONSTRAINT_TOLERANCE = 1e-9
#: COBYLA starts with this fraction of each bound's width.
FIRST_STEP = 0.1
RELATIVE_E = 1e-10


class _UsedUp(Exception):
    """The allowed number of analyses was spent."""


class _Converged(Exception):
    """e fell below the tolerance."""


@dataclass(frozen=True)
class NloptOptions:
    """`gradient` "exact" or forward "differences"; `constraints` "margin" (linear) or "boolean"."""

    algorithm: Literal["slsqp", "cobyla"]
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"


class _Record:
    """Maps NLopt's variables to unknowns, evaluates once a point, keeps the best feasible."""

    def __init__(
        self,
        problem: FitProblem,
        start: Evaluation,
        tolerance: float,
        max_analyses: int,
        options: NloptOptions,
    ) -> None:
        self.problem, self.best, self.options = problem, start, options
        self.tolerance, self.max_analyses = tolerance, max_analyses
        self.failed = FAILED * max(start.value, 1.0)
        p = problem.parameters
        self.extra = len(p.nuisance)
        width = p.upper - p.lower
        # Linear constraints: modulus values, well conditioned. Boolean: coefficients in their
        # bounds' unit box, as the thesis has them.
        if options.constraints == "margin":
            self.basis = np.eye(p.size + self.extra)
            self.origin = np.zeros(p.size + self.extra)
        else:
            to_values = np.linalg.inv(p.to_coefficients)
            self.basis = np.eye(p.size + self.extra)
            self.basis[: p.size, : p.size] = to_values * width
            self.origin = np.zeros(p.size + self.extra)
            self.origin[: p.size] = to_values @ p.lower
        self.last: tuple[bytes, float, Array, bool, bool] | None = None

    def unknowns(self, x: Array) -> Array:
        return np.asarray(self.origin + self.basis @ x)

    def variables(self, y: Array) -> Array:
        return np.asarray(np.linalg.solve(self.basis, y - self.origin), dtype=float)

    def feasible(self, y: Array) -> bool:
        a, c = self.problem.parameters.inequalities
        return bool((a @ y >= c - 10 * CONSTRAINT_TOLERANCE).all())

    def at(self, x: Array, with_gradient: bool) -> tuple[float, Array, bool, bool]:
        """e, slope by x, whether positive, whether analysed; the same point is run only once."""
        key = x.tobytes()
        if (
            self.last is not None
            and self.last[0] == key
            and (not with_gradient or len(self.last[2]))
        ):
            return self.last[1:]
        y = self.unknowns(x)
        value, slope, analysed = self.failed, np.zeros(len(x)), False
        positive = self.feasible(y) if np.isfinite(y).all() else False
        # Eq. 4.9 as flags: what is not positive is not worth an analysis, and may not survive it.
        if positive or (self.options.constraints == "margin" and np.isfinite(y).all()):
            if self.problem.analyses >= self.max_analyses:
                raise _UsedUp
            exact = with_gradient and self.options.gradient == "exact"
            point = self.problem.evaluate(y, exact)
            if point is not None and np.isfinite(point.value):
                analysed, value = True, point.value
                if point.value < self.best.value and positive:
                    self.best = point
                if self.best.value < self.tolerance:
                    raise _Converged
                if with_gradient:
                    slope = self._slope(point, x)
        self.last = (key, value, slope if with_gradient else np.empty(0), positive, analysed)
        return value, slope, positive, analysed

    def _slope(self, point: Evaluation, x: Array) -> Array:
        if point.jacobian is not None:
            gradient = self.problem.blocks.gradient(point.residual, point.jacobian)
            return np.asarray(gradient @ self.basis)
        slope = np.zeros(len(x))
        for i in range(len(x)):
            if self.problem.analyses >= self.max_analyses:
                raise _UsedUp
            other = x.copy()
            other[i] += DIFFERENCE
            beside = self.problem.evaluate(self.unknowns(other), False)
            # A neighbour that fails leaves this direction alone rather than poisoning the step.
            slope[i] = 0.0 if beside is None else (beside.value - point.value) / DIFFERENCE
        return slope


def nlopt_minimise(
    problem: FitProblem,
    start: Array,
    tolerance: float,
    max_analyses: int,
    options: NloptOptions,
) -> Optimum | None:
    """Minimise e from the unknowns `start`; None when the analysis at the start fails.

    The returned point is the best feasible one seen, whatever NLopt itself says.
    """
    problem.warm_starts = False  # e has to be a function of the point alone
    first = problem.evaluate(start, False)
    if first is None:
        return None
    record = _Record(problem, first, tolerance, max_analyses, options)
    algorithm = nlopt.LD_SLSQP if options.algorithm == "slsqp" else nlopt.LN_COBYLA
    size = len(start)
    optimiser = nlopt.opt(algorithm, size)

    def objective(x: Array, gradient: Array) -> float:
        value, slope, _, _ = record.at(x, gradient.size > 0)
        if gradient.size:
            gradient[:] = slope
        return value

    optimiser.set_min_objective(objective)
    if options.constraints == "margin":
        a, c = problem.parameters.inequalities
        rows = a @ record.basis
        limit = c - a @ record.origin

        def linear(result: Array, x: Array, gradient: Array) -> None:
            result[:] = limit - rows @ x
            if gradient.size:
                gradient[:] = -rows

        optimiser.add_inequality_mconstraint(linear, np.full(len(rows), CONSTRAINT_TOLERANCE))
    else:
        optimiser.set_lower_bounds(_box(problem, 0.0))
        optimiser.set_upper_bounds(_box(problem, 1.0))

        def flag(which: int) -> None:
            def violated(x: Array, gradient: Array) -> float:
                if gradient.size:
                    gradient[:] = 0.0
                return -1.0 if record.at(x, False)[2 + which] else 1.0

            optimiser.add_inequality_constraint(violated, 1e-8)

        flag(0)
        flag(1)
    optimiser.set_maxeval(max_analyses)
    optimiser.set_ftol_rel(RELATIVE_E)
    optimiser.set_xtol_rel(1e-12)
    if options.algorithm == "cobyla":
        optimiser.set_initial_step(FIRST_STEP)
    try:
        optimiser.optimize(np.clip(record.variables(start), *_limits(problem, options)))
        status = f"nlopt {optimiser.last_optimize_result()}"
    except _Converged:
        status = "converged"
    except _UsedUp:
        status = "analyses used up"
    except (nlopt.RoundoffLimited, RuntimeError, ValueError) as error:
        status = f"nlopt stopped: {type(error).__name__}"
    return Optimum(record.best, status, problem.analyses)


def _box(problem: FitProblem, end: float) -> Array:
    """Unit box of the coefficients; nuisance parameters keep their own bounds."""
    p = problem.parameters
    low, high = p.nuisance_bounds
    return np.concatenate([np.full(p.size, end), low if end == 0.0 else high])


def _limits(problem: FitProblem, options: NloptOptions) -> tuple[Array | float, Array | float]:
    if options.constraints == "margin":
        return -np.inf, np.inf
    return _box(problem, 0.0), _box(problem, 1.0)
