"""The limit of ever finer models: what a fit would find with it, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import SolverFailure
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .bounded_step import bounded_step
from .comparison import Comparison
from .descent import MIN_BLOCK_NORM
from .problem import Evaluation, FitProblem


@dataclass(frozen=True, eq=False)
class FineMeshLimit:
    """The limit of ever finer models.

    Attributes
    ----------
    step : (unknowns,) array
        From the best unknowns to those of the limit, within the bounds.
    residual : (m,) array
        What is left there.
    error : (m,) array
        Error of the model at the best unknowns.
    """

    step: Array
    residual: Array
    error: Array


def residual_of(
    problem: FitProblem, comparisons: Sequence[Comparison], best: Evaluation, law: HypoelasticLaw
) -> Array:
    """Return the residual of other models at the best unknowns.

    Parameters
    ----------
    problem : FitProblem
    comparisons : sequence of Comparison
        Those of the problem with other models.
    best : Evaluation
    law : HypoelasticLaw

    Returns
    -------
    (m,) array

    Raises
    ------
    SolverFailure
        A model cannot be run, or gives other residuals.
    """
    unknowns = problem.unknowns
    names = [comparison.name for comparison in problem.comparisons]
    # Where derivatives alone are known, there is no history.
    coarse_runs = dict(zip(names, best.histories, strict=False))
    residuals = []
    for comparison in comparisons:
        nuisance = unknowns.nuisance_values(comparison.name, best.unknowns)
        coarse_run = coarse_runs.get(comparison.name)
        history = comparison.run(law, unknowns.free, nuisance, False, coarse_run)
        residuals.append(comparison.objective.residual(history, nuisance))
    residual = np.concatenate(residuals)
    count = sum(sum(comparison.objective.sizes) for comparison in problem.comparisons)
    if residual.shape != (count,) or not np.isfinite(residual).all():
        raise SolverFailure("the finer model does not give what was matched", problem.solver.name)
    return np.concatenate([residual, best.residual[count:]])  # priors are of the unknowns


def limit_of(
    problem: FitProblem, best: Evaluation, finer: Array, factor: float
) -> FineMeshLimit | None:
    """Return the optimum of the limit of finer models to first order.

    A refinement by k of a model of second order removes c h^2 (1 - 1/k^2) of its error c h^2, which
    gives all of the error.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum, with its Jacobian.
    finer : (m,) array
        Residual of models finer by `factor`, at the same unknowns.
    factor : float

    Returns
    -------
    FineMeshLimit or None
        None if a quadratic programme has no solution.
    """
    assert best.jacobian is not None
    error = (finer - best.residual) * factor**2 / (factor**2 - 1.0)
    blocks = problem.blocks
    # Those of the objective, as the posterior has them; of an exact fit there are none.
    norms = blocks.norms(best.residual)
    if not (norms > 0).any():
        norms = blocks.norms(error)
    if not (norms > 0).any():
        return FineMeshLimit(np.zeros_like(best.unknowns), best.residual, error)
    weights = 1.0 / np.maximum(norms, MIN_BLOCK_NORM * norms.max())[blocks.of]
    step = _step_by_error(problem, best, error, weights)
    if step is None:
        return None
    return FineMeshLimit(step, best.residual + error + best.jacobian @ step, error)


def _step_by_error(
    problem: FitProblem, best: Evaluation, error: Array, weights: Array
) -> Array | None:
    """Return how far the optimum moves (unknowns,) by an error (m,) of the model, in its bounds."""
    assert best.jacobian is not None
    unknowns = problem.unknowns
    weighted = best.jacobian.T * weights
    curvature = weighted @ best.jacobian
    # An unknown of which the data say nothing stays where it is.
    curvature += np.diag(1e-12 * np.diag(curvature) + 1e-14 * np.trace(curvature))
    y = best.unknowns
    without_error = bounded_step(unknowns, curvature, weighted @ best.residual, y)
    with_error = bounded_step(unknowns, curvature, weighted @ (best.residual + error), y)
    if without_error is None or with_error is None:
        return None
    step = with_error - without_error
    if unknowns.keeps_bounds(y + step):
        return step
    # The nearest that does, in the metric of the fit.
    return bounded_step(unknowns, curvature, -curvature @ step, y)
