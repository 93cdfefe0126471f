"""Random feasible starts: inside the bounds, of positive moduli, and they can be analysed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from ..errors import NoFeasibleStart
from .problem import FitProblem
from .unknowns import Unknowns

Array = NDArray[np.float64]

MOST_DRAWS = 200_000
MOST_ANALYSES = 50
BATCH = 500
#: Values of one modulus that are drawn.
MOST_VALUES = 4


def feasible_start(problem: FitProblem, seed: int, number: int) -> Array:
    """Unknowns of random start `number` of the study `seed`: the same on any machine.

    Coefficients are drawn (see `draw`) until the moduli are positive over the
    strain range and the analysis ends well, in a stable equilibrium.

    Raises
    ------
    NoFeasibleStart : none in 200,000 draws or 50 analyses.
    """
    # Where another solver counts, its runs are not spent on draws.
    problem = problem.surrogate or problem
    unknowns = problem.unknowns
    random = np.random.default_rng([seed, number])
    tried = 0
    for _ in range(MOST_DRAWS // BATCH):
        draws = draw(unknowns, random, BATCH)
        for coefficients in draws[allowed(unknowns, draws)]:
            tried += 1
            y = unknowns.at(coefficients)
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
        "moduli over the strain range; check the bounds and the strain range"
    )


def draw(unknowns: Unknowns, random: np.random.Generator, count: int) -> Array:
    """`count` random free coefficients (count, size) MPa, not all of them feasible.

    Even in the box of their bounds; where the moduli themselves are bounded, even in the
    logarithm of their values at the control strains.
    """
    if unknowns.bounds.largest is None:
        lower, upper = unknowns.box
        return np.asarray(lower + (upper - lower) * random.random((count, unknowns.size)))
    between = _between(unknowns.form.modulus_of)
    share = random.random((count, between.shape[1])) @ between.T
    ends = [np.log(end) for end in unknowns.bounds.control(unknowns.form)]
    return np.asarray(np.exp(ends[0] + (ends[1] - ends[0]) * share) @ unknowns.from_values.T)


def _between(modulus_of: Sequence[str]) -> Array:
    """(size, drawn): from what is drawn to the control values of every modulus.

    Values of their own where a modulus has few; more are interpolated, because a curve through
    many independent ones hardly ever stays inside its bounds between them.
    """
    blocks = []
    for name in dict.fromkeys(modulus_of):
        count = sum(own == name for own in modulus_of)
        few = min(count, MOST_VALUES)
        at = np.linspace(0.0, few - 1.0, count)
        blocks.append(np.column_stack([np.interp(at, range(few), row) for row in np.eye(few)]))
    return np.asarray(block_diag(*blocks))


def allowed(unknowns: Unknowns, coefficients: Array) -> NDArray[np.bool_]:
    """Which of the free coefficients (n, size) MPa make moduli inside their bounds, (n,)."""
    grid, margin = unknowns.positivity
    moduli = coefficients @ grid.T
    good = (moduli >= margin).all(axis=1)
    if unknowns.ceiling is not None:
        good &= (moduli <= unknowns.ceiling).all(axis=1)
    return np.asarray(good)
