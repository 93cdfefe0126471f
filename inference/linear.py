"""Linearise a fit at its optimum, and propagate the noise of its data to the unknowns.

The objective is the sum of the norms of residual blocks. Near its optimum, minimising it is least
squares with the squares of each block weighted by the inverse of the block's norm; the noise of the
data is propagated through this estimate.

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
    estimator : (unknowns, m) array
        Matrix whose product with weighted residuals is minus the change of the unknowns by them.
    noise_response : (unknowns, m + k) array
        Change of the unknowns by one standard deviation of the noise of each residual, and of each
        of the k errors that many residuals share.
    """

    sizes: Array
    weights: Array
    sharp: Array
    undetermined: Array
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
            full_curvature = full_curvature + sharp.T @ second.hessian_term @ sharp
            block_slopes = second.slopes(problem, jacobian)
            response_slopes = jacobian - second.unit_residual[:, None] * block_slopes
        inverse = sharp @ np.linalg.inv(full_curvature) @ sharp.T
        response = (inverse @ response_slopes.T) * weights
        return cls(
            sizes,
            weights,
            sharp,
            undetermined=directions[:, ~is_determined],
            curvature=curvature[is_determined],
            estimator=inverse @ jacobian.T,
            noise_response=noise.propagated(response),
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

    A block weighs by the inverse of the norm of its residual, or of its noise if that is larger.

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
    norms = np.maximum(norms, blocks.least_norms)
    largest = norms.max()
    if not largest > 0:
        return np.ones_like(residual)
    return 1.0 / np.maximum(norms, MIN_BLOCK_NORM * largest)[blocks.block_of]


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
    response = linear.noise_response
    scaled = response @ response.T + PRIOR**2 * linear.undetermined @ linear.undetermined.T
    covariance = scaled * sizes[:, None] * sizes

    # The mean without bounds follows from the objective alone, so its weights leave out the noise.
    noiseless = replace(noise, smallest_residual_sigma=np.zeros_like(best.residual))
    exact = LinearisedFit.of(problem, best, noiseless, second)

    def centre(residual: Array) -> Array:
        return best.unknowns - sizes * (exact.estimator @ (exact.weights * residual))

    posterior = Posterior(problem.unknowns, best.unknowns, centre(best.residual), covariance)
    if limit is None:
        return posterior, None
    return posterior, posterior.shifted(
        limit.step, centre(best.residual + limit.error), MESH_ERROR_LEFT
    )
