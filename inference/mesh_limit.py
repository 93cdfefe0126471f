"""Extrapolate a fit to the limit of ever finer meshes, to first order in the mesh error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import SolverFailure
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .bounded_step import bounded_step, with_small_diagonal
from .comparison import Comparison
from .descent import MIN_BLOCK_NORM
from .problem import Evaluation, FitProblem


@dataclass(frozen=True, eq=False)
class FineMeshLimit:
    """A fit in the limit of ever finer meshes, as first-order extrapolation gives it.

    Attributes
    ----------
    step : (unknowns,) array
        Change from the best unknowns to those of the limit, which keep the bounds.
    residual : (m,) array
        Residual of the limit at its unknowns, to first order.
    error : (m,) array
        Residual of the limit less that of the fit's own mesh, both at the best unknowns.
    """

    step: Array
    residual: Array
    error: Array


def residual_of(
    problem: FitProblem,
    comparisons: Sequence[Comparison],
    best: Evaluation,
    law: HypoelasticLaw,
) -> Array:
    """Run finer models at the best unknowns, and return their residual.

    Parameters
    ----------
    problem : FitProblem
    comparisons : sequence of Comparison
        The comparisons of the problem, with finer models.
    best : Evaluation
        The optimum of the fit.
    law : HypoelasticLaw
        The law at the optimum.

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
    problem: FitProblem,
    best: Evaluation,
    finer: Array,
    factor: float,
) -> FineMeshLimit | None:
    """Return the optimum in the limit of ever finer meshes, to first order.

    The error of a second-order model with element size h is c h^2; a mesh finer by the factor k
    removes c h^2 (1 - 1/k^2) of it. The change by one refinement thus tells the whole error.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum, with its Jacobian.
    finer : (m,) array
        Residual of the finer models at the same unknowns.
    factor : float
        Their refinement k, coarse over fine element size.

    Returns
    -------
    FineMeshLimit or None
        None if a quadratic programme has no solution.
    """
    assert best.jacobian is not None
    error = (finer - best.residual) * factor**2 / (factor**2 - 1.0)
    blocks = problem.blocks
    # Weights as in the objective; an exact fit, whose norms are zero, takes those of the error.
    norms = blocks.norms(best.residual)
    if not (norms > 0).any():
        norms = blocks.norms(error)
    if not (norms > 0).any():
        return FineMeshLimit(np.zeros_like(best.unknowns), best.residual, error)
    weights = 1.0 / np.maximum(norms, MIN_BLOCK_NORM * norms.max())[blocks.block_of]
    step = _step_by_error(problem, best, error, weights)
    if step is None:
        return None
    return FineMeshLimit(step, best.residual + error + best.jacobian @ step, error)


def _step_by_error(
    problem: FitProblem,
    best: Evaluation,
    error: Array,
    weights: Array,
) -> Array | None:
    """Return how far the optimum moves (unknowns,) by an error (m,) of the model, in its bounds.

    Parameters
    ----------
    weights : (m,) array
        Weights of the squared residuals in the fit.
    """
    assert best.jacobian is not None
    unknowns = problem.unknowns
    weighted = best.jacobian.T * weights
    curvature = with_small_diagonal(weighted @ best.jacobian)
    y = best.unknowns
    without_error = bounded_step(unknowns, curvature, weighted @ best.residual, y)
    with_error = bounded_step(unknowns, curvature, weighted @ (best.residual + error), y)
    if without_error is None or with_error is None:
        return None
    step = with_error - without_error
    if unknowns.keeps_bounds(y + step):
        return step
    # The nearest step that keeps them, in the metric of the fit.
    return bounded_step(unknowns, curvature, -curvature @ step, y)
