"""Observed order of convergence and Richardson's limit, from values on a few refinements.

A discretisation of size h gives f(h) = f(0) + C h^p + smaller terms, once h is small enough. Three
values determine p, C and f(0), whatever the ratios of their sizes (P. J. Roache's generalised
Richardson extrapolation). The result is worth what the assumption is worth, so each comes with a
remark where the values contradict it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

#: Orders looked for; a smooth problem on common elements has 1 to 4.
LOWEST, HIGHEST = 0.05, 12.0
#: Two successive orders further apart than this are not one order yet.
STEADY = 0.5


@dataclass(frozen=True)
class Convergence:
    """What a sequence of refinements says about the exact value.

    order : observed on the three finest levels, None where there is none to see. limit : the value
    at size zero by Richardson's extrapolation. previous : the order observed one level coarser.
    remark : what a reader should know, empty where nothing speaks against the limit.
    """

    order: float | None = None
    limit: float | None = None
    previous: float | None = None
    remark: str = ""

    def error(self, value: float) -> float | None:
        """How far `value` is from the limit, relative to it; None where there is no limit."""
        if self.limit is None or self.limit == 0:
            return None
        return value / self.limit - 1.0


def observed_order(sizes: ArrayLike, changes: ArrayLike) -> float | None:
    """Order p with which two successive changes fall.

    Parameters
    ----------
    sizes : (3,) coarse to fine, decreasing.
    changes : (2,) from the coarse to the middle level and from the middle to the fine one: of a
        value, or a norm of what changes.

    Returns
    -------
    p, or None: changes of opposite sign, or a ratio that no order from `LOWEST` to `HIGHEST` has.

    Raises
    ------
    ValueError : sizes that do not decrease.
    """
    h, d = _sizes(sizes, 3), np.asarray(changes, dtype=float)
    if d[1] == 0 or not np.isfinite(d).all() or d[0] / d[1] <= 0:
        return None
    wanted = np.log(d[0] / d[1])

    def excess(p: float) -> float:
        ratios = h / h[1]  # powers of numbers near 1 do not overflow
        return float(np.log((ratios[0] ** p - 1.0) / (1.0 - ratios[2] ** p)) - wanted)

    if excess(LOWEST) > 0 or excess(HIGHEST) < 0:
        return None
    return float(brentq(excess, LOWEST, HIGHEST, xtol=1e-10))


def richardson(sizes: ArrayLike, values: ArrayLike, order: float) -> float:
    """Value at size zero from the two finest levels of known order.

    Parameters
    ----------
    sizes, values : (2,) coarse and fine.

    Raises
    ------
    ValueError : sizes that do not decrease.
    """
    h, f = _sizes(sizes, 2), np.asarray(values, dtype=float)
    return float(f[1] + (f[1] - f[0]) / ((h[0] / h[1]) ** order - 1.0))


def convergence(sizes: Sequence[float], values: Sequence[float], noise: float = 0.0) -> Convergence:
    """Order and limit of a sequence of refinements.

    Parameters
    ----------
    sizes : (levels,) coarse to fine, decreasing; any unit.
    values : (levels,) of one quantity.
    noise : relative change that is not the refinement's: the accuracy of solver and files.

    Raises
    ------
    ValueError : sizes that do not decrease, or not one for each value.
    """
    h, f = _sizes(sizes, len(values)), np.asarray(values, dtype=float)
    changes = np.diff(f)
    least = noise * np.abs(f).max(initial=0.0)
    if len(f) > 1 and np.abs(changes[-1]) <= least:
        return Convergence(remark="the two finest levels agree to the accuracy of the solver")
    if len(f) < 3:
        return Convergence(remark="an order needs three levels")
    order = observed_order(h[-3:], changes[-2:])
    if order is None:
        return Convergence(remark=_no_order(changes[-2:]))
    limit = richardson(h[-2:], f[-2:], order)
    if abs(limit - f[-1]) > abs(f[-1] - f[-3]):
        # An order below a half where sizes are halved: the limit would be anybody's guess.
        words = f"changes that fall so slowly (order {order:.2g}) show no limit: refine further"
        return Convergence(remark=words)
    previous = None
    if len(f) > 3 and (np.abs(changes[-3:]) > least).all():
        previous = observed_order(h[-4:-1], changes[-3:-1])
    remark = ""
    if len(f) == 3:
        remark = "one order only: one more level would tell whether it holds"
    elif previous is None:
        remark = "one order only, a level coarser there is none: one more level would tell"
    elif abs(previous - order) > STEADY:
        remark = f"the order still moves (from {previous:.2g}): the limit is a guess"
    return Convergence(order, limit, previous, remark)


def _no_order(changes: Array) -> str:
    if changes[0] * changes[1] < 0:
        return "the values go up and down: no order, no limit"
    if abs(changes[1]) >= abs(changes[0]):
        return "the changes do not get smaller: no order, no limit"
    return "the changes follow no power of the size: no order, no limit"


def _sizes(sizes: ArrayLike, count: int) -> Array:
    h = np.asarray(sizes, dtype=float)
    if h.shape != (count,) or not (h > 0).all() or not (np.diff(h) < 0).all():
        raise ValueError(f"expected {count} positive, decreasing sizes, got {h}")
    return h
