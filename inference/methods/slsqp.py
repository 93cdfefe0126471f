"""Sequential quadratic programming on e itself (NLopt's SLSQP), and the search by NLopt.

A NaN makes SLSQP run on to maxeval and COBYLA report success at the start; boolean +-1 constraints
have no slope; COBYLA can return an infeasible point as a success. So NLopt never sees NaN or
infinity, always has limits, and the best feasible point is our own record, not NLopt's answer."""

from dataclasses import dataclass
from functools import partial

import nlopt
import numpy as np

from ...materials.forms.base import Array
from ..optimum import ANALYSES_USED_UP, CONVERGED, Optimum
from ..problem import Evaluation, FitProblem
from . import FitOptions

# An analysis that failed or ended unstable, or a point that may not be analysed, is this many times
# worse than the start: finite, and worse than anything a line search would accept.
WORSE = 10.0
DIFFERENCE = 1e-4  # forward difference, of the width of the bounds
CONSTRAINT_TOLERANCE, FLAG_TOLERANCE = 1e-9, 1e-8
RELATIVE_E, RELATIVE_X = 1e-10, 1e-12


class Ended(Exception):
    """The search ended, and how: below the tolerance, or all analyses are used up."""


@dataclass(frozen=True, eq=False)
class Look:
    """A point: e, its slope (empty unless asked for), moduli positive, analysis ended well."""

    value: float
    slope: Array
    positive: bool
    analysed: bool


class NloptProblem:
    """A map of NLopt's variables to unknowns that evaluates and keeps the best feasible point."""

    def __init__(self, problem: FitProblem, start: Evaluation, options: FitOptions) -> None:
        self.problem = problem
        self.best = start
        self.options = options
        self.bad = WORSE * max(start.value, 1.0)
        # Differences where the solver has no exact slope to give.
        self.exact = options.gradient == "exact" and problem.differentiates
        self.flags = options.constraints == "boolean"
        p = problem.unknowns
        # Linear constraints: modulus values, well conditioned. Boolean: coefficients in their
        # bounds' unit box.
        self.basis = np.eye(p.count)
        self.origin = np.zeros(p.count)
        if self.flags:
            lower, upper = p.box
            to_values = np.linalg.inv(p.to_coefficients)
            self.basis[: p.size, : p.size] = to_values * (upper - lower)
            self.origin[: p.size] = to_values @ lower
        self._last: tuple[bytes, Look] | None = None

    def unknowns(self, x: Array) -> Array:
        """Return the unknowns of NLopt's variables."""
        return np.asarray(self.origin + self.basis @ x)

    def variables(self, y: Array) -> Array:
        """Return NLopt's variables of unknowns."""
        return np.asarray(np.linalg.solve(self.basis, y - self.origin), dtype=float)

    def at(self, x: Array, with_slope: bool) -> Look:
        """Evaluate `x`, a repeated point once; raises Ended."""
        key = x.tobytes()
        if self._last is not None and self._last[0] == key:
            before = self._last[1]
            if not with_slope or len(before.slope):
                return before
        look = self._fresh(x, with_slope)
        self._last = (key, look)
        return look

    def _fresh(self, x: Array, with_slope: bool) -> Look:
        y = self.unknowns(x)
        none = np.zeros(len(x) if with_slope else 0)
        a, c = self.problem.unknowns.inequalities
        finite = bool(np.isfinite(y).all())
        positive = finite and bool((a @ y >= c - 10 * CONSTRAINT_TOLERANCE).all())
        positive = positive and self.problem.unknowns.within_work(y)
        # Eq. 4.9 as flags: what is not positive is not worth an analysis, and may not survive it.
        if not finite or (self.flags and not positive):
            return Look(self.bad, none, positive, False)
        point = self._evaluate(y, with_slope and self.exact)
        # What no test can show is no point to go to, however well it fits.
        if point is None or not point.stable:
            return Look(self.bad, none, positive, False)
        if positive and (point.value < self.best.value or not self.best.stable):
            self.best = point
        if self.best.value < self.options.tolerance:
            raise Ended(CONVERGED)
        return Look(point.value, self._slope(point, x) if with_slope else none, positive, True)

    def _evaluate(self, y: Array, with_jacobian: bool) -> Evaluation | None:
        if self.problem.analyses >= self.options.max_analyses:
            raise Ended(ANALYSES_USED_UP)
        return self.problem.evaluate(y, with_jacobian)

    def _slope(self, point: Evaluation, x: Array) -> Array:
        if point.jacobian is not None:
            gradient = self.problem.blocks.gradient(point.residual, point.jacobian)
            return np.asarray(gradient @ self.basis)
        slope = np.zeros(len(x))
        for i in range(len(x)):
            other = x.copy()
            other[i] += DIFFERENCE
            beside = self._evaluate(self.unknowns(other), False)
            # A neighbour that is no point leaves this direction alone rather than poison the step.
            if beside is not None and beside.stable:
                slope[i] = (beside.value - point.value) / DIFFERENCE
        return slope

    def objective(self, x: Array, gradient: Array) -> float:
        """Return e, as NLopt asks for it."""
        look = self.at(x, gradient.size > 0)
        if gradient.size:
            gradient[:] = look.slope
        return look.value

    def flag(self, name: str, x: Array, gradient: Array) -> float:
        """Return -1 where moduli are "positive", or the point was "analysed", else 1 (Eq. 4.9)."""
        gradient[:] = 0.0
        return -1.0 if getattr(self.at(x, False), name) else 1.0


@dataclass(frozen=True)
class NloptMethod:
    """An algorithm of NLopt, with linear or boolean constraints.
    first_step : of each bound's width; NLopt's own unless given."""

    algorithm: int
    max_analyses: int
    first_step: float | None = None
    needs_slope: bool = False
    boolean: bool = True

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Minimise e; None when the analysis at `start` fails.
        Returns the best feasible, stable point that was seen, whatever NLopt itself says."""
        problem.warm_starts = False  # e has to be a function of the point alone
        first = problem.evaluate(start, False)
        if first is None:
            return None
        record = NloptProblem(problem, first, options)
        unknowns = problem.unknowns
        optimiser = nlopt.opt(self.algorithm, len(start))
        x = record.variables(start)
        optimiser.set_min_objective(record.objective)
        if record.flags:
            ends = zip((0.0, 1.0), unknowns.nuisance.bounds, strict=True)
            low, high = (np.r_[np.full(unknowns.size, own), others] for own, others in ends)
            x = np.clip(x, low, high)
            optimiser.set_lower_bounds(low)
            optimiser.set_upper_bounds(high)
            for name in ("positive", "analysed"):
                optimiser.add_inequality_constraint(partial(record.flag, name), FLAG_TOLERANCE)
        else:

            def bounded(result: Array, x: Array, gradient: Array) -> None:
                y = record.unknowns(x)
                pairs = zip(unknowns.inequalities, unknowns.work_rows(y), strict=True)
                a, c = (np.concatenate(pair) for pair in pairs)
                result[:] = c - a @ y
                if gradient.size:
                    gradient[:] = -a @ record.basis

            rows = len(unknowns.inequalities[1]) + len(unknowns.work_rows(start)[1])
            optimiser.add_inequality_mconstraint(bounded, np.full(rows, CONSTRAINT_TOLERANCE))
        optimiser.set_maxeval(options.max_analyses)
        optimiser.set_ftol_rel(RELATIVE_E)
        optimiser.set_xtol_rel(RELATIVE_X)
        if self.first_step is not None:
            optimiser.set_initial_step(self.first_step)
        try:
            optimiser.optimize(x)
            status = f"nlopt {optimiser.last_optimize_result()}"
        except Ended as end:
            status = str(end)
        except (nlopt.RoundoffLimited, RuntimeError, ValueError) as error:
            status = f"nlopt stopped: {type(error).__name__}"
        return Optimum(record.best, status, problem.analyses)


#: SLSQP with the exact gradient of e, or with differences where there is none.
METHOD = NloptMethod(nlopt.LD_SLSQP, 500)
