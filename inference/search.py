"""Fit a problem from one start, with any optimiser and any solver."""

from __future__ import annotations

from dataclasses import replace

from ..materials.forms.base import Array
from .correction import corrected_fit
from .methods import FitOptions, Method, method_named
from .optimum import Optimum
from .problem import FitProblem

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
