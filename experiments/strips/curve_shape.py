"""The shape of a load curve: the order of its polynomial, and its three regions."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ...readers.curves import checked_points, fit_load_polynomial, terms_of
from ...solvers.base import Array


def compare_orders(
    elongation: ArrayLike,
    load: ArrayLike,
    orders: Sequence[int] = range(1, 9),
    through_origin: bool = True,
    specimens: Sequence[object] | None = None,
) -> list[tuple[int, float, float]]:
    """Compare the orders of a load polynomial by their errors at points that are left out.

    Parameters
    ----------
    elongation, load : (n,) array, mm and N
    orders : sequence of int
    through_origin : bool
        Whether the polynomial is zero at no elongation.
    specimens : (n,) sequence or None
        Of each point. With it a whole specimen is left out at a time: points of one specimen err
        together, so leaving out one of them flatters.

    Returns
    -------
    list of (order, fitted error, error left out)
        RMS errors (N): at the points it is fitted to, least for the highest order, and at points
        left out one by one.

    Raises
    ------
    InputError
        There are too few points for an order.
    """
    u, f = checked_points(elongation, load)
    names = list(range(len(u))) if specimens is None else list(specimens)
    groups = [
        np.array([i for i, owner in enumerate(names) if owner == name])
        for name in dict.fromkeys(names)
    ]
    scores = []
    for order in orders:
        polynomial = fit_load_polynomial(u, f, order, through_origin)
        terms, _, _ = terms_of(u, order, through_origin)
        count, term_count = terms.shape
        if count < term_count + 2:
            problem = f"comparing needs {term_count + 2} points, there are {count}; lower it"
            raise InputError(None, f"order {order}", problem)
        squares = _squares_left_out(terms, f - polynomial(u), groups)
        scores.append((order, polynomial.rmse, float(np.sqrt(squares / count))))
    return scores


def _squares_left_out(terms: Array, residual: Array, groups: Sequence[Array]) -> float:
    """Return the sum of squared errors at groups of points, refitted without each of them."""
    orthonormal = np.linalg.qr(terms)[0]
    squares = 0.0
    for group in groups:
        rows = orthonormal[group]
        # The squared error at points refitted without them, by (1 - H)^-1.
        without = np.eye(len(rows)) - rows @ rows.T
        if np.linalg.cond(without) > 1e12:
            return float("inf")  # the others do not settle the coefficients
        squares += float((np.linalg.solve(without, residual[group]) ** 2).sum())
    return squares


def strain_regions(strain: ArrayLike, load: ArrayLike, *, grid: int = 40) -> tuple[float, float]:
    """Return the two breaks of the broken line through the origin nearest to the curve.

    By least squares over a grid, as Ambroziak and Klosowski read the regions of a coated fabric by
    eye.

    Parameters
    ----------
    strain, load : (n,) array
        Of one curve, strain above zero.
    grid : int
        Places that a break may take between zero and the last strain.

    Raises
    ------
    InputError
        There are too few points.
    """
    x = np.asarray(strain, dtype=float)
    f = np.asarray(load, dtype=float)
    if len(x) < 5 or not x.max() > 0:
        raise InputError(None, "load curve", f"five points are needed for regions, got {len(x)}")
    places = np.linspace(0.0, x.max(), grid + 2)[1:-1]
    hinges = np.maximum(x[:, None] - places, 0.0)
    pairs = list(itertools.combinations(range(grid), 2))
    errors = [_error_of_breaks(x, f, hinges[:, list(pair)]) for pair in pairs]
    first, second = pairs[int(np.argmin(errors))]
    return float(places[first]), float(places[second])


def _error_of_breaks(x: Array, f: Array, hinges: Array) -> float:
    """Return the squared error of the broken line with two hinges (n, 2) nearest to a curve."""
    terms = np.stack([x, *hinges.T], axis=1)
    slopes, *_ = np.linalg.lstsq(terms, f, rcond=None)
    return float(np.sum((terms @ slopes - f) ** 2))
