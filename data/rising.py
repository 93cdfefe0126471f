"""How far heights and pressures are from rising with each other, by whatever law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: So many frames tell something, and so large a share of them lies within the log.
LEAST_FRAMES, WITHIN = 6, 0.8
#: Heights to one of these powers go nearly straight with the pressures, those of a sheet that was
#: taut or flat, so that noise counts alike all along; any rising function of them would do.
POWERS = (1, 2, 3)


def straightest(h: Array, pressures: Sequence[Array]) -> int:
    """The power of the heights that correlates best with the pressures at any offset."""
    best = {}
    for power in POWERS:
        raised, best[power] = h**power, 0.0
        for p in pressures:
            inside = np.isfinite(p)
            x, y = raised[inside] - raised[inside].mean(), p[inside] - p[inside].mean()
            size = float(np.sqrt((x @ x) * (y @ y)))
            if inside.sum() >= max(LEAST_FRAMES, WITHIN * len(h) - 1) and size > 0:
                best[power] = max(best[power], float(x @ y) / size)
    return max(best, key=lambda power: best[power])


def misfit_of(p: Array, h: Array, rest: float) -> float:
    """What rising functions leave of the variances: mean of both, 1 where there is none.

    p : (frames,) MPa, NaN beyond the log. h : (frames,) mm, 0 at rest. rest : MPa, at rest.
    """
    inside = np.isfinite(p)
    if inside.sum() < max(LEAST_FRAMES, WITHIN * len(h) - 1):
        return 1.0
    p, h = p[inside], h[inside]
    # The state of rest weighs as much as all frames together, in the functions only.
    anchored = (p, h, rest, 0.0), (h, p, 0.0, rest)
    return sum(_left_over(*one) for one in anchored) / 2


def _left_over(x: Array, y: Array, x_rest: float, y_rest: float) -> float:
    """Share of the variance of y that no rising function of x through the rest explains."""
    from scipy.optimize import isotonic_regression

    total = float(np.sum((y - y.mean()) ** 2))
    if not total > 0:
        return 1.0
    weight = np.append(np.ones(len(x)), float(len(x)))
    all_x, all_y = np.append(x, x_rest), np.append(y, y_rest)
    # A function has one value where x has one: readings of one pressure are put together.
    which = np.unique(all_x, return_inverse=True)[1]
    sums = np.bincount(which, weight)
    rising = isotonic_regression(np.bincount(which, weight * all_y) / sums, weights=sums).x
    return float(np.sum((y - rising[which[:-1]]) ** 2)) / total
