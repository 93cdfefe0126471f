"""Piecewise cubics as weights of the values and slopes at their knots.

Those of `scipy.interpolate`, whose import alone takes a fifth of a second.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def hermite_weights(knots: Array, positions: Array) -> tuple[Array, Array]:
    """Return the weights of a cubic between two knots each, which has their values and slopes.

    Parameters
    ----------
    knots : (k,) array
        Increasing, two or more.
    positions : (n,) array
        Beyond the knots the first or last cubic goes on.

    Returns
    -------
    by_value, by_slope : (n, k) array
        The curve is by_value @ values + by_slope @ slopes.
    """
    piece, length, share = _places(knots, positions)
    rising = share**2 * (3.0 - 2.0 * share)
    begin = length * share * (1.0 - share) ** 2
    end = length * share**2 * (share - 1.0)
    return _matrix(knots, piece, 1.0 - rising, rising), _matrix(knots, piece, begin, end)


def hermite_slope_weights(knots: Array, positions: Array) -> tuple[Array, Array]:
    """Return the weights of the slope of that cubic; see `hermite_weights`."""
    piece, length, share = _places(knots, positions)
    rising = 6.0 * share * (1.0 - share) / length
    begin = (1.0 - share) * (1.0 - 3.0 * share)
    end = share * (3.0 * share - 2.0)
    return _matrix(knots, piece, -rising, rising), _matrix(knots, piece, begin, end)


def spline_slopes(knots: Array) -> Array:
    """Return the matrix (k, k) that gives the slopes of a cubic spline from its values at knots.

    The first two cubics are one, and the last two (not-a-knot): through three knots goes a
    parabola, through two a line.
    """
    count = len(knots)
    steps = np.diff(knots)
    secants = np.diff(np.eye(count), axis=0) / steps[:, None]
    if count == 2:
        return np.repeat(secants, 2, axis=0)
    matrix = np.zeros((count, count))
    sides = np.zeros((count, count))
    for i in range(1, count - 1):
        left, right = steps[i - 1 : i + 1]
        matrix[i, i - 1 : i + 2] = right, 2.0 * (left + right), left
        sides[i] = 3.0 * (right * secants[i - 1] + left * secants[i])
    first_end = (0, 1, 0, 1)
    last_end = (count - 1, count - 2, -1, -2)
    for i, inner, outer, further in (first_end, last_end):
        if count == 3:
            matrix[i, [i, inner]] = 1.0
            sides[i] = 2.0 * secants[outer]
            continue
        at_end, behind = steps[[outer, further]]
        total = at_end + behind
        matrix[i, [i, inner]] = behind, total
        sides[i] = (at_end + 2.0 * total) * behind * secants[outer] + at_end**2 * secants[further]
        sides[i] /= total
    return np.asarray(np.linalg.solve(matrix, sides), dtype=float)


def _places(knots: Array, positions: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the piece (n,) of each position, its length, and the share of it that is passed."""
    piece = np.clip(np.searchsorted(knots, positions, side="right") - 1, 0, len(knots) - 2)
    begin = knots[piece]
    length = knots[piece + 1] - begin
    return piece, length, (positions - begin) / length


def _matrix(knots: Array, piece: NDArray[np.intp], first: Array, last: Array) -> Array:
    """Return weights (n, k) that are zero but at both knots of the piece."""
    weights = np.zeros((len(piece), len(knots)))
    rows = np.arange(len(piece))
    weights[rows, piece] = first
    weights[rows, piece + 1] = last
    return weights
