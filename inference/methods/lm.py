"""Levenberg-Marquardt from one start: two stages, restarts, and a check from the unloaded state.

The sum of squared blocks is minimised while e is far from its least; once that is level at a
residual that is not zero, the blocks are weighted so that e itself (a sum of norms) is minimised.

References
----------
K. Levenberg, A method for the solution of certain non-linear problems in least squares, Quart.
Appl. Math. 2 (1944) 164. D. W. Marquardt, An algorithm for least-squares estimation of nonlinear
parameters, J. SIAM 11 (1963) 431. Steps and second order: see `descent`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...materials.forms.base import Array
from ..descent import DescentSettings, bounded_step, descend
from ..problem import ANALYSES_USED_UP, LEVEL, Evaluation, FitProblem, Optimum
from . import FitOptions

#: The first stage ends early, as what follows goes on from there.
FIRST_STAGE = DescentSettings(settled_decrease=5e-4, settled_steps=2)
#: A restart shows where it leads before it is exact.
RESTART = DescentSettings(negligible_decrease=1e-4)


@dataclass(frozen=True)
class RestartSettings:
    """Settings of the stages and restarts of a fit."""

    first_stage: DescentSettings = FIRST_STAGE
    #: Analyses at the end of the first stages among which an unstable one shows that the optimum
    #: lies at the border of instability.
    border_analyses: int = 8
    shear_factors: tuple[float, ...] = (2.0, 4.0)  # of the restarts away from instability
    restart: DescentSettings = RESTART
    same_squares: float = 1e-3  # relative: within this a restart leads back to the least squares
    same_value: float = 1e-5  # of e, relative: the same equilibrium, reached twice
    min_cold_analyses: int = 20  # of a fit without warm starts


SETTINGS = RestartSettings()


class LevenbergMarquardt:
    """Levenberg-Marquardt by convex quadratic programmes; needs the exact Jacobian."""

    needs_slope = True
    boolean = False
    max_analyses = 100

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Fit from the unknowns `start`; None when the analysis there fails.

        Stops below the tolerance, on no progress, or when the analyses are used up.
        """
        return _StartedFit(problem, options).run(start)


@dataclass(frozen=True, eq=False)
class _StartedFit:
    """A fit from one start."""

    problem: FitProblem
    options: FitOptions

    def run(self, start: Array) -> Optimum | None:
        """Fit by both stages and restarts, then check the optimum from the unloaded state.

        Parameters
        ----------
        start : (unknowns,) array
            Unknowns where the fit begins.

        Returns
        -------
        Optimum or None
            None if the start or the check cannot be evaluated.
        """
        problem = self.problem
        # The last analysis checks the optimum from the unloaded state.
        limit = self.options.max_analyses - 1
        previous_analyses = problem.analyses
        first = problem.evaluate(start, True)
        if first is None:
            return None
        settings = SETTINGS.first_stage
        level, status = descend(problem, first, self.options.tolerance, limit, settings=settings)
        if self.options.leads:
            return Optimum(level, status, problem.analyses)
        best, status = self._minimise_norms(level, status, limit)
        # Where the start was drawn, and the way far from its end, are no matter of the optimum.
        last_analyses = problem.analyses - SETTINGS.border_analyses
        if problem.last_unstable > max(previous_analyses, last_analyses):
            best, status = self._restart(best, status, level, limit)
        if best.is_fitted(self.options.tolerance):
            return Optimum(best, status, problem.analyses)
        return self._checked(best, status, start)

    def _minimise_norms(self, point: Evaluation, status: str, limit: int) -> tuple[Evaluation, str]:
        """Minimise e itself from a point at which the squares are level."""
        if status != LEVEL:
            return point, status
        return descend(self.problem, point, self.options.tolerance, limit, norms=True)

    def _restart(
        self,
        best: Evaluation,
        status: str,
        level: Evaluation,
        limit: int,
    ) -> tuple[Evaluation, str]:
        """Fit again from stiffer membranes; return the best point and how its fit ended."""
        for factor in SETTINGS.shear_factors:
            if best.value < self.options.tolerance:
                break
            restarted, restarted_status = self._fit_from_stiffer(best, level, factor, limit)
            if restarted.value < best.value:
                best = restarted
                status = restarted_status
        return best, status

    def _fit_from_stiffer(
        self,
        best: Evaluation,
        level: Evaluation,
        factor: float,
        limit: int,
    ) -> tuple[Evaluation, str]:
        """Fit again from a membrane `factor` times stiffer in shear, which is what keeps it stable.

        At the border of instability G12 usually makes up for others that are still wrong: these go
        first. Returns `best` as soon as the way back leads to `level`, the least squares behind it.
        """
        problem = self.problem
        if problem.analyses >= limit:
            return best, ANALYSES_USED_UP
        point = self._stiffer_point(best, factor)
        if point is None or not point.stable:
            return best, LEVEL
        for may_change in (~problem.unknowns.is_shear, None):
            point, _ = descend(
                problem,
                point,
                self.options.tolerance,
                limit,
                may_change=may_change,
                settings=SETTINGS.restart,
            )
        if self._leads_back(point, level):
            return best, LEVEL
        point, status = descend(problem, point, self.options.tolerance, limit)
        return self._minimise_norms(point, status, limit)

    def _stiffer_point(self, best: Evaluation, factor: float) -> Evaluation | None:
        """Return the point nearest to one stiffer in shear within the bounds; None if it fails."""
        y = best.unknowns
        target = best.unknowns.copy()
        target[self.problem.unknowns.is_shear] *= factor
        step = bounded_step(self.problem.unknowns, np.eye(len(y)), y - target, y)
        return None if step is None else self.problem.evaluate(y + step, True)

    def _leads_back(self, point: Evaluation, level: Evaluation) -> bool:
        """Return whether a restart has come back to the least squares."""
        assert level.jacobian is not None
        change = level.jacobian @ (point.unknowns - level.unknowns)
        squares = np.sum(level.residual**2)
        increase = np.sum(point.residual**2) - squares
        limit = SETTINGS.same_squares * squares
        return bool(max(float(change @ change), abs(increase)) <= limit)

    def _checked(self, best: Evaluation, status: str, start: Array) -> Optimum | None:
        """Return the optimum if the unloaded state leads to it; else fit without warm starts.

        What a card promises has to be reached from the unloaded state: make sure that the fit did
        not end on a branch that only its own warm starts reach.

        Parameters
        ----------
        start : (unknowns,) array
            Unknowns where the second fit begins if the optimum is not stable.
        """
        problem = self.problem
        same_value = SETTINGS.same_value * best.value
        cold = problem.evaluate(best.unknowns, True, warm=False)
        if cold is not None and not cold.stable:
            cold = None
        if cold is not None and abs(cold.value - best.value) <= same_value:
            return Optimum(cold, status, problem.analyses)
        problem.warm_starts = False
        first = cold if cold is not None else problem.evaluate(start, True)
        if first is None:
            return None
        # A fit that used up its analyses with warm starts gets as many as a usual one takes.
        limit = max(self.options.max_analyses, problem.analyses + SETTINGS.min_cold_analyses)
        level, status = descend(problem, first, self.options.tolerance, limit)
        best, status = self._minimise_norms(level, status, limit)
        return Optimum(best, status, problem.analyses)


METHOD = LevenbergMarquardt()
