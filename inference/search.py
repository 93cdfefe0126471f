"""Fit from one start, by any method, for any solver."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import NoFeasibleStart
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .bounded_step import bounded_step
from .comparison import Comparison
from .descent import descend
from .methods import FitOptions, Method, method_named
from .problem import CONVERGED, LEVEL, RUNS_USED_UP, Evaluation, FitProblem, Optimum
from .unknowns import MOST_DRAWS, LawBounds, Unknowns

NOT_WORTH_A_RUN = 0.1  # relative decrease of e by one run
SHORTER, MOST_SHORTER = 0.5, 3  # of a step that worsened e; such steps in a row
MOST_ANALYSES = 50  # of a start, at random points
LEADING = 0.3  # of the analyses of a start, each stage that leads in
#: MPa: the law is given and not looked for; bounds only size the unknowns.
ANY = {"E1": (1e-3, 1e6), "E2": (1e-3, 1e6), "G12": (1e-3, 1e6)}
#: Analyses in which what is no law (offsets, the sheet's surface) is fitted to the tests.
MOST, TOLERANCE = 40, 1e-9


def approach(problem: FitProblem, start: Array, method: Method, options: FitOptions) -> Array:
    """Return unknowns at the optimum of the comparisons that lead in; `start` without any.
    Those of the lowest stage are matched first, then those of the lowest two, and so on: from a
    random start nearly every step can end without an equilibrium of one that is hard to run (bias
    strips). `start` also where a comparison fails at the optimum of the others. A stage takes
    `LEADING` of the analyses at most: what it leaves undecided, the others may decide."""
    stages = sorted({c.stage for c in problem.comparisons})
    if len(stages) < 2:
        return start
    y = start
    for last in stages[:-1]:
        part = problem.part([k for k, c in enumerate(problem.comparisons) if c.stage <= last])
        most = problem.analyses + int(LEADING * options.max_analyses)
        optimum = method.minimise(part, y, replace(options, max_analyses=most, leads=True))
        problem.analyses = part.analyses
        if problem.analyses >= options.max_analyses:
            return start
        y = start if optimum is None else optimum.best.unknowns
    point = problem.evaluate(y, False, warm=False)
    return y if point is not None and point.stable else start


def corrected_fit(
    problem: FitProblem, start: Array, method: Method, options: FitOptions
) -> Optimum | None:
    """Fit a solver without derivatives, led by a surrogate; None when it fails wherever that leads.
    Minimised is surrogate(beta) + [other(beta_k) - surrogate(beta_k)] - data, with the surrogate's
    exact Jacobian; the other solver then runs once at the new beta, and so on until its own
    objective, which alone counts, is level. A step that worsens that is shortened (trust region).
    """
    surrogate = problem.surrogate
    assert surrogate is not None
    objectives = [comparison.objective for comparison in surrogate.comparisons]

    def restore() -> None:
        for comparison, objective in zip(surrogate.comparisons, objectives, strict=True):
            comparison.objective = objective

    try:
        best: Evaluation | None = None
        status = RUNS_USED_UP
        shorter = 0
        failure = ""
        y = _lead(surrogate, start, method, options)
        while y is not None and problem.analyses < options.max_runs:
            point = problem.evaluate(y, False)
            worse = point is not None and best is not None and point.value >= best.value
            if point is None or not point.stable or worse:
                least = np.inf if point is None or not point.stable else point.value
                level = best is not None and least < (1 + NOT_WORTH_A_RUN) * best.value
                if shorter == MOST_SHORTER or level:
                    status = LEVEL
                    failure = problem.failure if point is None else ""
                    break
                shorter += 1
                origin = start if best is None else best.unknowns
                y = origin + SHORTER * (y - origin)
                continue
            level = best is not None and point.value > (1 - NOT_WORTH_A_RUN) * best.value
            best = point
            shorter = 0
            if level or best.value < options.tolerance:
                status = LEVEL if level else CONVERGED
                break
            beside = surrogate.evaluate(y, False, warm=False)
            if beside is None:
                status = f"{surrogate.solver.name} failed"
                break
            restore()
            surrogate.shift(point.histories, beside.histories)
            y = _lead(surrogate, y, method, options)
    finally:
        restore()
    if best is None:
        return None
    status = f"{problem.solver.name} failed: {failure}" if failure else status
    runs = problem.analyses
    return Optimum(best, status, runs + surrogate.analyses, runs, failure)


def _lead(surrogate: FitProblem, y: Array, method: Method, options: FitOptions) -> Array | None:
    """Return unknowns at the optimum of the surrogate's (corrected) objective."""
    surrogate.warm_starts = True
    most = surrogate.analyses + options.max_analyses
    optimum = method.minimise(surrogate, y, replace(options, max_analyses=most))
    return None if optimum is None else optimum.best.unknowns


def fit_from(
    problem: FitProblem, start: Array, options: FitOptions, near: bool = False
) -> Optimum | None:
    """Fit from the unknowns `start`; None where that fails; near : no comparisons lead in."""
    method = method_named(options.method)
    if not method.needs_slope:
        return method.minimise(problem, start, options)
    y = start if near else approach(problem.surrogate or problem, start, method, options)
    if problem.surrogate is not None:
        return corrected_fit(problem, y, method, options)
    return method.minimise(problem, y, options)


def feasible_start(problem: FitProblem, seed: int, number: int) -> Array:
    """Return the unknowns of start `number` of the study `seed`: the same on any machine.
    Candidates of the problem's `starts` are tried until an analysis ends well, in a stable
    equilibrium. Raises NoFeasibleStart after 200,000 draws or 50 analyses."""
    # Where another solver counts, its runs are not spent on draws.
    starts = problem.starts
    problem = problem.surrogate or problem
    unknowns = problem.unknowns
    tried = 0
    for coefficients in starts.candidates(unknowns, seed, number):
        tried += 1
        y = unknowns.at(coefficients)
        step: Array | None = np.zeros_like(y)
        if not unknowns.within_work(y):  # the nearest that is
            step = bounded_step(unknowns, np.eye(len(y)), np.zeros(len(y)), y)
        y = y if step is None else y + step
        point = None if step is None else problem.evaluate(y, False, warm=False)
        if point is not None and point.stable:
            return y
        if tried >= MOST_ANALYSES:
            raise NoFeasibleStart(
                f"start {number}: the analysis failed, or the work of a closed path is above its "
                f"bound, at all of {tried} random points with positive moduli; raise the lower "
                "bounds or law.closed_path, or add increments"
            )
    raise NoFeasibleStart(
        f"start {number}: none of {MOST_DRAWS} random points inside the bounds has positive "
        "moduli over the strain range; check the bounds and the strain range"
    )


def problem_at(law: HypoelasticLaw, comparisons: Sequence[Comparison]) -> tuple[FitProblem, Array]:
    """Return comparisons with a given law as a problem, and its unknowns, nuisance at its start."""
    ends = law.strain_range.tolist()
    unknowns = Unknowns.of(law.form, law.nu12, ends, LawBounds.of_moduli(ANY), comparisons)
    y = unknowns.at(law.beta[list(unknowns.free)])
    return FitProblem(tuple(comparisons), law, unknowns), y


def evaluate_law(problem: FitProblem, y: Array, with_jacobian: bool = False) -> Evaluation | None:
    """Evaluate the law of unknowns y with its best-fitting nuisance; None where an analysis failed.
    The nuisance stays as in y where the problem's solver gives no derivatives."""
    return fit_nuisance(problem, y, with_jacobian)[0]


def fit_nuisance(
    problem: FitProblem, y: Array, with_jacobian: bool = False
) -> tuple[Evaluation | None, str]:
    """Return `evaluate_law` and the status with which its descent ended, "" without a descent."""
    if not problem.unknowns.nuisance.all or not problem.differentiates:
        return problem.evaluate(y, with_jacobian, warm=False), ""
    first = problem.evaluate(y, True)
    if first is None:
        return None, ""
    free = np.arange(problem.unknowns.count) >= problem.unknowns.size
    # Squares lead to the optimum of e, the sum of norms, from further away.
    near, _ = descend(problem, first, TOLERANCE, MOST, may_change=free)
    most = problem.analyses + MOST
    return descend(problem, near, TOLERANCE, most, norms=True, may_change=free)
