"""Minimise the objective of a fit by an algorithm of the library NLopt.

A NaN makes SLSQP run on to its largest number of evaluations and COBYLA report success at the
start; boolean constraints of value -1 or 1 have no slope; COBYLA can return an infeasible point as
a success. So NLopt never sees NaN or infinity and always has limits, and the best feasible point is
the one recorded here, not NLopt's answer.

References
----------
S. G. Johnson, The NLopt nonlinear-optimization package.
"""

from __future__ import annotations

from dataclasses import dataclass

import nlopt
import numpy as np

from ..materials.forms.base import Array
from .methods import FitOptions
from .problem import ANALYSES_USED_UP, CONVERGED, Evaluation, FitProblem, Optimum


@dataclass(frozen=True)
class NloptSettings:
    """Settings of a search by NLopt."""

    #: An analysis that failed or ended unstable, or a point that may not be analysed, is this many
    #: times worse than the start: finite, and worse than anything a line search would accept.
    failure_factor: float = 10.0
    difference: float = 1e-4  # step of a forward difference, in units of NLopt's variables
    inequality_tolerance: float = 1e-9  # by which a linear inequality may be violated
    flag_tolerance: float = 1e-8  # of the boolean constraints, whose values are -1 and 1
    objective_tolerance: float = 1e-10  # relative
    variable_tolerance: float = 1e-12  # relative


SETTINGS = NloptSettings()


class SearchEnded(Exception):
    """Signal that a search ends, with its status: CONVERGED or ANALYSES_USED_UP."""


@dataclass(frozen=True, eq=False)
class SearchPoint:
    """A point of a search, as NLopt is told of it.

    Attributes
    ----------
    value : float
        The objective e.
    slope : (n,) array
        Its derivatives by NLopt's variables; empty unless asked for.
    positive : bool
        Whether all inequalities are kept.
    analysed : bool
        Whether the analysis ended well.
    """

    value: float
    slope: Array
    positive: bool
    analysed: bool


@dataclass(eq=False)
class NloptProblem:
    """A fit as a function of NLopt's variables, with the best feasible point that was seen.

    With linear constraints the variables are the unknowns, modulus values, which are well
    conditioned. With boolean constraints the coefficients are variables in the unit box of their
    bounds.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The best feasible point up to now: at first the start.
    options : FitOptions
    """

    problem: FitProblem
    best: Evaluation
    options: FitOptions

    def __post_init__(self) -> None:
        self.failure_value = SETTINGS.failure_factor * max(self.best.value, 1.0)
        # Differences where the solver has no exact slope to give.
        has_slope = self.problem.differentiates
        self.has_exact_slope = self.options.gradient == "exact" and has_slope
        self.has_flags = self.options.constraints == "boolean"
        unknowns = self.problem.unknowns
        self.basis = np.eye(unknowns.count)
        self.origin = np.zeros(unknowns.count)
        if self.has_flags:
            lower, upper = unknowns.box
            size = unknowns.size
            to_values = np.linalg.inv(unknowns.to_coefficients)
            self.basis[:size, :size] = to_values * (upper - lower)
            self.origin[:size] = to_values @ lower
        for k, nuisance in enumerate(unknowns.nuisance.all, start=unknowns.size):
            if nuisance.drawn:  # in shares of its bounds
                self.basis[k, k] = nuisance.upper - nuisance.lower
                self.origin[k] = nuisance.lower
        self._last: tuple[bytes, SearchPoint] | None = None

    def unknowns(self, x: Array) -> Array:
        """Return the unknowns (n,) of NLopt's variables x (n,)."""
        return self.origin + self.basis @ x

    def variables(self, y: Array) -> Array:
        """Return NLopt's variables (n,) of unknowns y (n,)."""
        return np.asarray(np.linalg.solve(self.basis, y - self.origin), dtype=float)

    def point_at(self, x: Array, with_slope: bool) -> SearchPoint:
        """Return the point at variables x, evaluated once if repeated; raise SearchEnded."""
        key = x.tobytes()
        if self._last is not None and self._last[0] == key:
            last_point = self._last[1]
            if not with_slope or len(last_point.slope):
                return last_point
        search_point = self._search_point(x, with_slope)
        self._last = (key, search_point)
        return search_point

    def _search_point(self, x: Array, with_slope: bool) -> SearchPoint:
        """Evaluate the point at variables x; raise SearchEnded."""
        y = self.unknowns(x)
        no_slope = np.zeros(len(x) if with_slope else 0)
        is_finite = bool(np.isfinite(y).all())
        is_positive = is_finite and self._keeps_inequalities(y)
        # With boolean constraints (Eq. 4.9) a law without positive moduli is not analysed: such an
        # analysis is of no use, and may fail.
        may_be_analysed = is_finite and (is_positive or not self.has_flags)
        point = None
        if may_be_analysed:
            point = self._stable(y, with_slope and self.has_exact_slope)
        if point is None:
            return SearchPoint(self.failure_value, no_slope, is_positive, False)
        if is_positive and (point.value < self.best.value or not self.best.stable):
            self.best = point
        if self.best.is_fitted(self.options.tolerance):
            raise SearchEnded(CONVERGED)
        slope = self._slope(point, x) if with_slope else no_slope
        return SearchPoint(point.value, slope, is_positive, True)

    def _stable(self, y: Array, with_jacobian: bool) -> Evaluation | None:
        """Evaluate unknowns y (n,); None where that fails or ends unstable.

        An unstable equilibrium does not occur in a test: it is no solution, however well it fits.
        """
        point = self._evaluate(y, with_jacobian)
        if point is None or not point.stable:
            return None
        return point

    def _keeps_inequalities(self, y: Array) -> bool:
        """Return whether unknowns y (n,) keep the inequalities, up to NLopt's tolerance."""
        rows, limits = self.problem.unknowns.inequalities
        margin = 10 * SETTINGS.inequality_tolerance
        if not (rows @ y >= limits - margin).all():
            return False
        return self.problem.unknowns.within_work(y)

    def _evaluate(self, y: Array, with_jacobian: bool) -> Evaluation | None:
        """Evaluate unknowns y (n,); raise SearchEnded when all analyses are used up."""
        if self.problem.analyses >= self.options.max_analyses:
            raise SearchEnded(ANALYSES_USED_UP)
        return self.problem.evaluate(y, with_jacobian)

    def _slope(self, point: Evaluation, x: Array) -> Array:
        """Return the slope (n,) of e by the variables x (n,), from the Jacobian or differences."""
        if point.jacobian is not None:
            gradient = self.problem.blocks.gradient(point.residual, point.jacobian)
            return gradient @ self.basis
        slope = np.zeros(len(x))
        difference = SETTINGS.difference
        for i in range(len(x)):
            shifted = x.copy()
            shifted[i] += difference
            neighbour = self._evaluate(self.unknowns(shifted), False)
            # A neighbour that is no point leaves this direction alone rather than poison the step.
            if neighbour is not None and neighbour.stable:
                slope[i] = (neighbour.value - point.value) / difference
        return slope

    def objective(self, x: Array, gradient: Array) -> float:
        """Return the objective e of the fit (`FitProblem`) at NLopt's variables x.

        `gradient` is filled in place, as NLopt requires; it is empty where the algorithm wants
        none. SearchEnded, which may be raised, ends the search.
        """
        point = self.point_at(x, gradient.size > 0)
        if gradient.size:
            gradient[:] = point.slope
        return point.value

    def positivity(self, x: Array, gradient: Array) -> float:
        """Return -1 where moduli are positive, else 1 (Eq. 4.9).

        Parameters
        ----------
        x : (n,) array
            NLopt's variables.
        gradient : (n,) array
            Filled with zeros, for the value is constant in pieces.
        """
        gradient[:] = 0.0
        return -1.0 if self.point_at(x, False).positive else 1.0

    def analysability(self, x: Array, gradient: Array) -> float:
        """Return -1 where the analysis ended well, else 1 (Eq. 4.9).

        Parameters
        ----------
        x : (n,) array
            NLopt's variables.
        gradient : (n,) array
            Filled with zeros, for the value is constant in pieces.
        """
        gradient[:] = 0.0
        return -1.0 if self.point_at(x, False).analysed else 1.0

    def violations(self, result: Array, x: Array, gradient: Array) -> None:
        """Write by how much each linear inequality is violated, as NLopt asks for it.

        Parameters
        ----------
        result : (m,) array
            Written: limit less value of each inequality.
        x : (n,) array
            NLopt's variables.
        gradient : (m, n) array
            Written, unless it is empty: derivatives of the result by the variables.
        """
        rows, limits = self.problem.unknowns.inequalities
        y = self.unknowns(x)
        work_rows, work_limits = self.problem.unknowns.work_rows(y)
        a = np.concatenate([rows, work_rows])
        result[:] = np.concatenate([limits, work_limits]) - a @ y
        if gradient.size:
            gradient[:] = -a @ self.basis


@dataclass(frozen=True)
class NloptMethod:
    """An algorithm of NLopt, with linear or boolean constraints.

    Attributes
    ----------
    algorithm : int
        The algorithm by its number in NLopt, as `nlopt.LD_SLSQP`.
    max_analyses : int
        Largest number of analyses from one start, by default.
    first_step : float, optional
        First change of each of NLopt's variables; NLopt chooses it by default.
    needs_slope, boolean
        See `Method`.
    """

    algorithm: int
    max_analyses: int
    first_step: float | None = None
    needs_slope: bool = False
    boolean: bool = True

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Minimise e; None when the analysis at `start` fails.

        The result is the best feasible, stable point that was seen, whatever NLopt itself says.
        """
        problem.warm_starts = False  # e has to be a function of the point alone
        first = problem.evaluate(start, False)
        if first is None:
            return None
        search = NloptProblem(problem, first, options)
        optimiser = nlopt.opt(self.algorithm, len(start))
        x = search.variables(start)
        optimiser.set_min_objective(search.objective)
        if search.has_flags:
            x = _set_flags(optimiser, search, x)
        else:
            unknowns = problem.unknowns
            count = len(unknowns.inequalities[1]) + len(unknowns.work_rows(start)[1])
            tolerances = np.full(count, SETTINGS.inequality_tolerance)
            optimiser.add_inequality_mconstraint(search.violations, tolerances)
        optimiser.set_maxeval(options.max_analyses)
        optimiser.set_ftol_rel(SETTINGS.objective_tolerance)
        optimiser.set_xtol_rel(SETTINGS.variable_tolerance)
        if self.first_step is not None:
            optimiser.set_initial_step(self.first_step)
        status = _run(optimiser, x)
        return Optimum(search.best, status, problem.analyses)


def _set_flags(optimiser: nlopt.opt, search: NloptProblem, x: Array) -> Array:
    """Set bounds and boolean constraints; return the start x within the bounds."""
    unknowns = search.problem.unknowns
    lower, upper = unknowns.nuisance.bounds
    parts = slice(unknowns.size, None)
    origin = search.origin[parts]
    widths = np.diag(search.basis)[parts]
    low = np.r_[np.full(unknowns.size, 0.0), (lower - origin) / widths]
    high = np.r_[np.full(unknowns.size, 1.0), (upper - origin) / widths]
    optimiser.set_lower_bounds(low)
    optimiser.set_upper_bounds(high)
    for flag in (search.positivity, search.analysability):
        optimiser.add_inequality_constraint(flag, SETTINGS.flag_tolerance)
    return np.clip(x, low, high)


def _run(optimiser: nlopt.opt, x: Array) -> str:
    """Run the search from x; return how it ended."""
    try:
        optimiser.optimize(x)
    except SearchEnded as end:
        return str(end)
    except (nlopt.RoundoffLimited, RuntimeError, ValueError) as error:
        return f"nlopt stopped: {type(error).__name__}"
    return f"nlopt {optimiser.last_optimize_result()}"
