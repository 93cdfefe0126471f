"""What measured values say of a law, as information that adds up from test to test.

Information is J'J, J (m, unknowns) the slope of the values over their noise, without what a test's
own nuisance takes up of it: the best estimate from several tests has the inverse of the sum as its
covariance (Fisher). Every value counts by its noise, not by a weight of the objective.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..materials.law import HypoelasticLaw
from ..solvers.base import History
from .comparison import Comparison
from .linear import sizes_of
from .nuisance import Nuisance
from .propagation import PRIOR, along
from .unknowns import Unknowns

Array = NDArray[np.float64]

#: Of the width of the bounds of a nuisance: less is none.
LEAST_WIDTH = 1e-3


def information(slopes: Array, sigma: Array | float, nuisance: Sequence[Nuisance] = ()) -> Array:
    """(n, n): what values say of the n unknowns of the law, whatever the nuisance is.

    Parameters
    ----------
    slopes : (m, n + nuisance) of the values by the law's unknowns, then by the nuisance.
    sigma : noise of the values, (m,) or one for all, in their unit.
    nuisance : with a prior each, or known to ten times the width of its bounds.
    """
    count = slopes.shape[1] - len(nuisance)
    before = [n.prior or PRIOR * max(n.upper - n.lower, LEAST_WIDTH) for n in nuisance]
    known = np.zeros((len(nuisance), slopes.shape[1]))
    known[:, count:] = np.diag(1.0 / np.array(before))
    rows = np.concatenate([slopes / np.reshape(sigma, (-1, 1)), known])
    law, own = rows[:, :count], rows[:, count:]
    if len(nuisance):
        span = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
        law = law - span @ (span.T @ law)
    return np.asarray(law.T @ law)


def information_of(
    comparison: Comparison, law: HypoelasticLaw, unknowns: Unknowns
) -> tuple[Array, History]:
    """(n, n) of a comparison that is run with a law, and the run: nuisance at zero, least noise.

    Raises
    ------
    SolverFailure : it does not end well, or its solver gives no derivatives.
    """
    at_zero = {n.name: 0.0 for n in comparison.nuisance}
    history, slope = comparison.differentiate(law, unknowns.free, at_zero, warm=False)
    slope = slope * comparison.objective.scale[:, None]
    size = unknowns.size
    by_unknowns = np.hstack([slope[:, :size] @ unknowns.to_coefficients, slope[:, size:]])
    known = information(by_unknowns, comparison.objective.least_noise, comparison.nuisance)
    return known, history


@dataclass(frozen=True, eq=False)
class Asked:
    """The law at which, and the strains up to which, its moduli are asked for.

    y : unknowns of the law. ends : (3,) strains (eps1, eps2, gamma12).
    """

    unknowns: Unknowns
    law: HypoelasticLaw
    y: Array
    ends: Array

    def sigma(self, known: Array) -> dict[str, Array]:
        """1-sigma relative uncertainty (n,) of each modulus from information (unknowns, unknowns).

        Before any test each unknown of the law is known to 1000 % of itself: so a modulus of which
        the tests say nothing comes out as unknown, not as certain.
        """
        count = len(known)
        sizes = PRIOR * sizes_of(self.unknowns, self.y)[:count]
        scaled = known * sizes[:, None] * sizes + np.eye(count)
        covariance = np.linalg.inv(0.5 * (scaled + scaled.T)) * sizes[:, None] * sizes
        return along(self.unknowns, self.law, self.ends, covariance)[1]


def summary(sigma: Mapping[str, Array]) -> dict[str, float]:
    """One figure a modulus: the root of the mean square of its relative sigma along its strain."""
    return {name: float(np.sqrt(np.mean(values**2))) for name, values in sigma.items()}
