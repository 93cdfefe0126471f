"""Linearise a fit at its optimum: what noise, meshes and second-order terms make of the unknowns.

The objective is the sum of the norms of residual blocks. Near its optimum, minimising it is least
squares with the squares of each block weighted by the inverse of the block's norm; the noise of the
data is propagated through this estimate. The same derivatives tell how far the optimum lies from
that of ever finer meshes, and which information the data of a further test would have. Where much
is left of the residual, finite differences of the Jacobian add terms of second order.

References
----------
R. A. Fisher, Theory of statistical estimation, Proc. Camb. Philos. Soc. 22 (1925) 700. J. T. Kent,
Robust properties of likelihood ratio tests, Biometrika 69 (1982) 19.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import SolverFailure
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind
from ..processes import copies_for
from ..solvers.base import History
from .comparison import Comparison, run_tasks_of
from .descent import MIN_BLOCK_NORM, bounded_step, with_small_diagonal
from .noise import Noise, misfits
from .nuisance import Nuisance
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """A fit near its optimum as least squares, every block weighted by the inverse of its norm.

    Attributes
    ----------
    sizes : (unknowns,) array
        Size of each unknown; all other arrays are for unknowns divided by it.
    weights : (m,) array
        Square roots of the weights of the squares.
    sharp, undetermined : (unknowns, directions) arrays
        Orthonormal directions that the data determine, and those that they do not.
    curvature : (sharp,) array
        Second derivative of half the weighted sum of squares along each determined direction.
    inverse : (unknowns, unknowns) array
        Inverse of that derivative, zero along undetermined directions.
    jacobian, response_slopes : (m, unknowns) arrays
        Derivatives of the weighted residuals, and those of what noise changes of them.
    noise : Noise
    """

    sizes: Array
    weights: Array
    sharp: Array
    undetermined: Array
    curvature: Array
    inverse: Array
    jacobian: Array
    response_slopes: Array
    noise: Noise

    @property
    def response(self) -> Array:
        """Return the change of the unknowns by each residual, (unknowns, m)."""
        return (self.inverse @ self.response_slopes.T) * self.weights

    @cached_property
    def noise_response(self) -> Array:
        """Return the changes of the unknowns by one standard deviation of errors.

        They are (unknowns, m + k): of the noise of each residual, and of each of the k errors that
        many residuals share.
        """
        return self.noise.propagated(self.response)

    @property
    def covariance(self) -> Array:
        """Return the covariance of the unknowns, with `PRIOR` where the data say nothing."""
        by_noise = self.noise_response @ self.noise_response.T
        scaled = by_noise + PRIOR**2 * self.undetermined @ self.undetermined.T
        return np.asarray(scaled * self.sizes[:, None] * self.sizes)

    @classmethod
    def of(
        cls,
        problem: FitProblem,
        best: Evaluation,
        noise: Noise,
        second: SecondOrderTerms | None = None,
    ) -> LinearisedFit:
        """Linearise a fit.

        Parameters
        ----------
        problem : FitProblem
        best : Evaluation
            The optimum, with its Jacobian.
        noise : Noise
        second : SecondOrderTerms, optional
        """
        assert best.jacobian is not None
        weights = np.sqrt(weights_of(problem, best.residual, noise))
        sizes = sizes_of(problem.unknowns, best.unknowns)
        jacobian = best.jacobian * sizes * weights[:, None]
        curvature, directions = np.linalg.eigh(
            problem.blocks.gram(jacobian, np.ones(len(problem.blocks.sizes)))
        )
        is_determined = curvature > 1e-13 * curvature[-1]  # else the data say nothing of it
        sharp = directions[:, is_determined]
        full_curvature = np.diag(curvature[is_determined])
        response_slopes = jacobian
        if second is not None:
            full_curvature = full_curvature + sharp.T @ second.hessian_term @ sharp
            block_slopes = second.slopes(problem, jacobian)
            response_slopes = jacobian - second.unit_residual[:, None] * block_slopes
        return cls(
            sizes,
            weights,
            sharp,
            undetermined=directions[:, ~is_determined],
            curvature=curvature[is_determined],
            inverse=sharp @ np.linalg.inv(full_curvature) @ sharp.T,
            jacobian=jacobian,
            response_slopes=response_slopes,
            noise=noise,
        )

    def spread_over_curvature(self, row: Array) -> float:
        """Return the variance of a number over what the weighted squares' curvature would give.

        The weighted sum of squares grows faster than -2 log of a likelihood by this factor as the
        number leaves its best value (Kent 1982). NaN where the data do not determine the number.

        Parameters
        ----------
        row : (unknowns,) array
            Coefficients of the number, which is row @ unknowns.
        """
        scaled = row * self.sizes
        along_sharp = self.sharp.T @ scaled
        by_curvature = float(along_sharp**2 @ (1.0 / self.curvature))
        if not by_curvature > 0:
            return np.nan
        return float(np.sum((scaled @ self.noise_response) ** 2)) / by_curvature


def weights_of(problem: FitProblem, residual: Array, noise: Noise) -> Array:
    """Return weights that make a sum of squares behave as the sum of block norms does.

    A block weighs by the inverse of the norm of its residual, or of its noise if that is larger:
    for each prior that of its own, as unknowns that the data leave open add none to the residual.

    Parameters
    ----------
    problem : FitProblem
    residual : (m,) array
    noise : Noise

    Returns
    -------
    (m,) array
    """
    blocks = problem.blocks
    of_noise = blocks.norms(noise.smallest_residual_sigma)[blocks.block_of]
    first_prior = len(residual) - len(problem.unknowns.nuisance.priors[0])
    of_noise[first_prior:] = noise.smallest_residual_sigma[first_prior:]
    norms = np.maximum(blocks.norms(residual), blocks.least_norms)[blocks.block_of]
    norms = np.maximum(norms, of_noise)
    largest = norms.max()
    if not largest > 0:
        return np.ones_like(residual)
    return 1.0 / np.maximum(norms, MIN_BLOCK_NORM * largest)


def sizes_of(unknowns: Unknowns, best: Array) -> Array:
    """Return the size of each unknown, by which it is divided to be of order one.

    An unknown of the law is its own size; that of a nuisance parameter is the width of its bounds.

    Parameters
    ----------
    unknowns : Unknowns
    best : (unknowns,) array
        Values at the optimum.

    Returns
    -------
    (unknowns,) array
    """
    lower, upper = unknowns.nuisance.bounds
    law_sizes = np.abs(best[: unknowns.size])
    return np.concatenate([np.maximum(law_sizes, 1e-3), np.maximum(upper - lower, 1e-3)])


def posteriors_of(
    problem: FitProblem,
    best: Evaluation,
    noise: Noise,
    limit: FineMeshLimit | None = None,
    second: SecondOrderTerms | None = None,
) -> tuple[Posterior, Posterior | None]:
    """Return the posterior from the noise alone, and that about the limit of ever finer meshes.

    A block that is fitted better than its noise allows weighs by the norm of the noise; a direction
    that the data do not determine has the relative standard deviation `PRIOR`.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum, with its Jacobian.
    noise : Noise
    limit : FineMeshLimit, optional
    second : SecondOrderTerms, optional

    Returns
    -------
    Posterior
        About the optimum.
    Posterior or None
        About the limit of finer models; its covariance includes the model error that may be left.
        None without `limit`.
    """
    linear = LinearisedFit.of(problem, best, noise, second)
    sizes = linear.sizes

    # The mean without bounds follows from the objective alone, so its weights leave out the noise.
    noiseless = replace(noise, smallest_residual_sigma=np.zeros_like(best.residual))
    exact = LinearisedFit.of(problem, best, noiseless, second)

    def centre(residual: Array) -> Array:
        change = exact.inverse @ (exact.jacobian.T @ (exact.weights * residual))
        return best.unknowns - sizes * change

    posterior = Posterior(problem.unknowns, best.unknowns, centre(best.residual), linear.covariance)
    if limit is None:
        return posterior, None
    return posterior, posterior.shifted(
        limit.step, centre(best.residual + limit.error), MESH_ERROR_LEFT
    )


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

    def residual_at(number: int, _: None = None) -> Array | SolverFailure:
        comparison = comparisons[number]
        nuisance = unknowns.nuisance_values(comparison.name, best.unknowns)
        coarse_run = coarse_runs.get(comparison.name)
        try:
            history = comparison.run(law, unknowns.free, nuisance, False, coarse_run)
        except SolverFailure as failure:
            return failure
        return comparison.objective.residual(history, nuisance)

    copies = None
    if all(comparison.may_run_aside for comparison in comparisons):
        # Finer models take as long as the others do, in proportion.
        seconds = {comparison.name: comparison.seconds for comparison in problem.comparisons}
        copies = copies_for(residual_at, [seconds.get(c.name, 0.0) for c in comparisons])
    count = len(comparisons)
    runs = map(residual_at, range(count)) if copies is None else copies.run([None] * count)
    residuals = []
    for run in runs:
        if isinstance(run, SolverFailure):
            raise run
        residuals.append(run)
    residual = np.concatenate(residuals)
    size = sum(sum(comparison.objective.sizes) for comparison in problem.comparisons)
    if residual.shape != (size,) or not np.isfinite(residual).all():
        raise SolverFailure("the finer model does not give what was matched", problem.solver.name)
    return np.concatenate([residual, best.residual[size:]])  # priors are of the unknowns


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
    norms = np.maximum(blocks.norms(best.residual), blocks.least_norms)
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


PRIOR = 10.0  # relative standard deviation of a modulus of which the data say nothing
#: Mesh error that may be left after extrapolation to ever finer meshes, as a share of the step of
#: the extrapolation (one standard deviation): with data without noise, a mesh of 432 quads leaves
#: 6 to 12 % of what it moves the moduli by (benchmarks/bench_bands.py bias).
MESH_ERROR_LEFT = 0.1


@dataclass(frozen=True, eq=False)
class SecondOrderTerms:
    """Hold what a Gauss-Newton Hessian leaves out of that of the objective, a sum of block norms.

    Attributes
    ----------
    hessian_term : (unknowns, unknowns) array
        To be added to half of the Hessian of the weighted sum of squares, for unknowns counted in
        the `sizes` of a `LinearisedFit`.
    unit_residual : (m,) array
        The residual over the norm of its block; zero in a block that weighs by its noise. Along
        this direction the norm of a block has no curvature.
    directions : int
        Number of directions in which slopes were differenced.
    analyses : int
        Number of analyses that this took.
    """

    hessian_term: Array
    unit_residual: Array
    directions: int
    analyses: int

    def slopes(self, problem: FitProblem, jacobian: Array) -> Array:
        """Return for each residual the derivative of its block's norm, (m, unknowns).

        Parameters
        ----------
        problem : FitProblem
        jacobian : (m, unknowns) array
            Derivatives of the residuals.
        """
        blocks = problem.blocks
        along_residual = self.unit_residual[:, None] * jacobian
        return np.add.reduceat(along_residual, blocks.starts)[blocks.block_of]


SECOND_ORDER = NoteKind("second order")
LARGE_MISFIT = 2.0  # residual over the noise from which on second-order terms may matter
WORTHWHILE_CHANGE = 0.1  # least relative change of a modulus' sigma for which they are used

# Why the second order is not used.
NOT_DEFINITE = "not positive definite"
TOO_LITTLE = "too little changes"


@dataclass(frozen=True)
class SecondOrderSettings:
    """Settings of the finite differences of the Jacobian."""

    max_directions: int = 8  # number of directions, the least certain ones, an analysis each
    step_sigmas: float = 0.5  # length of a step, in standard deviations
    min_step: float = 1e-3  # least length of a step, relative to the sizes of the unknowns
    max_step: float = 0.05  # largest length, likewise
    #: Share of the first-order curvature that must be left along every direction with second-order
    #: terms, for these to be used.
    min_curvature: float = 0.05


DEFAULT_SETTINGS = SecondOrderSettings()


@dataclass(frozen=True)
class UncertaintyOrder:
    """Tell whether the uncertainty of a fit is of first or of second order, and the reason.

    Attributes
    ----------
    used : bool
        Whether second-order terms are used.
    reason : str
        "" if they are, else NOT_DEFINITE or TOO_LITTLE.
    change : mapping of float
        Largest relative change of each modulus' sigma by second-order terms; empty where they do
        not give one (NOT_DEFINITE).
    directions, analyses : int
        Number of directions that were differenced, and of analyses for it.
    """

    used: bool
    reason: str
    change: Mapping[str, float]
    directions: int
    analyses: int

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the order as it is written to `result.json`."""
        return {
            "order": 2 if self.used else 1,
            "why": self.reason,
            "change_of_sigma": dict(self.change),
            "directions": self.directions,
            "analyses": self.analyses,
        }

    @property
    def words(self) -> str:
        """Return the order and its reason in words."""
        changes = ", ".join(f"{name} {100 * change:+.0f} %" for name, change in self.change.items())
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
    """Return whether a residual is so large that the second order may matter.

    Parameters
    ----------
    problem : FitProblem
    residual : (m,) array
    """
    return any(misfit.ratio > LARGE_MISFIT for misfit in misfits(problem, residual).values())


def second_order_terms(
    problem: FitProblem,
    best: Evaluation,
    noise: Noise,
    settings: SecondOrderSettings = DEFAULT_SETTINGS,
) -> SecondOrderTerms:
    """Compute second-order terms from differences of the Jacobian along uncertain directions.

    The Jacobian is differenced over a step of `settings.step_sigmas` standard deviations. The terms
    also take off the curvature along each block's own residual, where a norm has none. A direction
    with no successful analysis on either side counts as if the Jacobian did not change along it.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum, with its Jacobian.
    noise : Noise
    settings : SecondOrderSettings
    """
    assert best.jacobian is not None
    previous_analyses = problem.analyses
    linear = LinearisedFit.of(problem, best, noise)
    directions, changes = _slope_changes(problem, best, linear, settings)
    added = _symmetric(directions, changes)
    # Residuals over their block's norm; zero where the block weighs by its noise.
    norms = problem.blocks.norms(best.residual)
    smallest = problem.blocks.norms(noise.smallest_residual_sigma)
    is_large = norms > np.maximum(smallest, problem.blocks.least_norms)
    inverse_norms = is_large / np.where(is_large, norms, 1.0)
    unit_residual = best.residual * inverse_norms[problem.blocks.block_of]
    analyses = problem.analyses - previous_analyses
    terms = SecondOrderTerms(added, unit_residual, directions.shape[1], analyses)
    slopes = terms.slopes(problem, best.jacobian * linear.sizes * linear.weights[:, None])
    block_slopes = slopes[problem.blocks.starts]
    return replace(terms, hessian_term=added - block_slopes.T @ block_slopes)


def _slope_changes(
    problem: FitProblem,
    best: Evaluation,
    linear: LinearisedFit,
    settings: SecondOrderSettings,
) -> tuple[Array, Array]:
    """Return directions (unknowns, k), and the second-order term (unknowns, k) along each.

    It is the change of J'Wr by that of the Jacobian J alone, per unit of the direction, with r the
    residual and W the weights of its squares.
    """
    assert best.jacobian is not None
    least_certain = np.argsort(linear.curvature)[: settings.max_directions]
    directions = linear.sharp[:, least_certain]
    sigma = np.linalg.norm(directions.T @ linear.noise_response, axis=1)
    steps = np.clip(settings.step_sigmas * sigma, settings.min_step, settings.max_step)
    weighted = linear.weights**2 * best.residual
    jacobian = best.jacobian
    states = [comparison.state for comparison in problem.comparisons]
    previous_analyses = problem.analyses

    def change_along(number: int) -> tuple[Array | None, int]:
        """Return the change along a direction, None where it is not known, and the analyses."""
        analyses = problem.analyses
        for comparison, state in zip(problem.comparisons, states, strict=True):
            comparison.state = state  # each direction begins alike, whatever was run before it
        step = linear.sizes * directions[:, number] * steps[number]
        neighbour, sign = _neighbour(problem, best, step)
        if neighbour is None or neighbour.jacobian is None:
            return None, problem.analyses - analyses
        slope = (neighbour.jacobian - jacobian).T @ weighted / (sign * steps[number])
        return linear.sizes * slope, problem.analyses - analyses

    changes = run_tasks_of(problem.comparisons, change_along, directions.shape[1])
    problem.analyses = previous_analyses + sum(analyses for _, analyses in changes)
    for comparison, state in zip(problem.comparisons, states, strict=True):
        comparison.state = state
    differentiated = [k for k, (change, _) in enumerate(changes) if change is not None]
    if not differentiated:
        empty = np.zeros((len(linear.sizes), 0))
        return empty, empty
    terms = np.array([change for change, _ in changes if change is not None])
    return directions[:, differentiated], terms.T


def _symmetric(directions: Array, changes: Array) -> Array:
    """Return the symmetric matrix (n, n) that gives the changes (n, k) along the directions.

    The directions (n, k) are orthonormal.
    """
    count, direction_count = directions.shape
    if not direction_count:
        return np.zeros((count, count))
    v = directions
    t = changes
    inner = v.T @ t
    matrix = t @ v.T + v @ t.T - 0.5 * v @ (inner + inner.T) @ v.T
    return 0.5 * (matrix + matrix.T)


def is_definite(linear: LinearisedFit, second: SecondOrderTerms) -> bool:
    """Return whether enough curvature is left along every direction with second-order terms.

    Parameters
    ----------
    linear : LinearisedFit
        The fit to first order.
    second : SecondOrderTerms
    """
    unit = linear.sharp / np.sqrt(linear.curvature)
    smallest = np.linalg.eigvalsh(unit.T @ second.hessian_term @ unit).min()
    return bool(smallest > DEFAULT_SETTINGS.min_curvature - 1.0)


def _neighbour(
    problem: FitProblem, best: Evaluation, step: Array
) -> tuple[Evaluation | None, float]:
    """Evaluate an allowed point a step to one side or the other; return it and the side's sign."""
    rows, limits = problem.unknowns.inequalities
    for sign in (1.0, -1.0):
        y = best.unknowns + sign * step
        if (rows @ y < limits - 1e-9).any():
            continue
        neighbour = problem.evaluate(y, True)
        if neighbour is not None:
            return neighbour, sign
    return None, 1.0


MIN_WIDTH = 1e-3  # least distance that counts between the bounds of a nuisance, in its unit


def information(slopes: Array, sigma: Array | float, nuisance: Sequence[Nuisance] = ()) -> Array:
    """Return the Fisher information of measured values on the unknowns of the law.

    It is J'J, with J the derivatives of the values over their noise, less what they share with the
    nuisance parameters. It adds up from test to test, and its inverse is the covariance of the best
    estimate.

    Parameters
    ----------
    slopes : (m, n + nuisance) array
        Derivatives of the values by the n unknowns of the law, then by the nuisance parameters.
    sigma : (m,) array or float
        Standard deviation of the noise of each value, in the unit of the values.
    nuisance : sequence of Nuisance
        Each counts as known beforehand to its prior, or to `PRIOR` times the width of its bounds.

    Returns
    -------
    (n, n) array
    """
    count = slopes.shape[1] - len(nuisance)
    prior_sigma = [n.prior or PRIOR * max(n.upper - n.lower, MIN_WIDTH) for n in nuisance]
    prior_rows = np.zeros((len(nuisance), slopes.shape[1]))
    prior_rows[:, count:] = np.diag(1.0 / np.array(prior_sigma))
    rows = np.concatenate([slopes / np.reshape(sigma, (-1, 1)), prior_rows])
    law_columns = rows[:, :count]
    nuisance_columns = rows[:, count:]
    if len(nuisance):
        unit = nuisance_columns / np.linalg.norm(nuisance_columns, axis=0)
        span = np.linalg.qr(unit)[0]
        law_columns = law_columns - span @ (span.T @ law_columns)
    return law_columns.T @ law_columns


def information_of(
    comparison: Comparison,
    law: HypoelasticLaw,
    unknowns: Unknowns,
    best: Array | None = None,
) -> tuple[Array, History]:
    """Run a comparison with a law, and return its Fisher information on what tests share.

    These are the unknowns of the law, then those of all tests, such as an unknown thickness.

    Parameters
    ----------
    comparison : Comparison
    law : HypoelasticLaw
    unknowns : Unknowns
    best : (unknowns,) array, optional
        Values of the unknowns of all tests; by default they are at their start.

    Returns
    -------
    (shared, shared) array
        The information.
    History
        The run.
    """
    size = unknowns.size
    names = [nuisance.name for nuisance in unknowns.nuisance.shared]
    values = {nuisance.name: nuisance.start for nuisance in comparison.nuisance}
    if best is not None:
        shared = zip(names, best[size:].tolist(), strict=False)
        values |= {name: value for name, value in shared if name in values}
    history, slope = comparison.differentiate(law, unknowns.free, values, warm=False)
    slope = slope * comparison.objective.scale[:, None]
    columns = dict(zip(values, slope.T[size:], strict=True))
    by_shared = [columns.pop(name, np.zeros(len(slope))) for name in names]
    by_law = slope[:, :size] @ unknowns.to_coefficients
    separate = [nuisance for nuisance in comparison.nuisance if nuisance.name in columns]
    by_unknowns = np.column_stack([by_law, *by_shared, *columns.values()])
    return information(by_unknowns, comparison.objective.least_noise, separate), history
