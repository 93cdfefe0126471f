"""Analyse the shape of a load curve: order of its polynomial, and breaks of its three regions."""

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
        Points of one direction.
    orders : sequence of int
        Orders of the polynomial to compare.
    through_origin : bool
        Whether the polynomial is zero at no elongation.
    specimens : (n,) sequence or None
        Specimen of each point. If given, a whole specimen is left out at a time: errors of points
        of one specimen are correlated, so that leaving out single points would understate them.

    Returns
    -------
    list of (order, fitted error, error left out)
        RMS errors (N) at the points that the polynomial is fitted to, which are smallest for the
        highest order, and at points (or specimens) left out one by one; the latter is infinite
        where the remaining points do not determine the coefficients.

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
    """Return the sum of squared errors at points that a fit leaves out, group by group.

    `terms` (n, coefficients) are the polynomial's terms at each point, `residual` (n,) are its
    errors when fitted to all points, `groups` are rows that are left out together.
    """
    orthonormal = np.linalg.qr(terms)[0]
    squares = 0.0
    for group in groups:
        rows = orthonormal[group]
        # Errors of a fit without the group: (I - H)^-1 residual, H the group's block of the hat
        # matrix.
        without = np.eye(len(rows)) - rows @ rows.T
        if np.linalg.cond(without) > 1e12:
            return float("inf")  # the other points do not determine the coefficients
        squares += float((np.linalg.solve(without, residual[group]) ** 2).sum())
    return squares


def strain_regions(strain: ArrayLike, load: ArrayLike, *, grid: int = 40) -> tuple[float, float]:
    """Return the two strains at which the three linear regions of a load curve meet.

    The curve is approximated by a line of three straight pieces through the origin, by least
    squares, with breaks at places of a grid. Ambroziak and Klosowski read these regions by eye.

    Parameters
    ----------
    strain, load : (n,) array
        One curve, with strains above zero.
    grid : int
        Number of places that a break may take between zero and the largest strain.

    Raises
    ------
    InputError
        There are fewer than five points.
    """
    x = np.asarray(strain, dtype=float)
    f = np.asarray(load, dtype=float)
    if len(x) < 5 or not x.max() > 0:
        raise InputError(None, "load curve", f"five points are needed for regions, got {len(x)}")
    places = np.linspace(0.0, x.max(), grid + 2)[1:-1]
    hinges = np.maximum(x[:, None] - places, 0.0)
    # Of all points as few rows as there are columns: errors of each fit remain the same.
    _, rows = np.linalg.qr(np.column_stack([x, hinges, f]))
    pairs = np.array(list(itertools.combinations(range(grid), 2)))
    first, second = pairs[np.argmin(_errors_of_breaks(rows, pairs))]
    return float(places[first]), float(places[second])


def _errors_of_breaks(rows: Array, pairs: Array) -> Array:
    """Return the sum of squared errors of the best line of three pieces for each pair of breaks.

    `rows` (k, breaks + 2) are strain, strain less each break (zero below it), and load; `pairs`
    (pairs, 2) are the numbers of two breaks.
    """
    load = rows[:, -1]
    terms = np.stack([rows[:, [0, *pair]] for pair in pairs + 1])
    axes, singular_values, _ = np.linalg.svd(terms, full_matrices=False)
    # A break that no point tells from another one adds no direction: its singular value is zero
    # but for rounding.
    rounding = len(load) * np.finfo(float).eps * singular_values[:, :1]
    axes *= (singular_values > rounding)[:, None]
    fitted = np.einsum("pki,pi->pk", axes, load @ axes)
    return ((load - fitted) ** 2).sum(axis=1)
