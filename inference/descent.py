"""Levenberg-Marquardt with linear inequalities: each step is a small convex QP.

Damping is scaled by diag(J'J) (Marquardt), positivity and bounds are constraints, so every iterate
is feasible, and a stable equilibrium: a soft membrane can fold, as no test under pressure can show.
Where much is left of the residual its own curvature counts: it is learnt from the steps, and taken
as long as it predicts what a step gains better than the slopes alone (J. E. Dennis, D. M. Gay,
R. E. Welsch, ACM Trans. Math. Softw. 7 (1981) 348).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import quadprog
from numpy.typing import NDArray

from ..materials.forms.base import Array
from .problem import ANALYSES_USED_UP, CONVERGED, LEVEL, Evaluation, FitProblem
from .unknowns import Unknowns

FIRST_DAMPING = 1e-2
MOST_TRIALS = 12  # of one step, with growing damping
NEGLIGIBLE = 1e-6  # predicted relative decrease that is not worth an analysis
#: Relative decrease that counts as no progress, and how often in a row ends the descent.
SETTLES = 1e-4, 3
SMALLEST_DROP = 1e-3  # of the shear modulus, relative, that can explain a loss of stability
SMALLEST_BLOCK = 1e-6  # of the largest norm of a block: smaller ones weigh no more than it
DEFINITE = 1e-10  # least eigenvalue of a curvature with ones on its diagonal


def descend(
    problem: FitProblem, point: Evaluation, tolerance: float, max_analyses: int,
    norms: bool = False, only: NDArray[np.bool_] | None = None, damping: float = FIRST_DAMPING,
    negligible: float = NEGLIGIBLE, settles: tuple[float, int] = SETTLES,
) -> tuple[Evaluation, str]:  # fmt: skip
    """Go down from `point` until e < tolerance, no progress, or `max_analyses` of the problem.
    norms : minimise e itself, the sum of the blocks' norms, instead of their squares. only :
    (unknowns,) which may change. negligible : predicted relative decrease that is not worth an
    analysis. settles : relative decrease that counts as none, and how often in a row it ends.
    Returns the best point, and CONVERGED, LEVEL or ANALYSES_USED_UP."""
    end = CONVERGED if norms else LEVEL
    growth, idle = 2.0, 0
    scale: Array | None = None
    here = _Near.of(problem, point, norms, only)
    own, use_own = np.zeros_like(here.curvature), False
    while True:
        if point.value < tolerance:
            return point, CONVERGED
        diagonal = np.diag(here.curvature) + 1e-14 * np.trace(here.curvature)
        if only is not None:
            diagonal[~only] = 1e6 * np.trace(here.curvature)
        # Half-life of one iteration: directions that went flat keep some damping.
        scale = diagonal if scale is None else np.maximum(0.5 * scale, diagonal)
        models = here.curvature, here.curvature + own - here.across
        cuts: list[tuple[Array, float]] = []
        for _ in range(MOST_TRIALS):
            if problem.analyses >= max_analyses:
                return point, ANALYSES_USED_UP
            damped = [model + damping * np.diag(scale) for model in models]
            which = int(use_own and _definite(damped[1]))
            step = bounded_step(
                problem.unknowns, damped[which], here.gradient, point.unknowns, cuts
            )
            if step is None:
                damping *= 10.0
                continue
            predicted = [float(-(2.0 * here.gradient + m @ step) @ step) for m in models]
            if predicted[which] < negligible * here.merit:
                return point, end
            trial = problem.evaluate(point.unknowns + step, True)
            if trial is not None and point.stable and not trial.stable:
                cut = _cut(problem, point.unknowns, trial.unknowns)
                if cut is not None:
                    cuts.append(cut)
                    continue
            elif trial is not None:
                squares = float(trial.residual @ trial.residual)
                gained = 2 * (point.value - trial.value) if norms else here.merit - squares
                if gained > 0:
                    break
            if which:
                use_own = False
            else:
                damping, growth = damping * growth, min(2.0 * growth, 64.0)
        else:
            return point, end
        ratio = gained / max(predicted[which], 1e-300)
        damping = max(damping * max(1 / 8, 1 - (2 * min(ratio, 1.0) - 1) ** 3), 1e-15)
        growth = 2.0
        idle = idle + 1 if gained < settles[0] * here.merit else 0
        use_own = abs(predicted[1] - gained) < abs(predicted[0] - gained)
        there = _Near.of(problem, trial, norms, only)
        own = _learnt(own, step, there.turned(here), there.gradient - here.gradient)
        point, here = trial, there
        if idle >= settles[1]:
            return point, end


@dataclass(frozen=True, eq=False)
class _Near:
    """A point as its step sees it, to second order.
    r (m,), j (m, unknowns) : weighed by `root` so that the squares add up to `merit`. gradient,
    curvature : of half of it. across : by how much less the norms of blocks curve."""

    root: Array
    r: Array
    j: Array
    gradient: Array
    curvature: Array
    across: Array
    merit: float

    @classmethod
    def of(
        cls, problem: FitProblem, point: Evaluation, norms: bool, only: NDArray[np.bool_] | None
    ) -> Self:
        assert point.jacobian is not None
        root = np.ones_like(point.residual)
        if norms:
            # 1/norm of each block majorises e: its weighted sum of squares falls only if e does.
            sizes = problem.blocks.norms(point.residual)
            sizes = np.maximum(sizes, SMALLEST_BLOCK * sizes.max())
            root = np.asarray(1.0 / np.sqrt(sizes))[problem.blocks.of]
        r, j = point.residual * root, point.jacobian * root[:, None]
        if only is not None:
            j[:, ~only] = 0.0
        curvature = j.T @ j
        across = np.zeros_like(curvature)
        if norms:  # a norm is not curved along its own residual
            slopes = np.add.reduceat(r[:, None] * j, problem.blocks.starts)
            across = (slopes.T / sizes) @ slopes
        return cls(root, r, j, j.T @ r, curvature, across, float(r @ r))

    def turned(self, before: Self) -> Array:
        """Return the part of the gradient's change that the slopes' change makes, (unknowns,)."""
        return self.gradient - before.j.T @ (self.root / before.root * self.r)


def _learnt(own: Array, step: Array, turned: Array, change: Array) -> Array:
    """Return the residuals' own curvature, sized and then changed least to agree with a step."""
    along = float(change @ step)
    if along <= 1e-12 * np.linalg.norm(change) * np.linalg.norm(step):
        return own
    had = float(step @ own @ step)
    own = own * (min(1.0, abs(float(step @ turned) / had)) if had else 1.0)
    off = turned - own @ step
    both = np.outer(off, change) / along
    back = float(off @ step) / along**2
    return np.asarray(own + both + both.T - back * np.outer(change, change))


def _definite(matrix: Array) -> bool:
    unit = np.sqrt(np.abs(np.diag(matrix)))
    return bool(np.linalg.eigvalsh(matrix / np.outer(unit, unit))[0] > DEFINITE)


def _cut(problem: FitProblem, stable: Array, unstable: Array) -> tuple[Array, float] | None:
    """Return an inequality that keeps the next step half as far from the largest drop in shear.
    A membrane loses its stability in shear, and the fit can slide along that border. None without
    one."""
    rows = problem.unknowns.stability_rows
    before, after = rows @ stable, rows @ unstable
    drop = (before - after) / before
    k = int(np.argmax(drop))
    if drop[k] < SMALLEST_DROP:
        return None
    return rows[k], float(0.5 * (before[k] + after[k]))


MOST_ROUNDS = 12  # linearisations of the work of a closed path, each where the last one led


def bounded_step(
    unknowns: Unknowns, hessian: Array, gradient: Array, y: Array,
    cuts: Sequence[tuple[Array, float]] = (), plane: tuple[Array, float] | None = None,
) -> Array | None:  # fmt: skip
    """Minimise g's + s'Hs/2 within the bounds of the unknowns at y + s; None where that fails.
    cuts : (row, least) of row (y + s) >= least. plane : (row, value) of row (y + s) = value."""
    a, c = unknowns.inequalities
    if cuts:
        a, c = np.vstack([a, *(row for row, _ in cuts)]), np.append(c, [least for _, least in cuts])
    rows = np.empty((0, len(y))), np.empty(0)
    for _ in range(MOST_ROUNDS):
        step = _quadratic(hessian, gradient, a, c, y, rows, plane)
        if step is None or unknowns.within_work(y + step):
            return step
        rows = unknowns.work_rows(y + step)
    return None


def _quadratic(
    hessian: Array, gradient: Array, a: Array, c: Array, y: Array, rows: tuple[Array, Array],
    plane: tuple[Array, float] | None,
) -> Array | None:  # fmt: skip
    """Solve the QP: a (y + s) >= c as far as y keeps it, the same of `rows` wholly."""
    unit = 1.0 / np.sqrt(np.diag(hessian))
    scaled = hessian * unit[:, None] * unit[None, :]
    room = np.append(np.minimum(c - a @ y, 0.0) - 1e-12, rows[1] - rows[0] @ y)
    a = np.vstack([a, rows[0]])
    if plane is not None:
        row, value = plane
        a, room = np.vstack([row, a]), np.concatenate([[value - row @ y], room])
    try:
        solution = quadprog.solve_qp(
            scaled, -gradient * unit, (a * unit).T, room, int(plane is not None)
        )[0]
    except ValueError:
        return None
    return np.asarray(solution * unit)
