"""Fit a problem from one start, with any optimiser and any solver.

Comparisons that are easy to run lead in to the others. A solver that gives no derivatives is led by
a surrogate solver that gives them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..materials.forms.base import Array
from .methods import FitOptions, Method, method_named
from .problem import CONVERGED, LEVEL, RUNS_USED_UP, Evaluation, FitProblem, Optimum

STAGE_SHARE = 0.3  # share of the analyses of a start that a stage of `approach` may take


def fit_from(
    problem: FitProblem,
    start: Array,
    options: FitOptions,
    without_lead_in: bool = False,
) -> Optimum | None:
    """Fit a problem from one start.

    Parameters
    ----------
    problem : FitProblem
    start : (unknowns,) array
    options : FitOptions
    without_lead_in : bool
        Whether all comparisons are fitted from the beginning, as is best near the optimum;
        otherwise those of lower stages are fitted alone before, see `approach`.

    Returns
    -------
    Optimum or None
        None where the fit fails.

    Raises
    ------
    InputError
        There is no such method.
    """
    method = method_named(options.method)
    if not method.needs_slope:
        return method.minimise(problem, start, options)
    y = start
    if not without_lead_in:
        y = approach(problem.surrogate or problem, start, method, options)
    if problem.surrogate is not None:
        optimum = corrected_fit(problem, y, method, options)
        if not problem.differentiates:
            return optimum
        y = y if optimum is None else optimum.best.unknowns
    return method.minimise(problem, y, options)


def approach(
    problem: FitProblem,
    start: Array,
    method: Method,
    options: FitOptions,
) -> Array:
    """Return a start for all comparisons, the optimum of those of lower stages alone.

    The comparisons of the lowest stage (`Comparison.stage`) are fitted first, then those of the
    lowest two, and so on up to the last but one. From a random start, nearly every step would end
    without an equilibrium of a model that is hard to run, as that of a bias strip. A stage takes at
    most `STAGE_SHARE` of the analyses: what it leaves undecided, later ones may decide.

    Parameters
    ----------
    problem : FitProblem
    start : (unknowns,) array
    method : Method
    options : FitOptions
        Options of the whole fit.

    Returns
    -------
    (unknowns,) array
        `start` itself if all comparisons have one stage, or if a comparison cannot be run at the
        optimum of the lower stages.
    """
    stages = sorted({comparison.stage for comparison in problem.comparisons})
    if len(stages) < 2:
        return start
    y = start
    for stage in stages[:-1]:
        numbers = [k for k, c in enumerate(problem.comparisons) if c.stage <= stage]
        part = problem.part(numbers)
        max_analyses = problem.analyses + int(STAGE_SHARE * options.max_analyses)
        stage_options = replace(options, max_analyses=max_analyses, leads=True)
        optimum = method.minimise(part, y, stage_options)
        problem.analyses = part.analyses
        if problem.analyses >= options.max_analyses:
            return start
        y = start if optimum is None else optimum.best.unknowns
    point = problem.evaluate(y, False, warm=False)
    return y if point is not None and point.stable else start


@dataclass(frozen=True)
class CorrectionSettings:
    """Settings of a fit that a surrogate leads; e is the objective of the solver itself."""

    negligible_change: float = 0.1  # relative change of e that is not worth another run
    shortening: float = 0.5  # factor by which a step that worsened e is shortened
    max_shortenings: int = 3  # shortenings in a row


SETTINGS = CorrectionSettings()


def corrected_fit(
    problem: FitProblem,
    start: Array,
    method: Method,
    options: FitOptions,
) -> Optimum | None:
    """Fit a problem whose solver gives no derivatives, led by its surrogate.

    Each round k minimises the norm of surrogate(beta) + [solver(beta_k) - surrogate(beta_k)] - data
    over beta, with the exact Jacobian of the surrogate, and then runs the solver once at the
    minimum, which is beta_k of the next round. It ends when the objective of the solver, which
    alone counts, no longer falls. A step that worsens this objective is shortened (trust region).

    Parameters
    ----------
    problem : FitProblem
        Its `surrogate` is set; the objectives of that are restored at the end.
    start : (unknowns,) array
    method : Method
        Optimiser of the surrogate.
    options : FitOptions
        `max_runs` limits the runs of the solver, `max_analyses` those of the surrogate per round.

    Returns
    -------
    Optimum or None
        None when the solver fails wherever the surrogate leads.
    """
    return _CorrectedFit(problem, start, method, options).run()


@dataclass(eq=False)
class _CorrectedFit:
    """A corrected fit under way: its best point, and how it ends."""

    problem: FitProblem
    start: Array
    method: Method
    options: FitOptions

    def __post_init__(self) -> None:
        assert self.problem.surrogate is not None
        self.surrogate = self.problem.surrogate
        self.objectives = [comparison.objective for comparison in self.surrogate.comparisons]
        self.best: Evaluation | None = None
        self.status = RUNS_USED_UP
        self.failure = ""
        self.shortenings = 0

    def run(self) -> Optimum | None:
        """Run the fit to its end."""
        try:
            self._iterate()
        finally:
            self._restore_objectives()
        if self.best is None:
            return None
        status = self.status
        if self.failure:
            status = f"{self.problem.solver.name} failed: {self.failure}"
        runs = self.problem.analyses
        return Optimum(self.best, status, runs + self.surrogate.analyses, runs, self.failure)

    def _iterate(self) -> None:
        """Fit the corrected surrogate and run the solver in turn until no run improves the fit."""
        y = self._lead(self.start)
        while y is not None and self.problem.analyses < self.options.max_runs:
            point = self.problem.evaluate(y, False)
            if point is None or not point.stable or self._is_worse(point):
                y = self._shortened(y, point)
            else:
                y = self._accept(point)

    def _is_worse(self, point: Evaluation) -> bool:
        """Return whether a point is no better than the best one."""
        return self.best is not None and point.value >= self.best.value

    def _shortened(self, y: Array, point: Evaluation | None) -> Array | None:
        """Return unknowns nearer to the best point than y; None where that is not worth a run."""
        value = np.inf if point is None or not point.stable else point.value
        limit = 1 + SETTINGS.negligible_change
        is_level = self.best is not None and value < limit * self.best.value
        if self.shortenings == SETTINGS.max_shortenings or is_level:
            self.status = LEVEL
            self.failure = self.problem.failure if point is None else ""
            return None
        self.shortenings += 1
        origin = self.start if self.best is None else self.best.unknowns
        return origin + SETTINGS.shortening * (y - origin)

    def _accept(self, point: Evaluation) -> Array | None:
        """Correct the surrogate at a better point; return where it leads, None at the end."""
        limit = 1 - SETTINGS.negligible_change
        is_level = self.best is not None and point.value > limit * self.best.value
        self.best = point
        self.shortenings = 0
        if is_level or point.value < self.options.tolerance:
            self.status = LEVEL if is_level else CONVERGED
            return None
        modelled = self.surrogate.evaluate(point.unknowns, False, warm=False)
        if modelled is None:
            self.status = f"{self.surrogate.solver.name} failed"
            return None
        self._restore_objectives()
        self.surrogate.shift(point.histories, modelled.histories)
        return self._lead(point.unknowns)

    def _restore_objectives(self) -> None:
        """Give the comparisons of the surrogate their uncorrected objectives again."""
        for comparison, objective in zip(self.surrogate.comparisons, self.objectives, strict=True):
            comparison.objective = objective

    def _lead(self, y: Array) -> Array | None:
        """Return the unknowns at the optimum of the corrected surrogate; None without one.

        Parameters
        ----------
        y : (unknowns,) array
            Unknowns where the fit begins.
        """
        self.surrogate.warm_starts = True
        max_analyses = self.surrogate.analyses + self.options.max_analyses
        options = replace(self.options, max_analyses=max_analyses)
        optimum = self.method.minimise(self.surrogate, y, options)
        return None if optimum is None else optimum.best.unknowns
