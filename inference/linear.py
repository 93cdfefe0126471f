"""Linearise a fit at its optimum: posteriors, mesh error, second order, information.

Near its optimum a fit of the sum of the norms of its blocks is a least squares fit in which every
block weighs the inverse of its norm, and it is that estimate which the noise moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import SolverFailure
from ..materials.forms.base import COMPONENTS, Array
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind
from ..solvers.base import History
from .bounded_step import bounded_step
from .comparison import Comparison, Nuisance
from .descent import MIN_BLOCK_NORM
from .noise import Noise, misfits
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

SECOND_ORDER = NoteKind("second order")  # kinds of notes that are made here


FLAT = 1e-13  # of the largest curvature of the misfit: below, the data say nothing of a direction


@dataclass(frozen=True, eq=False)
class SecondOrderTerms:
    """Second-order terms of the sum of the blocks' norms beside the squares of its slopes.
    added : (unknowns, unknowns) in the sizes of a `LinearisedFit`, to half of the curvature of the
    weighted sum of squares. left : (m,) the residual of each block over its norm, zero where the
    block's weight is its noise's; along it a norm is not curved."""

    added: Array
    left: Array
    directions: int
    analyses: int

    def slopes(self, problem: FitProblem, jacobian: Array) -> Array:
        """Return (m, unknowns), the slope of each residual's block along its residual."""
        blocks = problem.blocks
        return np.asarray(np.add.reduceat(self.left[:, None] * jacobian, blocks.starts)[blocks.of])


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """A fit near its optimum as least squares, every block weighted by the inverse of its norm.
    sizes : (unknowns,) in which they are counted. weights : (m,) roots of those of the squares.
    sharp, flat : directions that the data determine, and those they do not. curvature : (sharp,) of
    half the weighted sum of squares. estimator : (unknowns, m) from weighted residuals to minus the
    move of the unknowns; moved : the same for the noise of each residual."""

    sizes: Array
    weights: Array
    sharp: Array
    flat: Array
    curvature: Array
    estimator: Array
    moved: Array

    @classmethod
    def of(
        cls,
        problem: FitProblem,
        best: Evaluation,
        noise: Noise,
        second: SecondOrderTerms | None = None,
    ) -> LinearisedFit:
        """Linearise at the optimum with its Jacobian, and with second-order terms if given."""
        assert best.jacobian is not None
        weights = np.sqrt(weights_of(problem, best.residual, noise))
        sizes = sizes_of(problem.unknowns, best.unknowns)
        j = best.jacobian * sizes * weights[:, None]
        curvature, directions = np.linalg.eigh(j.T @ j)
        good = curvature > FLAT * curvature[-1]
        sharp = directions[:, good]
        flat = directions[:, ~good]
        whole = np.diag(curvature[good])
        answering = j
        if second is not None:
            whole = whole + sharp.T @ second.added @ sharp
            answering = j - second.left[:, None] * second.slopes(problem, j)
        inverse = sharp @ np.linalg.inv(whole) @ sharp.T
        estimator, answer = (inverse @ one.T for one in (j, answering))
        moved = answer * (weights * noise.residual_sigma)
        return cls(sizes, weights, sharp, flat, curvature[good], estimator, moved)

    def spread_over_curvature(self, row: Array) -> float:
        """Return the variance of row @ unknowns over that of weighted squares of noise one (or
        NaN). So much too fast these grow along it for a likelihood ratio (J. T. Kent, Robust
        properties of likelihood ratio tests, Biometrika 69, 1982)."""
        scaled = row * self.sizes
        along = self.sharp.T @ scaled
        curved = float(along**2 @ (1.0 / self.curvature))
        return float(np.sum((scaled @ self.moved) ** 2)) / curved if curved > 0 else np.nan


def weights_of(problem: FitProblem, residual: Array, noise: Noise) -> Array:
    """Return (m,) weights of the squares near the least sum of the norms of their blocks."""
    blocks = problem.blocks
    norms = np.maximum(blocks.norms(residual), blocks.norms(noise.smallest_residual_sigma))
    largest = norms.max()
    if not largest > 0:
        return np.ones_like(residual)
    return np.asarray(1.0 / np.maximum(norms, MIN_BLOCK_NORM * largest)[blocks.of])


def sizes_of(unknowns: Unknowns, best: Array) -> Array:
    """Return (unknowns,) the size of each: its own, or the width of its bounds."""
    lower, upper = unknowns.nuisance.bounds
    law = np.abs(best[: unknowns.size])
    return np.concatenate([np.maximum(law, 1e-3), np.maximum(upper - lower, 1e-3)])


POINTS = 61  # strains at which a modulus is looked at
PRIOR = 10.0  # relative uncertainty of a modulus of which nothing is known
#: Of the step to the limit of finer models, what may be left of it (one standard deviation): with
#: data without noise, a mesh of 432 quads leaves 6 to 12 % of what it moves the moduli by
#: (benchmarks/bench_bands.py bias).
LEFT = 0.1


def posteriors_of(
    problem: FitProblem,
    best: Evaluation,
    noise: Noise,
    limit: FineMeshLimit | None = None,
    second: SecondOrderTerms | None = None,
) -> tuple[Posterior, Posterior | None]:
    """Return the posterior from the noise, and that of ever finer models (None without `limit`).
    The latter's covariance includes the model error that may be left. A block that is fitted better
    than its noise allows has the norm of the noise; a direction without data is as uncertain as
    `PRIOR`."""
    linear = LinearisedFit.of(problem, best, noise, second)
    sizes = linear.sizes
    moved = linear.moved
    scaled = moved @ moved.T + PRIOR**2 * linear.flat @ linear.flat.T
    covariance = np.asarray(scaled * sizes[:, None] * sizes)

    # The noise makes no other optimum: what pulls at the best fit is weighted as in the objective.
    noiseless = replace(noise, smallest_residual_sigma=np.zeros_like(best.residual))
    exact = LinearisedFit.of(problem, best, noiseless, second)

    def centre(residual: Array) -> Array:
        return np.asarray(best.unknowns - sizes * (exact.estimator @ (exact.weights * residual)))

    own = Posterior(problem.unknowns, best.unknowns, centre(best.residual), covariance)
    if limit is None:
        return own, None
    return own, own.shifted(limit.step, centre(best.residual + limit.error), LEFT)


def moduli_of(unknowns: Unknowns, y: Array, strains: Mapping[str, Array]) -> dict[str, Array]:
    """Return (n,) MPa by modulus at strains (n,), of the law at unknowns y."""
    coefficients = unknowns.to_coefficients @ y[: unknowns.size]
    return {name: unknowns.rows(name, strain) @ coefficients for name, strain in strains.items()}


def relative_changes(
    unknowns: Unknowns, y: Array, step: Array, strains: Mapping[str, Array]
) -> dict[str, Array]:
    """Return (n,) by modulus at strains (n,), its relative change by a step of the unknowns y."""
    before, after = (moduli_of(unknowns, point, strains) for point in (y, y + step))
    return {name: after[name] / before[name] - 1.0 for name in strains}


def moduli_sigmas(
    unknowns: Unknowns, law: HypoelasticLaw, reached: Array, covariance: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return strains and 1-sigma relative uncertainty of each modulus from a covariance."""
    size = unknowns.size
    to = unknowns.to_coefficients
    moved = to @ covariance[:size, :size] @ to.T
    strains = {}
    sigmas = {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, reached[component], POINTS)
        rows = unknowns.rows(name, strain)
        sigma = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", rows, moved, rows), 0.0))
        strains[name], sigmas[name] = strain, sigma / law.modulus(name, strain)
    return strains, sigmas


#: Times the noise of the data that is left of a comparison, from which on it is looked at.
LARGE = 2.0
MOST = 8  # directions that are looked at, an analysis each
#: Of a step, in standard deviations; its least and largest size, relative to the unknowns.
STEP, LEAST_STEP, LARGEST_STEP = 0.5, 1e-3, 0.05
#: Curvature that must be left of that of the first derivatives, for the sum to be taken for it.
LEFT_SECOND_ORDER = 0.05
WORTHWHILE_CHANGE = 0.1  # change of a modulus' sigma, relative, that is worth telling, and taking
NOT_DEFINITE = "not positive definite"
TOO_LITTLE = "too little changes"


@dataclass(frozen=True)
class UncertaintyOrder:
    """The order of the uncertainty, and its reason.
    used : second order. reason : "" where used, else NOT_DEFINITE or TOO_LITTLE. change : by
    modulus, largest relative change of its sigma by the second order; empty where it has none.
    directions, analyses : numbers of them."""

    used: bool
    reason: str
    change: Mapping[str, float]
    directions: int
    analyses: int

    @property
    def numbers(self) -> dict[str, Any]:
        return {
            "order": 2 if self.used else 1,
            "why": self.reason,
            "change_of_sigma": dict(self.change),
            "directions": self.directions,
            "analyses": self.analyses,
        }

    @property
    def words(self) -> str:
        changes = ", ".join(f"{name} {100 * by:+.0f} %" for name, by in self.change.items())
        if self.used:
            return f"second order: 1 sigma against that of the first derivatives: {changes}"
        if self.reason != NOT_DEFINITE:
            return f"first order: the second would change 1 sigma by {changes}"
        return (
            "first order, although much is left of the residual: to second order the optimum is no "
            "minimum along some direction, and 1 sigma may be far too small (a profile likelihood "
            "tells)"
        )

    @property
    def notes(self) -> list[Note]:
        """Return a note where the second order matters."""
        if not self.used and self.reason != NOT_DEFINITE:
            return []
        return [Note(SECOND_ORDER, f"the uncertainty is of {self.words}")]


def has_large_residual(problem: FitProblem, residual: Array) -> bool:
    """Return whether some residual is so large that the second order may matter."""
    return any(misfit.ratio > LARGE for misfit in misfits(problem, residual).values())


def second_order_terms(problem: FitProblem, best: Evaluation, noise: Noise) -> SecondOrderTerms:
    """Return second-order terms from differences of the slopes along the least certain directions.
    Slopes change from place to place (by differences over half of a standard deviation), and the
    norm of a block is not curved along its own residual. A direction along which no analysis ends
    well, to neither side, counts as if its slopes did not change."""
    assert best.jacobian is not None
    before = problem.analyses
    linear = LinearisedFit.of(problem, best, noise)
    along = linear.sharp[:, np.argsort(linear.curvature)[:MOST]]
    spread = np.linalg.norm(along.T @ linear.moved, axis=1)
    steps = np.clip(STEP * spread, LEAST_STEP, LARGEST_STEP)
    weighted = linear.weights**2 * best.residual
    changes = []
    known = []
    for k, (direction, step) in enumerate(zip(along.T, steps, strict=True)):
        there, way = _beside(problem, best, linear.sizes * direction * step)
        if there is None or there.jacobian is None:
            continue
        slope = (there.jacobian - best.jacobian).T @ weighted / (way * step)
        changes.append(linear.sizes * slope)
        known.append(k)
    added = np.zeros((len(linear.sizes),) * 2)
    if changes:
        v = along[:, known]
        t = np.array(changes).T
        inner = v.T @ t
        # Symmetric, and t along every direction v, which are orthonormal.
        added = t @ v.T + v @ t.T - 0.5 * v @ (inner + inner.T) @ v.T
        added = 0.5 * (added + added.T)
    # Residuals over their block's norm; zero where the block weighs by its noise.
    sizes = problem.blocks.norms(best.residual)
    is_large = sizes > problem.blocks.norms(noise.smallest_residual_sigma)
    unit = is_large / np.where(is_large, sizes, 1.0)
    left = np.asarray(best.residual * unit[problem.blocks.of])
    found = SecondOrderTerms(added, left, len(known), problem.analyses - before)
    norms = found.slopes(problem, best.jacobian * linear.sizes * linear.weights[:, None])
    blocks = norms[problem.blocks.starts]
    return replace(found, added=added - blocks.T @ blocks)


def is_definite(linear: LinearisedFit, second: SecondOrderTerms) -> bool:
    """Return whether enough curvature is left along every direction with the second order."""
    unit = linear.sharp / np.sqrt(linear.curvature)
    return bool(np.linalg.eigvalsh(unit.T @ second.added @ unit).min() > LEFT_SECOND_ORDER - 1.0)


def _beside(problem: FitProblem, best: Evaluation, step: Array) -> tuple[Evaluation | None, float]:
    """Return an allowed point a step to either side that ends well, and the side."""
    a, c = problem.unknowns.inequalities
    for way in (1.0, -1.0):
        y = best.unknowns + way * step
        if (a @ y < c - 1e-9).any():
            continue
        there = problem.evaluate(y, True)
        if there is not None:
            return there, way
    return None, 1.0


LEAST_WIDTH = 1e-3  # of the width of the bounds of a nuisance: less is none


def information(slopes: Array, sigma: Array | float, nuisance: Sequence[Nuisance] = ()) -> Array:
    """Return (n, n), the information of values on the n unknowns of the law, nuisance removed.
    It is J'J, J the slope of the values over their noise: it adds up from test to test, and its
    inverse is the covariance of the best estimate (Fisher). slopes : (m, n + nuisance). sigma :
    (m,) or one for all. nuisance : with a prior each, or known to ten times the width of its
    bounds."""
    count = slopes.shape[1] - len(nuisance)
    before = [n.prior or PRIOR * max(n.upper - n.lower, LEAST_WIDTH) for n in nuisance]
    known = np.zeros((len(nuisance), slopes.shape[1]))
    known[:, count:] = np.diag(1.0 / np.array(before))
    rows = np.concatenate([slopes / np.reshape(sigma, (-1, 1)), known])
    law = rows[:, :count]
    own = rows[:, count:]
    if len(nuisance):
        span = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
        law = law - span @ (span.T @ law)
    return np.asarray(law.T @ law)


def information_of(
    comparison: Comparison, law: HypoelasticLaw, unknowns: Unknowns
) -> tuple[Array, History]:
    """Return the information (n, n) of a comparison run with a law, and the run."""
    at_zero = {n.name: 0.0 for n in comparison.nuisance}
    history, slope = comparison.differentiate(law, unknowns.free, at_zero, warm=False)
    slope = slope * comparison.objective.scale[:, None]
    size = unknowns.size
    by_unknowns = np.hstack([slope[:, :size] @ unknowns.to_coefficients, slope[:, size:]])
    known = information(by_unknowns, comparison.objective.least_noise, comparison.nuisance)
    return known, history


def residual_of(
    problem: FitProblem, comparisons: Sequence[Comparison], best: Evaluation, law: HypoelasticLaw
) -> Array:
    """Return (m,) the residual of other models at the best unknowns; raises SolverFailure."""
    unknowns = problem.unknowns
    parts = []
    names = [comparison.name for comparison in problem.comparisons]
    ran = dict(zip(names, best.histories, strict=False))  # of known derivatives alone there is none
    for comparison in comparisons:
        nuisance = unknowns.nuisance_values(comparison.name, best.unknowns)
        history = comparison.run(law, unknowns.free, nuisance, False, ran.get(comparison.name))
        parts.append(comparison.objective.residual(history, nuisance))
    rows = np.concatenate(parts)
    own = sum(sum(c.objective.sizes) for c in problem.comparisons)
    if rows.shape != (own,) or not np.isfinite(rows).all():
        raise SolverFailure("the finer model does not give what was matched", problem.solver.name)
    return np.concatenate([rows, best.residual[own:]])  # priors are of the unknowns


@dataclass(frozen=True, eq=False)
class FineMeshLimit:
    """The limit of ever finer models.
    step : (unknowns,) from the best ones, to others within the bounds. residual : (m,) left there.
    error : (m,) at the best ones."""

    step: Array
    residual: Array
    error: Array


def limit_of(
    problem: FitProblem, best: Evaluation, finer: Array, factor: float
) -> FineMeshLimit | None:
    """Return the optimum of the limit of finer models to first order; None if the QP has no answer.
    One refinement by k of a model of second order gives c h^2 (1 - 1/k^2), so all of the error.
    finer : (m,) residual of models finer by `factor`, at the same unknowns."""
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
    weighted = best.jacobian.T * weights
    curvature = weighted @ best.jacobian
    # An unknown of which the data say nothing stays where it is.
    curvature += np.diag(1e-12 * np.diag(curvature) + 1e-14 * np.trace(curvature))
    own = problem.unknowns
    at = best.unknowns
    without, there = (
        bounded_step(own, curvature, weighted @ residual, at)
        for residual in (best.residual, best.residual + error)
    )
    if without is None or there is None:
        return None
    step = there - without
    if not own.keeps_bounds(at + step):  # the nearest that does, in the metric of the fit
        nearest = bounded_step(own, curvature, -curvature @ step, at)
        if nearest is None:
            return None
        step = nearest
    return FineMeshLimit(step, best.residual + error + best.jacobian @ step, error)
