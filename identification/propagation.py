"""From the noise of the data to the unknowns of a fit and the moduli: by its derivatives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import COMPONENTS, modulus_rows
from ..materials.law import HypoelasticLaw
from .discretisation import Limit
from .linear import Linear, Second
from .noise import Noise
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

Array = NDArray[np.float64]

#: Strains at which a modulus is looked at.
POINTS = 61
#: Relative uncertainty of a modulus of which nothing is known.
PRIOR = 10.0
#: Of the step to the limit of finer models, what may be left of it (one standard deviation): with
#: data without noise, a mesh of 432 quads leaves 6 to 12 % of what it moves the moduli by
#: (benchmarks/bench_bias.py).
LEFT = 0.1


def posteriors_of(
    problem: FitProblem,
    best: Evaluation,
    noise: Noise,
    limit: Limit | None = None,
    second: Second | None = None,
) -> tuple[Posterior, Posterior | None]:
    """The unknowns as the noise leaves them, to first order, and those of ever finer models.

    second : as for `Linear.of`: to second order.

    The second have what may be left of the model's error in their covariance, too; None where
    the limit is not known.

    A fit makes the sum of the norms of its blocks small: near its optimum it is a least squares
    fit in which every block weighs the inverse of its norm, and it is that estimate which the
    noise moves. A block that is fitted better than its noise allows has the norm of the noise.
    A direction of which the data say nothing is as uncertain as a modulus of which nothing is
    known.
    """
    linear = Linear.of(problem, best, noise, second)
    weights, sizes, moved = linear.weights, linear.sizes, linear.moved
    scaled = moved @ moved.T + PRIOR**2 * linear.flat @ linear.flat.T
    covariance = np.asarray(scaled * sizes[:, None] * sizes)

    def centre(residual: Array) -> Array:
        return np.asarray(best.unknowns - sizes * (linear.estimator @ (weights * residual)))

    own = Posterior(problem.unknowns, best.unknowns, centre(best.residual), covariance)
    if limit is None:
        return own, None
    return own, own.moved(limit.step, centre(best.residual + limit.error), LEFT)


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
