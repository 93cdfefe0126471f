"""Compute the Fisher information that the data of a test have on the unknowns of the law.

References
----------
R. A. Fisher, Theory of statistical estimation, Proc. Camb. Philos. Soc. 22 (1925) 700.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from ..solvers.base import History
from .comparison import Comparison
from .linear import PRIOR
from .nuisance import Nuisance
from .unknowns import Unknowns

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
    comparison: Comparison, law: HypoelasticLaw, unknowns: Unknowns
) -> tuple[Array, History]:
    """Run a comparison with a law, and return its Fisher information on the unknowns of the law.

    Parameters
    ----------
    comparison : Comparison
    law : HypoelasticLaw
    unknowns : Unknowns

    Returns
    -------
    (size, size) array
        The information.
    History
        The run.
    """
    at_zero = {n.name: 0.0 for n in comparison.nuisance}
    history, slope = comparison.differentiate(law, unknowns.free, at_zero, warm=False)
    slope = slope * comparison.objective.scale[:, None]
    size = unknowns.size
    by_unknowns = np.hstack([slope[:, :size] @ unknowns.to_coefficients, slope[:, size:]])
    noise = comparison.objective.least_noise
    return information(by_unknowns, noise, comparison.nuisance), history
