"""Levenberg-Marquardt with linear inequalities: each step is a small convex QP.

Damping is scaled by diag(J'J) (Marquardt), modulus values at Chebyshev points are the unknowns,
positivity and coefficient bounds the constraints, so every iterate is feasible. The merit is the
sum of squared blocks while e is far from its least; once that has settled at a residual that is
not zero, the blocks are reweighted so that e itself (a sum of norms, Eq. 4.8) is minimised.
"""

from __future__ import annotations

import numpy as np
import quadprog
from numpy.typing import NDArray

from .optimum import Optimum
from .problem import Evaluation, FieldProblem

Array = NDArray[np.float64]

FIRST_DAMPING = 1e-2
MOST_TRIALS = 12  # of one step, with growing damping
SETTLED = 1e-4  # relative decrease that counts as no progress ...
PATIENCE = 3  # ... when it happens so often in a row
SAME = 1e-5  # e of the same equilibrium, found twice
MOST_REWEIGHTED = 40  # analyses of the second stage


def levenberg_marquardt(
    problem: FieldProblem, start: Array, tolerance: float, max_analyses: int
) -> Optimum | None:
    """Fit from the unknowns `start`; None when the analysis at the start fails.

    Stops when e is below `tolerance`, on no progress, or after `max_analyses`.
    """
    point = problem.evaluate(start, True)
    if point is None:
        return None
    best, status = _both_stages(problem, point, tolerance, max_analyses)
    if best.value < tolerance:
        return Optimum(best, status, problem.analyses)
    # A soft membrane can fold: make sure that the fit did not settle on a branch that only its
    # own warm starts reach. What a card promises has to be found from the flat state.
    cold = problem.evaluate(best.unknowns, True, warm=False)
    if cold is not None and abs(cold.value - best.value) <= SAME * best.value:
        return Optimum(cold, status, problem.analyses)
    problem.warm_starts = False
    again = cold if cold is not None else problem.evaluate(start, True)
    if again is None:
        return None
    limit = max_analyses + problem.analyses
    best, status = _both_stages(problem, again, tolerance, limit)
    return Optimum(best, status, problem.analyses)


def _both_stages(
    problem: FieldProblem, point: Evaluation, tolerance: float, max_analyses: int
) -> tuple[Evaluation, str]:
    best, status = _descend(problem, point, tolerance, max_analyses, reweighted=False)
    if status == "settled":
        limit = min(max_analyses, problem.analyses + MOST_REWEIGHTED)
        best, status = _descend(problem, best, tolerance, limit, reweighted=True)
    return best, status


def _descend(
    problem: FieldProblem,
    point: Evaluation,
    tolerance: float,
    max_analyses: int,
    reweighted: bool,
) -> tuple[Evaluation, str]:
    a, c = problem.parameters.inequalities
    damping, growth, idle = FIRST_DAMPING, 2.0, 0
    scale: Array | None = None
    while True:
        if point.value < tolerance:
            return point, "converged"
        root = _block_weights(problem, point, reweighted)
        r, j = point.residual * root, _jacobian(point) * root[:, None]
        merit = float(r @ r)
        curvature = j.T @ j
        diagonal = np.diag(curvature) + 1e-14 * np.trace(curvature)
        # Half-life of one iteration: directions that went flat keep some damping.
        scale = diagonal if scale is None else np.maximum(0.5 * scale, diagonal)
        gradient = j.T @ r
        for _ in range(MOST_TRIALS):
            if problem.analyses >= max_analyses:
                return point, "analyses used up"
            step = _step(curvature + damping * np.diag(scale), gradient, a, c, point.unknowns)
            if step is None:
                damping *= 10.0
                continue
            predicted = -(2.0 * gradient @ step + step @ curvature @ step)
            trial = problem.evaluate(point.unknowns + step, True)
            if trial is not None:
                gained = merit - float(np.sum((trial.residual * root) ** 2))
                if gained > 0:
                    break
            damping, growth = damping * growth, min(2.0 * growth, 64.0)
        else:
            return point, "settled" if not reweighted else "converged"
        ratio = float(gained / max(float(predicted), 1e-300))
        damping = max(damping * max(1 / 8, 1 - (2 * min(ratio, 1.0) - 1) ** 3), 1e-15)
        growth = 2.0
        idle = idle + 1 if gained < SETTLED * merit else 0
        point = trial
        if idle >= PATIENCE:
            return point, "settled" if not reweighted else "converged"


def _jacobian(point: Evaluation) -> Array:
    assert point.jacobian is not None
    return point.jacobian


def _block_weights(problem: FieldProblem, point: Evaluation, reweighted: bool) -> Array:
    """Square roots of the weights of the squared residuals, (m,).

    1/norm of each block majorises e: its weighted sum of squares decreases only if e does.
    """
    if not reweighted:
        return np.ones_like(point.residual)
    norms = problem.objective.block_norms(point.residual)
    norms = np.maximum(norms, 1e-6 * norms.max())
    return np.asarray(1.0 / np.sqrt(norms))[problem.objective.block]


def _step(hessian: Array, gradient: Array, a: Array, c: Array, y: Array) -> Array | None:
    """Minimise g's + s'Hs/2 subject to a (y + s) >= c; None when the QP has no answer."""
    unit = 1.0 / np.sqrt(np.diag(hessian))
    scaled = hessian * unit[:, None] * unit[None, :]
    room = np.minimum(c - a @ y, 0.0) - 1e-12
    try:
        solution = quadprog.solve_qp(scaled, -gradient * unit, (a * unit).T, room)[0]
    except ValueError:
        return None
    return np.asarray(solution * unit)
