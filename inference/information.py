"""Fisher information of the data of a test on the unknowns of the law.

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

MIN_WIDTH = 1e-3  # of the bounds of a nuisance, in its unit: less counts as that


def information(slopes: Array, sigma: Array | float, nuisance: Sequence[Nuisance] = ()) -> Array:
    """Return the information of values on the unknowns of the law, nuisance removed.

    It is J'J, J the slope of the values over their noise: it adds up from test to test, and its
    inverse is the covariance of the best estimate.

    Parameters
    ----------
    slopes : (m, n + nuisance) array
        Of the values by the n unknowns of the law, then by the nuisance.
    sigma : (m,) array or float
        Standard deviation of the values.
    nuisance : sequence of Nuisance
        Each counts by its prior, or as known to ten times the width of its bounds.

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
    return np.asarray(law_columns.T @ law_columns)


def information_of(
    comparison: Comparison, law: HypoelasticLaw, unknowns: Unknowns
) -> tuple[Array, History]:
    """Return the information of a comparison, run with a law, on the unknowns of the law.

    Parameters
    ----------
    comparison : Comparison
    law : HypoelasticLaw
    unknowns : Unknowns

    Returns
    -------
    (size, size) array
    History
        Of the run.
    """
    at_zero = {n.name: 0.0 for n in comparison.nuisance}
    history, slope = comparison.differentiate(law, unknowns.free, at_zero, warm=False)
    slope = slope * comparison.objective.scale[:, None]
    size = unknowns.size
    by_unknowns = np.hstack([slope[:, :size] @ unknowns.to_coefficients, slope[:, size:]])
    noise = comparison.objective.least_noise
    return information(by_unknowns, noise, comparison.nuisance), history
