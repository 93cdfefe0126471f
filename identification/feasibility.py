"""Random feasible starts (thesis section 4.3.2): inside the bounds, positive, and analysable."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import NoFeasibleStart
from .problem import FitProblem

Array = NDArray[np.float64]

MOST_DRAWS = 200_000
MOST_ANALYSES = 50
BATCH = 500


def feasible_start(problem: FitProblem, seed: int, number: int) -> Array:
    """Unknowns of random start `number` of the study `seed`: the same on any machine.

    Coefficients are drawn evenly between their bounds until the moduli are positive over the
    strain range and the analysis ends well, in a stable equilibrium.

    Raises
    ------
    NoFeasibleStart : nothing found in 200,000 draws or 50 analyses.
    """
    # Where another solver counts, its runs are not spent on draws.
    problem = problem.surrogate or problem
    p = problem.parameters
    random = np.random.default_rng([seed, number])
    tried = 0
    for _ in range(MOST_DRAWS // BATCH):
        draws = p.draw(random, BATCH)
        for coefficients in draws[p.allowed(draws)]:
            tried += 1
            y = p.unknowns(coefficients)
            point = problem.evaluate(y, False, warm=False)
            if point is not None and point.stable:
                return y
            if tried >= MOST_ANALYSES:
                raise NoFeasibleStart(
                    f"start {number}: the analysis failed at all of {tried} random points with "
                    "positive moduli; raise the lower bounds or add increments"
                )
    raise NoFeasibleStart(
        f"start {number}: none of {MOST_DRAWS} random points inside the bounds has positive "
        "moduli over the strain range; check [bounds] and material.strain_range"
    )
