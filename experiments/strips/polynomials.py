"""Which order of load polynomial: the thesis' rule and rules that can say no."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...readers.polynomials import checked_points, fit_load_polynomial, terms_of


@dataclass(frozen=True)
class OrderScore:
    """Scores of one order: n points, k coefficients, S the sum of squares left.

    r_squared : 1 - S / (squares about the mean). adjusted_r_squared : the same of S / (n - k) and
    (squares about the mean) / (n - 1). rmse : N, sqrt(S / n). aic, bic : n ln(S / n) + 2 (k + 1)
    and n ln(S / n) + (k + 1) ln n. left_out : N, root mean square error at points, or whole
    specimens, that the fit did not see.
    """

    order: int
    r_squared: float
    adjusted_r_squared: float
    rmse: float
    aic: float
    bic: float
    left_out: float


@dataclass(frozen=True)
class OrderComparison:
    """Scores by rising order, and the order that each rule chooses.

    by_fit : lowest RMSE and highest R^2, the thesis' rule (section 3.2). Each order contains the
    ones below it, so least squares can only lower the RMSE: the rule chooses the highest order
    offered, whatever the data. The thesis' fourth order was therefore a choice of what to offer.
    """

    scores: tuple[OrderScore, ...]
    by_fit: int
    by_adjusted_r_squared: int
    by_aic: int
    by_bic: int
    by_left_out: int


def compare_orders(
    elongation: ArrayLike,
    load: ArrayLike,
    orders: Sequence[int] = range(1, 9),
    through_origin: bool = True,
    specimens: Sequence[object] | None = None,
) -> OrderComparison:
    """Fit each order to the points (n,) mm and (n,) N and score it.

    specimens : (n,) which specimen each point belongs to. With it a whole specimen is left out at a
    time: points of one specimen err together, so leaving out one of them flatters.
    Raises InputError: as `fit_load_polynomial`; no orders; fewer points than coefficients and two.
    """
    u, f = checked_points(elongation, load)
    names = list(range(len(u))) if specimens is None else list(specimens)
    if len(names) != len(u):
        raise InputError(None, "specimens", f"expected {len(u)} names, got {len(names)}")
    if not len(orders):
        raise InputError(None, "orders", "expected at least one, got none")
    groups = [
        np.array([i for i, name in enumerate(names) if name == one]) for one in dict.fromkeys(names)
    ]
    scores = tuple(_score(u, f, order, through_origin, groups) for order in sorted(set(orders)))

    def best(values: list[float]) -> int:
        return scores[int(np.argmin(values))].order

    return OrderComparison(
        scores,
        best([score.rmse for score in scores]),
        best([-score.adjusted_r_squared for score in scores]),
        best([score.aic for score in scores]),
        best([score.bic for score in scores]),
        best([score.left_out for score in scores]),
    )


def _score(
    u: NDArray[np.float64],
    f: NDArray[np.float64],
    order: int,
    through_origin: bool,
    groups: list[NDArray[np.intp]],
) -> OrderScore:
    fitted = fit_load_polynomial(u, f, order, through_origin)
    terms, _, _ = terms_of(u, order, through_origin)
    n, k = terms.shape
    if n < k + 2:
        problem = f"comparing needs {k + 2} points, there are {n}; lower it"
        raise InputError(None, f"order {order}", problem)
    # Below rounding a fit is exact, and the logarithm of nothing says nothing.
    mean_square = max(fitted.rmse**2, 1e-30 * float((f**2).mean()))
    likelihood = n * float(np.log(mean_square))
    orthonormal = np.linalg.qr(terms)[0]
    left = f - fitted(u)
    squares = sum(_left_out_squares(orthonormal[group], left[group]) for group in groups)
    return OrderScore(
        order,
        fitted.r_squared,
        1.0 - (1.0 - fitted.r_squared) * (n - 1) / (n - k),
        fitted.rmse,
        likelihood + 2 * (k + 1),
        likelihood + float(np.log(n)) * (k + 1),
        float(np.sqrt(squares / n)),
    )


def _left_out_squares(rows: NDArray[np.float64], left: NDArray[np.float64]) -> float:
    """Return the squared error at points refitted without them, by (1 - H)^-1."""
    without = np.eye(len(rows)) - rows @ rows.T
    if np.linalg.cond(without) > 1e12:
        return float("inf")  # the others do not settle the coefficients
    return float((np.linalg.solve(without, left) ** 2).sum())


#: Places that a break may take between zero and the last strain.
PLACES = 40


def strain_regions(strain: ArrayLike, load: ArrayLike) -> tuple[float, float]:
    """Return the two breaks of the broken line through the origin nearest to the curve.

    How Ambroziak and Klosowski read the regions of a coated fabric off its curve by eye, by
    least squares. Of the pairs on a grid of 40 places, the best.

    strain, load : (n,) of one curve, strain above zero.
    Raises InputError: fewer than five points, or none with strain.
    """
    x, f = np.asarray(strain, dtype=float), np.asarray(load, dtype=float)
    if len(x) < 5 or not x.max() > 0:
        raise InputError(None, "load curve", f"five points are needed for regions, got {len(x)}")
    places = np.linspace(0.0, x.max(), PLACES + 2)[1:-1]
    hinges = np.maximum(x[:, None] - places, 0.0)
    best, least = (places[0], places[-1]), np.inf
    for a, b in itertools.combinations(range(PLACES), 2):
        terms = np.stack([x, hinges[:, a], hinges[:, b]], axis=1)
        slopes, *_ = np.linalg.lstsq(terms, f, rcond=None)
        error = float(np.sum((terms @ slopes - f) ** 2))
        if error < least:
            best, least = (places[a], places[b]), error
    return float(best[0]), float(best[1])
