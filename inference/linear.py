"""Linearise a fit at its optimum, and propagate the noise of its data to the unknowns.

Near its optimum a fit of the sum of the norms of its blocks is a least squares fit in which every
block weighs the inverse of its norm, and it is that estimate which the noise moves.

References
----------
J. T. Kent, Robust properties of likelihood ratio tests, Biometrika 69 (1982) 19.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..materials.forms.base import Array
from .descent import MIN_BLOCK_NORM
from .mesh_limit import FineMeshLimit
from .noise import Noise
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

PRIOR = 10.0  # relative uncertainty of a modulus of which nothing is known
#: Of the step to the limit of finer models, what may be left of it (one standard deviation): with
#: data without noise, a mesh of 432 quads leaves 6 to 12 % of what it moves the moduli by
#: (benchmarks/bench_bands.py bias).
MESH_ERROR_LEFT = 0.1


@dataclass(frozen=True, eq=False)
class SecondOrderTerms:
    """Second-order terms of the sum of the blocks' norms beside the squares of its slopes.

    Attributes
    ----------
    added : (unknowns, unknowns) array
        Added to half of the curvature of the weighted sum of squares, in the sizes of a
        `LinearisedFit`.
    unit_residual : (m,) array
        The residual over the norm of its block; zero where the weight of the block is that of its
        noise. Along it a norm is not curved.
    directions : int
        Number of directions that were looked at.
    analyses : int
    """

    added: Array
    unit_residual: Array
    directions: int
    analyses: int

    def slopes(self, problem: FitProblem, jacobian: Array) -> Array:
        """Return (m, unknowns), the slope of each residual's block along its residual."""
        blocks = problem.blocks
        along_residual = self.unit_residual[:, None] * jacobian
        return np.asarray(np.add.reduceat(along_residual, blocks.starts)[blocks.of])


@dataclass(frozen=True, eq=False)
class LinearisedFit:
    """A fit near its optimum as least squares, every block weighted by the inverse of its norm.

    Attributes
    ----------
    sizes : (unknowns,) array
        In which the unknowns are counted.
    weights : (m,) array
        Roots of the weights of the squares.
    sharp, flat : (unknowns, directions) arrays
        Directions that the data determine, and those that they do not.
    curvature : (sharp,) array
        Of half the weighted sum of squares.
    estimator : (unknowns, m) array
        From weighted residuals to minus the change of the unknowns.
    noise_response : (unknowns, m) array
        Change of the unknowns by one standard deviation of the noise of each residual.
    """

    sizes: Array
    weights: Array
    sharp: Array
    flat: Array
    curvature: Array
    estimator: Array
    noise_response: Array

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
        curvature, directions = np.linalg.eigh(jacobian.T @ jacobian)
        is_determined = curvature > 1e-13 * curvature[-1]  # else the data say nothing of it
        sharp = directions[:, is_determined]
        full_curvature = np.diag(curvature[is_determined])
        response_slopes = jacobian
        if second is not None:
            full_curvature = full_curvature + sharp.T @ second.added @ sharp
            block_slopes = second.slopes(problem, jacobian)
            response_slopes = jacobian - second.unit_residual[:, None] * block_slopes
        inverse = sharp @ np.linalg.inv(full_curvature) @ sharp.T
        response = inverse @ response_slopes.T
        return cls(
            sizes,
            weights,
            sharp,
            flat=directions[:, ~is_determined],
            curvature=curvature[is_determined],
            estimator=inverse @ jacobian.T,
            noise_response=response * (weights * noise.residual_sigma),
        )

    def spread_over_curvature(self, row: Array) -> float:
        """Return the variance of row @ unknowns over that of weighted squares of unit noise.

        So much too fast these grow along it for a likelihood ratio (Kent 1982). NaN where the data
        do not determine it.

        Parameters
        ----------
        row : (unknowns,) array
        """
        scaled = row * self.sizes
        along_sharp = self.sharp.T @ scaled
        by_curvature = float(along_sharp**2 @ (1.0 / self.curvature))
        if not by_curvature > 0:
            return np.nan
        return float(np.sum((scaled @ self.noise_response) ** 2)) / by_curvature


def weights_of(problem: FitProblem, residual: Array, noise: Noise) -> Array:
    """Return weights of the squares near the least sum of the norms of their blocks.

    A block weighs the inverse of the norm of its residual, or of its noise, if that is larger.

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
    norms = np.maximum(blocks.norms(residual), blocks.norms(noise.smallest_residual_sigma))
    largest = norms.max()
    if not largest > 0:
        return np.ones_like(residual)
    return np.asarray(1.0 / np.maximum(norms, MIN_BLOCK_NORM * largest)[blocks.of])


def sizes_of(unknowns: Unknowns, best: Array) -> Array:
    """Return the size of each unknown, in which it is counted.

    Parameters
    ----------
    unknowns : Unknowns
    best : (unknowns,) array
        Values of the law are their own size; nuisance has the width of its bounds.

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
    """Return the posterior from the noise, and that of ever finer models.

    A block that is fitted better than its noise allows has the norm of the noise; a direction
    without data is as uncertain as `PRIOR`.

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
    response = linear.noise_response
    scaled = response @ response.T + PRIOR**2 * linear.flat @ linear.flat.T
    covariance = np.asarray(scaled * sizes[:, None] * sizes)

    # The noise makes no other optimum: what pulls at the best fit is weighted as in the objective.
    noiseless = replace(noise, smallest_residual_sigma=np.zeros_like(best.residual))
    exact = LinearisedFit.of(problem, best, noiseless, second)

    def centre(residual: Array) -> Array:
        return np.asarray(best.unknowns - sizes * (exact.estimator @ (exact.weights * residual)))

    posterior = Posterior(problem.unknowns, best.unknowns, centre(best.residual), covariance)
    if limit is None:
        return posterior, None
    return posterior, posterior.shifted(
        limit.step, centre(best.residual + limit.error), MESH_ERROR_LEFT
    )
