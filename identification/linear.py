"""A fit near its optimum: what its data say of its unknowns, by its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .noise import Noise
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

Array = NDArray[np.float64]

#: Of the largest curvature of the misfit: below, the data say nothing of a direction.
FLAT = 1e-13
#: Of the largest norm of a block: smaller ones weigh no more than this one does.
SMALLEST = 1e-6


@dataclass(frozen=True, eq=False)
class Second:
    """What the sum of the blocks' norms has of second order beside the squares of its slopes.

    Parameters
    ----------
    added : (unknowns, unknowns) in the sizes of a `Linear`, to half of the curvature of the
        weighted sum of squares. left : (m,) the residual of each block over its norm, zero where
        the block's weight is its noise's: along it a norm is not curved, and noise along it does
        not turn its slope. directions, analyses : with how many it was found.
    """

    added: Array
    left: Array
    directions: int
    analyses: int

    def slopes(self, problem: FitProblem, jacobian: Array) -> Array:
        """(m, unknowns) slope of each residual's block along what is left of it."""
        blocks = problem.blocks
        return np.asarray(np.add.reduceat(self.left[:, None] * jacobian, blocks.starts)[blocks.of])


@dataclass(frozen=True, eq=False)
class Linear:
    """A fit near its optimum: least squares, in which every block weighs the inverse of its norm.

    Parameters
    ----------
    sizes : (unknowns,) in which they are counted. weights : (m,) roots of the weights of the
        squares. sharp, flat : (unknowns, some) directions of which the data say something, and
        nothing. curvature : (sharp,) of half the weighted sum of squares along the former, by the
        first derivatives.
        estimator : (unknowns, m) from weighted residuals to what they move the unknowns by, less
        the sign. moved : (unknowns, m) the same of the noise of each residual.
    """

    sizes: Array
    weights: Array
    sharp: Array
    flat: Array
    curvature: Array
    estimator: Array
    moved: Array

    @classmethod
    def of(
        cls, problem: FitProblem, best: Evaluation, noise: Noise, second: Second | None = None
    ) -> Linear:
        """At the optimum, evaluated with its Jacobian; second : with what is of second order."""
        assert best.jacobian is not None
        weights = np.sqrt(weights_of(problem, best.residual, noise))
        sizes = sizes_of(problem.unknowns, best.unknowns)
        j = best.jacobian * sizes * weights[:, None]
        curvature, directions = np.linalg.eigh(j.T @ j)
        good = curvature > FLAT * curvature[-1]
        sharp, flat = directions[:, good], directions[:, ~good]
        whole, answering = np.diag(curvature[good]), j
        if second is not None:
            whole = whole + sharp.T @ second.added @ sharp
            answering = j - second.left[:, None] * second.slopes(problem, j)
        estimator, answer = (
            sharp @ np.linalg.solve(whole, sharp.T @ one.T) for one in (j, answering)
        )
        moved = answer * (weights * noise.rows)
        return cls(sizes, weights, sharp, flat, curvature[good], estimator, moved)

    def spread_over_curvature(self, row: Array) -> float:
        """Of one number, row @ unknowns: its variance over that of weighted squares of noise one.

        By so much a weighted sum of squares grows too fast along it for a likelihood ratio (J. T.
        Kent, Robust properties of likelihood ratio tests, Biometrika 69, 1982). Not a number where
        the data say nothing of it.
        """
        scaled = row * self.sizes
        along = self.sharp.T @ scaled
        curved = float(along**2 @ (1.0 / self.curvature))
        return float(np.sum((scaled @ self.moved) ** 2)) / curved if curved > 0 else np.nan


def weights_of(problem: FitProblem, residual: Array, noise: Noise) -> Array:
    """(m,) of the squares of the residuals, near the least sum of the norms of their blocks."""
    blocks = problem.blocks
    norms = np.maximum(blocks.norms(residual), blocks.norms(noise.least))
    largest = norms.max()
    if not largest > 0:
        return np.ones_like(residual)
    return np.asarray(1.0 / np.maximum(norms, SMALLEST * largest)[blocks.of])


def sizes_of(unknowns: Unknowns, best: Array) -> Array:
    """(unknowns,) what each is large or small beside: itself, or the width of its bounds."""
    lower, upper = unknowns.nuisance.bounds
    law = np.abs(best[: unknowns.size])
    return np.concatenate([np.maximum(law, 1e-3), np.maximum(upper - lower, 1e-3)])
