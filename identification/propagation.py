"""From the noise of the data to the unknowns of a fit and the moduli: by its derivatives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import COMPONENTS, modulus_rows
from ..materials.law import HypoelasticLaw
from .discretisation import Limit
from .noise import Noise
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

Array = NDArray[np.float64]

#: Strains at which a modulus is looked at.
POINTS = 61
#: Relative uncertainty of a modulus of which nothing is known.
PRIOR = 10.0
#: Of the largest curvature of the misfit: below, the data say nothing of a direction.
FLAT = 1e-13
#: Of the step to the limit of finer models, what may be left of it (one standard deviation): with
#: data without noise, a mesh of 432 quads leaves 6 to 12 % of what it moves the moduli by
#: (benchmarks/bench_bias.py).
LEFT = 0.1
#: Of the largest norm of a block: smaller ones weigh no more than this one does.
SMALLEST = 1e-6


def posteriors_of(
    problem: FitProblem, best: Evaluation, noise: Noise, limit: Limit | None = None
) -> tuple[Posterior, Posterior | None]:
    """The unknowns as the noise leaves them, to first order, and those of ever finer models.

    The second have what may be left of the model's error in their covariance, too; None where
    the limit is not known.

    A fit makes the sum of the norms of its blocks small: near its optimum it is a least squares
    fit in which every block weighs the inverse of its norm, and it is that estimate which the
    noise moves. A block that is fitted better than its noise allows has the norm of the noise.
    A direction of which the data say nothing is as uncertain as a modulus of which nothing is
    known.
    """
    assert best.jacobian is not None
    weights = np.sqrt(weights_of(problem, best.residual, noise))
    sizes = sizes_of(problem.unknowns, best.unknowns)
    j = best.jacobian * sizes * weights[:, None]
    curvature, directions = np.linalg.eigh(j.T @ j)
    good = curvature > FLAT * curvature[-1]
    sharp, flat = directions[:, good], directions[:, ~good]
    estimator = (sharp / curvature[good]) @ sharp.T @ j.T
    moved = estimator * (weights * noise.rows)
    scaled = moved @ moved.T + PRIOR**2 * flat @ flat.T
    covariance = np.asarray(scaled * sizes[:, None] * sizes)

    def centre(residual: Array) -> Array:
        return np.asarray(best.unknowns - sizes * (estimator @ (weights * residual)))

    own = Posterior(problem.unknowns, best.unknowns, centre(best.residual), covariance)
    if limit is None:
        return own, None
    return own, own.moved(limit.step, centre(best.residual + limit.error), LEFT)


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


def moduli_of(unknowns: Unknowns, y: Array, strains: Mapping[str, Array]) -> dict[str, Array]:
    """(n,) MPa by modulus at strains (n,), of the law at unknowns y."""
    coefficients = unknowns.to_coefficients @ y[: unknowns.size]
    rows = {
        name: modulus_rows(unknowns.form, name, strain, unknowns.strain_range)
        for name, strain in strains.items()
    }
    return {name: own[:, list(unknowns.free)] @ coefficients for name, own in rows.items()}


def along(
    unknowns: Unknowns, law: HypoelasticLaw, reached: Array, covariance: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Strains and 1-sigma relative uncertainty of each modulus, from that of the unknowns."""
    p, size = unknowns, unknowns.size
    moved = p.to_coefficients @ covariance[:size, :size] @ p.to_coefficients.T
    strains, sigmas = {}, {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, reached[component], POINTS)
        rows = modulus_rows(p.form, name, strain, p.strain_range)[:, list(p.free)]
        sigma = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", rows, moved, rows), 0.0))
        strains[name], sigmas[name] = strain, sigma / law.modulus(name, strain)
    return strains, sigmas
