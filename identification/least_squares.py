"""One descent of Levenberg-Marquardt with linear inequalities: each step is a small convex QP.

Damping is scaled by diag(J'J) (Marquardt), modulus values at Chebyshev points are the unknowns,
positivity and coefficient bounds the constraints, so every iterate is feasible; and every iterate
is a stable equilibrium (Eq. 4.9's "analysis ends well"): a soft membrane can fold, and what no
test under pressure can show must not lead the fit astray.
"""

from __future__ import annotations

import numpy as np
import quadprog
from numpy.typing import NDArray

from ..materials.positivity import GRID
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

FIRST_DAMPING = 1e-2
MOST_TRIALS = 12  # of one step, with growing damping
NEGLIGIBLE = 1e-6  # predicted relative decrease that is not worth an analysis
SETTLED = 1e-4  # relative decrease that counts as no progress ...
SMALLEST_DROP = 1e-3  # of G12, relative, that can explain a loss of stability
PATIENCE = 3  # ... when it happens so often in a row


def descend(
    problem: FitProblem,
    point: Evaluation,
    tolerance: float,
    max_analyses: int,
    reweighted: bool = False,
    held: slice | None = None,
) -> tuple[Evaluation, str]:
    """Go down from `point` until e < tolerance, no progress, or `max_analyses` of the problem.

    `reweighted`: minimise e itself, not the sum of squared blocks; `held` unknowns stay.
    Returns the last (best) point and "converged", "settled" or "analyses used up".
    """
    damping, growth, idle = FIRST_DAMPING, 2.0, 0
    scale: Array | None = None
    while True:
        if point.value < tolerance:
            return point, "converged"
        root = _block_weights(problem, point, reweighted)
        r, j = point.residual * root, _jacobian(point) * root[:, None]
        if held is not None:
            j[:, held] = 0.0
        merit = float(r @ r)
        curvature = j.T @ j
        diagonal = np.diag(curvature) + 1e-14 * np.trace(curvature)
        if held is not None:
            diagonal[held] = 1e6 * np.trace(curvature)
        # Half-life of one iteration: directions that went flat keep some damping.
        scale = diagonal if scale is None else np.maximum(0.5 * scale, diagonal)
        gradient = j.T @ r
        a, c = problem.parameters.inequalities
        for _ in range(MOST_TRIALS):
            if problem.analyses >= max_analyses:
                return point, "analyses used up"
            step = bounded_step(
                curvature + damping * np.diag(scale), gradient, a, c, point.unknowns
            )
            if step is None:
                damping *= 10.0
                continue
            predicted = -(2.0 * gradient @ step + step @ curvature @ step)
            if predicted < NEGLIGIBLE * merit:
                return point, "settled" if not reweighted else "converged"
            trial = problem.evaluate(point.unknowns + step, True)
            if trial is not None and not trial.stable:
                cut = _cut(problem, point.unknowns, trial.unknowns)
                if cut is not None:
                    a, c = np.vstack([a, cut[0]]), np.append(c, cut[1])
                    continue
            elif trial is not None:
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


def _cut(problem: FitProblem, stable: Array, unstable: Array) -> tuple[Array, float] | None:
    """An inequality that keeps the next step half as far from G12's largest drop.

    A membrane loses its stability in shear: so a refused step says where G12 was too low, and
    the fit can slide along that border instead of stopping at it. None when G12 did not drop.
    """
    a, _ = problem.parameters.inequalities
    rows = a[:GRID]
    before, after = rows @ stable, rows @ unstable
    drop = (before - after) / before
    k = int(np.argmax(drop))
    if drop[k] < SMALLEST_DROP:
        return None
    return rows[k], float(0.5 * (before[k] + after[k]))


def _jacobian(point: Evaluation) -> Array:
    assert point.jacobian is not None
    return point.jacobian


def _block_weights(problem: FitProblem, point: Evaluation, reweighted: bool) -> Array:
    """Square roots of the weights of the squared residuals, (m,).

    1/norm of each block majorises e: its weighted sum of squares decreases only if e does.
    """
    if not reweighted:
        return np.ones_like(point.residual)
    norms = problem.blocks.norms(point.residual)
    norms = np.maximum(norms, 1e-6 * norms.max())
    return np.asarray(1.0 / np.sqrt(norms))[problem.blocks.of]


def bounded_step(hessian: Array, gradient: Array, a: Array, c: Array, y: Array) -> Array | None:
    """Minimise g's + s'Hs/2 subject to a (y + s) >= c; None when the QP has no answer."""
    unit = 1.0 / np.sqrt(np.diag(hessian))
    scaled = hessian * unit[:, None] * unit[None, :]
    room = np.minimum(c - a @ y, 0.0) - 1e-12
    try:
        solution = quadprog.solve_qp(scaled, -gradient * unit, (a * unit).T, room)[0]
    except ValueError:
        return None
    return np.asarray(solution * unit)
