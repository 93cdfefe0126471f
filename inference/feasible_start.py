"""Find the starting point of a fit: an admissible law with which every model can be run."""

from __future__ import annotations

import numpy as np

from ..errors import NoFeasibleStart, SolverFailure
from ..materials.forms.base import Array
from .bounded_step import bounded_step
from .problem import FitProblem
from .starts import MAX_DRAWS
from .unknowns import Unknowns

MAX_ANALYSES = 50  # trial analyses for one start


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
    starts = problem.starts
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
        if tried >= MAX_ANALYSES and not unknowns.size:
            raise NoFeasibleStart(
                f"start {number}: the deck failed with all of {tried} random parameters, at last: "
                f"{problem.failure}; narrow their bounds"
            )
        if tried >= MAX_ANALYSES:
            raise NoFeasibleStart(
                f"start {number}: the analysis failed, or the work of a closed path is above its "
                f"bound, at all of {tried} random points with positive moduli; raise the lower "
                "bounds or law.closed_path, or add increments"
            )
    raise NoFeasibleStart(
        f"start {number}: none of {MAX_DRAWS} random points inside the bounds has positive "
        "moduli over the strain range; check the bounds and the strain range"
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
