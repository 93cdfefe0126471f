"""What fits to noisy data scatter by, for the tests of what is said of it."""

from collections.abc import Mapping

import numpy as np
from bubblefit.inference.problem import Evaluation, FitProblem

Array = np.ndarray


def noise_of(fit: FitProblem, each: Mapping[str, float], random: np.random.Generator) -> Array:
    """(m,) white noise of each comparison's data, as it stands in the residual."""
    sizes = {c.name: sum(c.objective.sizes) for c in fit.comparisons}
    drawn = [each[name] * random.standard_normal(size) for name, size in sizes.items()]
    return np.concatenate(drawn) / fit.scale


def follows(fit: FitProblem, point: Evaluation, noise: Array) -> Array:
    """Where a fit goes (unknowns,) that began at `point`, to first order.

    Its blocks are weighted so that the sum of their norms is least.
    """
    assert point.jacobian is not None
    norms = fit.blocks.norms(point.residual)
    root = 1.0 / np.sqrt(norms[fit.blocks.of])
    by_noise = root * noise.T
    return np.asarray(np.linalg.lstsq(root[:, None] * point.jacobian, by_noise.T, rcond=None)[0])


def scatter_of(
    fit: FitProblem, point: Evaluation, each: Mapping[str, float], draws: int = 4000
) -> Array:
    """Standard deviation of the unknowns (n,) over drawn noise: sure to 1.1 % with 4000 draws."""
    random = np.random.default_rng(11)
    noise = np.array([noise_of(fit, each, random) for _ in range(draws)])
    return np.asarray(np.std(follows(fit, point, noise.T), axis=1))
