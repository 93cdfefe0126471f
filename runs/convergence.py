"""Order of convergence and extrapolated limit of a sequence of refinements.

A discretisation of size h gives f(h) = f(0) + C h^p + smaller terms, once h is small enough. Three
values determine p, C and f(0), whatever the ratios of their sizes (P. J. Roache's generalised
Richardson extrapolation). Each result has a remark where the values contradict that assumption.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

#: Range in which an order of convergence is sought; smooth problems on common elements have 1 to 4.
ORDERS = (0.05, 12.0)


@dataclass(frozen=True)
class Convergence:
    """Hold the order of convergence and the limit of a sequence of refinements.

    Attributes
    ----------
    order : float or None
        Order observed on the three finest levels; None if they show none.
    limit : float or None
        The value at size zero by Richardson's extrapolation.
    previous : float or None
        The order observed one level coarser.
    remark : str
        What speaks against the limit; "" if nothing does.
    """

    order: float | None = None
    limit: float | None = None
    previous: float | None = None
    remark: str = ""


def observed_order(sizes: ArrayLike, changes: ArrayLike) -> float | None:
    """Return the order p with which two successive changes fall.

    Parameters
    ----------
    sizes : (3,) array_like
        Sizes of elements or increments, coarse to fine, decreasing.
    changes : (2,) array_like
        From the coarse to the middle level and from the middle to the fine one: of a value, or a
        norm of what changes.

    Returns
    -------
    float or None
        None for changes of opposite sign, or of a ratio that no order within `ORDERS` has.
    """
    h = np.asarray(sizes, dtype=float)
    d = np.asarray(changes, dtype=float)
    if d[1] == 0 or not np.isfinite(d).all() or d[0] / d[1] <= 0:
        return None
    log_ratio = np.log(d[0] / d[1])

    def excess(p: float) -> float:
        ratios = h / h[1]  # powers of numbers near 1 do not overflow
        return float(np.log((ratios[0] ** p - 1.0) / (1.0 - ratios[2] ** p)) - log_ratio)

    lowest, highest = ORDERS
    if excess(lowest) > 0 or excess(highest) < 0:
        return None
    return float(scipy.optimize.brentq(excess, lowest, highest, xtol=1e-10))


def richardson(sizes: ArrayLike, values: ArrayLike, order: float) -> float:
    """Return the value at size zero by extrapolation from the two finest levels, (2,) each."""
    h = np.asarray(sizes, dtype=float)
    f = np.asarray(values, dtype=float)
    ratio = h[0] / h[1]
    return float(f[1] + (f[1] - f[0]) / (ratio**order - 1.0))


def convergence(sizes: Sequence[float], values: Sequence[float], noise: float = 0.0) -> Convergence:
    """Return order and limit of a sequence of refinements.

    Parameters
    ----------
    sizes, values : (levels,)
        Coarse to fine; sizes decrease, in any unit.
    noise : float
        Relative accuracy of the values, by solver and files; smaller changes say nothing.
    """
    h = np.asarray(sizes, dtype=float)
    f = np.asarray(values, dtype=float)
    changes = np.diff(f)
    smallest = noise * np.abs(f).max(initial=0.0)
    if len(f) > 1 and np.abs(changes[-1]) <= smallest:
        return Convergence(remark="the two finest levels agree to the accuracy of the solver")
    if len(f) < 3:
        return Convergence(remark="an order needs three levels")
    order = observed_order(h[-3:], changes[-2:])
    if order is None:
        return Convergence(remark=f"{_irregularity(*changes[-2:])}: no order, no limit")
    limit = richardson(h[-2:], f[-2:], order)
    if abs(limit - f[-1]) > abs(f[-1] - f[-3]):
        # The limit is further away than the last two changes together: with sizes halved, an order
        # below about 0.5. Such a limit is not determined.
        words = f"changes that fall so slowly (order {order:.2g}) show no limit: refine further"
        return Convergence(remark=words)
    previous = None
    if len(f) > 3 and (np.abs(changes[-3:]) > smallest).all():
        previous = observed_order(h[-4:-1], changes[-3:-1])
    return Convergence(order, limit, previous, _remark(order, previous, len(f)))


def _irregularity(coarse_change: float, fine_change: float) -> str:
    """Return in words why two successive changes show no order."""
    if coarse_change * fine_change < 0:
        return "the values go up and down"
    if abs(fine_change) >= abs(coarse_change):
        return "the changes do not get smaller"
    return "the changes follow no power of the size"


def _remark(order: float, previous: float | None, levels: int) -> str:
    """Return in words what speaks against an observed order; "" if nothing does."""
    if levels == 3:
        return "one order only: one more level would show whether it holds"
    if previous is None:
        return "one order only, none from coarser levels: one more would show whether it holds"
    if abs(previous - order) > 0.5:
        return f"the order still moves (from {previous:.2g}): the limit is a guess"
    return ""
