"""What a finer model would change in a fit, from one analysis of it at the optimum.

The residual of a model of second order is off by c h^2. One refinement by a factor k gives
c h^2 (1 - 1/k^2), so all of it; the Jacobian at the optimum then says where the optimum of the
limit lies, within the same inequalities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw
from .comparison import Comparison
from .methods.descent import bounded_step
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]


def residual_of(
    problem: FitProblem, comparisons: Sequence[Comparison], best: Evaluation, law: HypoelasticLaw
) -> Array:
    """(m,) residual of other models at the best unknowns, row by row that of the problem.

    Raises
    ------
    SolverFailure : a model does not run, or its residual is of other rows.
    """
    unknowns, parts = problem.unknowns, []
    for comparison in comparisons:
        nuisance = unknowns.nuisance_values(comparison.name, best.unknowns)
        history = comparison.run(law, unknowns.free, nuisance, False)
        parts.append(comparison.objective.residual(history, nuisance))
    rows = np.concatenate(parts)
    own = sum(sum(c.objective.sizes) for c in problem.comparisons)
    if rows.shape != (own,) or not np.isfinite(rows).all():
        raise SolverFailure("the finer model does not give what was matched", problem.solver.name)
    return np.concatenate([rows, best.residual[own:]])  # priors are of the unknowns


@dataclass(frozen=True, eq=False)
class Limit:
    """What ever finer models would give.

    step : (unknowns,) from the best unknowns to their own; residual : (m,) what they would leave;
    error : (m,) of the residual at the best unknowns, by which theirs would be another.
    """

    step: Array
    residual: Array
    error: Array


def limit_of(problem: FitProblem, best: Evaluation, finer: Array, factor: float) -> Limit | None:
    """Where the optimum of the limit of finer models lies, and what it leaves, to first order.

    Parameters
    ----------
    best : with its Jacobian. finer : (m,) residual of models finer by `factor`, at the same
        unknowns.

    The blocks are weighted as in the sum of their norms, which the fit minimises. What these
    weights would change without any error is no part of the step. None where the quadratic
    programme has no answer.
    """
    assert best.jacobian is not None
    error = (finer - best.residual) * factor**2 / (factor**2 - 1.0)
    blocks = problem.blocks
    norms = np.maximum(blocks.norms(best.residual), blocks.norms(error))
    if not (norms > 0).any():
        return Limit(np.zeros_like(best.unknowns), best.residual, error)
    weights = 1.0 / np.maximum(norms, 1e-9 * norms.max())[blocks.of]
    weighted = best.jacobian.T * weights
    a, c = problem.unknowns.inequalities
    curvature = weighted @ best.jacobian
    # An unknown of which the data say nothing stays where it is.
    curvature += np.diag(1e-12 * np.diag(curvature) + 1e-14 * np.trace(curvature))
    without, there = (
        bounded_step(curvature, weighted @ residual, a, c, best.unknowns)
        for residual in (best.residual, best.residual + error)
    )
    if without is None or there is None:
        return None
    step = there - without
    return Limit(step, best.residual + error + best.jacobian @ step, error)
