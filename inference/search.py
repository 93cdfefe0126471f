"""Fit a problem from one start: where it begins, and its way by any optimiser and any solver.

Starts are laws within their bounds, drawn by number, with which every model can be run. Comparisons
that are easy to run lead in to the others, and a surrogate leads a solver without derivatives.

References
----------
I. M. Sobol, On the distribution of points in a cube and the approximate evaluation of integrals,
USSR Comput. Math. Math. Phys. 7 (1967) 86.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from ..errors import NoFeasibleStart, SolverFailure
from ..materials.forms.base import Array
from .descent import bounded_step
from .methods import FitOptions, Method, method_named
from .problem import CONVERGED, LEVEL, RUNS_USED_UP, Evaluation, FitProblem, Optimum
from .unknowns import Unknowns

MAX_ANALYSES = 50  # trial analyses for one start

MAX_DRAWS = 200_000  # draws for one start

DRAWS_AT_ONCE = 500

SOBOL_POINTS_AT_ONCE = 512  # a power of two, which Sobol points need to be evenly distributed

MAX_DRAWN_VALUES = 4  # control values drawn for one modulus; further ones are interpolated


def feasible_start(problem: FitProblem, seed: int, number: int) -> Array:
    """Return the unknowns at which one start of a study begins, the same on any machine.

    Candidates of the problem's `starts` are tried until an analysis ends well, in a stable
    equilibrium.

    Parameters
    ----------
    problem : FitProblem
    seed : int
        Seed of the study.
    number : int
        Index of the start, from 0.

    Returns
    -------
    (unknowns,) array

    Raises
    ------
    NoFeasibleStart
        After `MAX_DRAWS` draws without an admissible law, or `MAX_ANALYSES` failed analyses.
    """
    # With a surrogate, the runs of the expensive solver are not spent on trial points.
    starts = problem.starts or RandomStarts()
    problem = problem.surrogate or problem
    unknowns = problem.unknowns
    tried = 0
    random = np.random.default_rng([seed, number, 1])
    for coefficients in starts.candidates(unknowns, seed, number):
        y = _drawn(problem, unknowns.at(coefficients), random)
        if y is None:
            continue
        tried += 1
        y = _within_work(unknowns, y)
        if y is not None:
            point = problem.evaluate(y, False, warm=False)
            if point is not None and point.stable:
                return y
        if tried >= MAX_ANALYSES:
            raise _without_analysis(problem, number, tried)
    raise NoFeasibleStart(
        f"start {number}: none of {MAX_DRAWS} random points inside the bounds has positive "
        "moduli over the strain range; check the bounds and the strain range"
    )


def _without_analysis(problem: FitProblem, number: int, tried: int) -> NoFeasibleStart:
    """Return the error of a start whose analyses have all failed."""
    if not problem.unknowns.size:
        return NoFeasibleStart(
            f"start {number}: the deck failed with all of {tried} random parameters, at last: "
            f"{problem.failure}; narrow their bounds"
        )
    return NoFeasibleStart(
        f"start {number}: the analysis failed, or the work of a closed path is above its "
        f"bound, at all of {tried} random points with positive moduli; raise the lower "
        "bounds or law.closed_path, or add increments"
    )


def _drawn(problem: FitProblem, y: Array, random: np.random.Generator) -> Array | None:
    """Return unknowns with drawn parameters of models; None where the models refuse them.

    Parameters
    ----------
    y : (unknowns,) array
        Unknowns, whose parameters of models are replaced in place.
    """
    unknowns = problem.unknowns
    if not any(nuisance.drawn for nuisance in unknowns.nuisance.all):
        return y
    y[unknowns.size :] = unknowns.nuisance.drawn(random)
    try:
        for comparison in problem.comparisons:
            comparison.model_at(unknowns.nuisance_values(comparison.name, y))
    except SolverFailure:
        return None
    return y


def _within_work(unknowns: Unknowns, y: Array) -> Array | None:
    """Return the nearest unknowns that keep the bound of the work; None where none are found.

    Parameters
    ----------
    y : (unknowns,) array
        Unknowns, which may violate it.
    """
    step: Array | None = np.zeros_like(y)
    if not unknowns.within_work(y):
        step = bounded_step(unknowns, np.eye(len(y)), np.zeros(len(y)), y)
    return None if step is None else y + step


def dimensions(unknowns: Unknowns) -> int:
    """Return how many numbers between 0 and 1 determine a law inside the bounds."""
    if unknowns.bounds.largest is None:
        return unknowns.size
    return _interpolation(unknowns.form.modulus_of).shape[1]


def coefficients_at(unknowns: Unknowns, share: Array) -> Array:
    """Return the free coefficients that points of the unit cube stand for.

    Evenly distributed points make coefficients that are evenly distributed in the box of their
    bounds, or, where moduli are bounded, logarithms of the moduli at the control strains that are.

    Parameters
    ----------
    unknowns : Unknowns
    share : (count, dimensions) array
        Coordinates of the points, between 0 and 1.

    Returns
    -------
    (count, size) array, MPa
    """
    if unknowns.bounds.largest is None:
        lower, upper = unknowns.box
        return np.asarray(lower + (upper - lower) * share)
    lower, upper = (np.log(moduli) for moduli in unknowns.bounds.at_control_strains(unknowns.form))
    interpolation = _interpolation(unknowns.form.modulus_of)
    values = np.exp(lower + (upper - lower) * (share @ interpolation.T))
    return np.asarray(values @ unknowns.from_values.T)


def _interpolation(modulus_of: Sequence[str]) -> Array:
    """Return the matrix (size, drawn) from drawn numbers to the control values of all moduli.

    Up to `MAX_DRAWN_VALUES` control values of a modulus are drawn each by itself. More are
    interpolated between as many drawn ones, because a curve through many independent values hardly
    ever stays within its bounds between them.
    """
    blocks = []
    for name in dict.fromkeys(modulus_of):
        count = sum(modulus == name for modulus in modulus_of)
        drawn_count = min(count, MAX_DRAWN_VALUES)
        positions = np.linspace(0.0, drawn_count - 1.0, count)
        columns = [np.interp(positions, range(drawn_count), row) for row in np.eye(drawn_count)]
        blocks.append(np.column_stack(columns))
    return np.asarray(scipy.linalg.block_diag(*blocks))


def allowed(unknowns: Unknowns, coefficients: Array) -> NDArray[np.bool_]:
    """Return (n,) which free coefficients (n, size) MPa make moduli inside their bounds."""
    grid, margin = unknowns.positivity
    moduli = coefficients @ grid.T
    is_allowed = (moduli >= margin).all(axis=1)
    if unknowns.ceiling is not None:
        is_allowed &= (moduli <= unknowns.ceiling).all(axis=1)
    return np.asarray(is_allowed)


@dataclass(frozen=True)
class RandomStarts:
    """Starts that are drawn independently, each from at most `MAX_DRAWS` draws."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield free coefficients (size,) MPa of allowed moduli."""
        random = np.random.default_rng([seed, number])
        for _ in range(MAX_DRAWS // DRAWS_AT_ONCE):
            shares = random.random((DRAWS_AT_ONCE, dimensions(unknowns)))
            draws = coefficients_at(unknowns, shares)
            yield from draws[allowed(unknowns, draws)]


@dataclass(frozen=True, eq=False)
class EstimatedStarts:
    """One start at estimated coefficients (size,) MPa, all further ones drawn at random."""

    coefficients: Array

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield the estimate first for start 0, then free coefficients (size,) MPa as drawn."""
        if number == 0:
            yield self.coefficients
        yield from RandomStarts().candidates(unknowns, seed, number)


@dataclass(frozen=True)
class SobolStarts:
    """Starts from a Sobol sequence, scrambled by the seed, which spreads them evenly.

    Start k is the k-th point of the sequence (from 0) whose moduli keep the bounds. Random points
    follow as further candidates, for a point that cannot be analysed.
    """

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield the allowed point of that number, then free coefficients (size,) MPa as drawn."""
        sequence = scipy.stats.qmc.Sobol(dimensions(unknowns), seed=seed)
        passed = 0
        for _ in range(MAX_DRAWS // SOBOL_POINTS_AT_ONCE):
            points = coefficients_at(unknowns, sequence.random(SOBOL_POINTS_AT_ONCE))
            allowed_points = points[allowed(unknowns, points)]
            if number < passed + len(allowed_points):
                yield allowed_points[number - passed]
                break
            passed += len(allowed_points)
        yield from RandomStarts().candidates(unknowns, seed, number)


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
        # A method may have switched them off at the end of the last round.
        self.surrogate.warm_starts = True
        max_analyses = self.surrogate.analyses + self.options.max_analyses
        options = replace(self.options, max_analyses=max_analyses)
        optimum = self.method.minimise(self.surrogate, y, options)
        return None if optimum is None else optimum.best.unknowns
