"""Data of the compiled law: constants, state at a point, results, and moduli as piecewise cubics.

`pieces` (3, P, 5) is a law's three moduli as `forms.base.pieces_of` writes them. The modulus of an
increment is its MEAN over the increment, (F(x) - F(x_old))/(x - x_old) with F its integral. So a
bar has the exact stress in any number of increments, a modulus that jumps gives a stress that does
not, and d(stress)/d(strain) is the modulus at the END of the increment.
"""

from typing import NamedTuple

import numpy as np

from ..compilation import compiled
from .forms.base import Array

#: Constants of a law beside its moduli. The length of a tuple is part of its type, so that code for
#: crimp or a memory is compiled only for laws that have them.
Coupling = tuple[float, ...]
#: Number of entries of the vector that `point_law.stress_update` writes for the sensitivities.
SLOPES = 31


class CompiledLaw(NamedTuple):
    """Constants of a law, as compiled functions take them.

    Attributes
    ----------
    pieces : (3, P, 5) ndarray, MPa
        The moduli as piecewise cubics, see `forms.base.pieces_of`.
    coupling : tuple of float
        nu12, and the gains (MPa) of E1 and E2 as their normalised load ratios go from 0 to 1; a law
        with crimp has 6 entries, the last T1, T2, S (MPa) of `forms/ratio.py`; a law with a memory
        has 15, the last 12 its constants (`memory.NAMES`).
    area_power : float
        1 for constant thickness, 0 for an incompressible material (`HypoelasticLaw.area_power`).
    """

    pieces: Array
    coupling: Coupling
    area_power: float


class LawSlopes(NamedTuple):
    """Derivatives of a law's constants by p parameters.

    Attributes
    ----------
    rows : (3, P, 4, p) ndarray
        Derivatives of the coefficients of the pieces (`CompiledLaw.pieces` without upper ends).
    coupling : (len(coupling), p) ndarray
        Derivatives of `CompiledLaw.coupling`.
    """

    rows: Array
    coupling: Array


class CauchyGreen(NamedTuple):
    """In-plane Cauchy-Green components: m = (C11 + C22) / 2, q = (C11 - C22) / 2, c = C12."""

    m: float
    q: float
    c: float


class PointState(NamedTuple):
    """Log strain (3,), or (9,) for a law with a memory, and Cauchy stress (3,) MPa at a point."""

    strain: Array
    stress: Array


class LawTangent(NamedTuple):
    """Hold what `point_law.stress_update` writes beside a state.

    Attributes
    ----------
    tangent : (3, 3) array, MPa
        d stress / d strain.
    slopes : (SLOPES,) array
        For `stress_rate`.
    """

    tangent: Array
    slopes: Array


class PointResponse(NamedTuple):
    """Hold what `point_law.membrane_stress` writes beside a state.

    Attributes
    ----------
    pk2 : (3,) ndarray, MPa
        2nd Piola-Kirchhoff stress.
    stiffness : (3, 3) ndarray, MPa
        d pk2 / d Green-Lagrange strain.
    strain_slope : (3, 3) ndarray
        d log strain / d Green-Lagrange strain.
    law : LawTangent
    pull : (3, 3) ndarray
        d pk2 / d Cauchy stress, area ratio included.
    work : (3, 3) ndarray
        Scratch.
    """

    pk2: Array
    stiffness: Array
    strain_slope: Array
    law: LawTangent
    pull: Array
    work: Array


@compiled()
def point_response() -> PointResponse:
    """Return a new, empty response, to be overwritten at one point after the other."""
    law = LawTangent(np.empty((3, 3)), np.empty(SLOPES))
    return PointResponse(
        np.empty(3),
        np.empty((3, 3)),
        np.empty((3, 3)),
        law,
        np.empty((3, 3)),
        np.empty((3, 3)),
    )


#: Increments of strain below this are not divided by where they cross the end of a piece.
TINY = 1e-12
#: Strain components, of one integer type: numba would compile each function anew for literals.
WARP, FILL, SHEAR = (np.int64(k) for k in range(3))


@compiled(internal=True)
def _place(pieces: Array, component: int, x: float) -> int:
    """Return the number of the piece that a strain in range lies in; pieces : (3, P, 5)."""
    k = 0
    last = pieces.shape[1] - 1
    while k < last and x > pieces[component, k, 0]:
        k += 1
    return k


@compiled(internal=True)
def _means(a: float, b: float) -> tuple[float, float, float]:
    """Return the means of x^3, x^2 and x between a and b."""
    total = a + b
    squares = a * a + b * b
    return 0.25 * total * squares, (squares + a * b) * (1.0 / 3.0), 0.5 * total


@compiled(internal=True)
def _mean_of_piece(
    pieces: Array,
    component: int,
    k: int,
    a: float,
    b: float,
) -> float:
    """Return the mean modulus (MPa) between a and b by piece number k; pieces : (3, P, 5)."""
    third, second, first = _means(a, b)
    value = pieces[component, k, 1] * third + pieces[component, k, 2] * second
    return value + pieces[component, k, 3] * first + pieces[component, k, 4]


@compiled(_nrt=False)
def point_modulus(pieces: Array, component: int, x: float) -> float:
    """Return a modulus (MPa) at a strain, constant beyond its range; pieces : (3, P, 5)."""
    size = abs(x) if component == 2 else x
    in_range = min(max(size, 0.0), pieces[component, pieces.shape[1] - 1, 0])
    k = _place(pieces, component, in_range)
    value = pieces[component, k, 1] * in_range + pieces[component, k, 2]
    return (value * in_range + pieces[component, k, 3]) * in_range + pieces[component, k, 4]


@compiled(_nrt=False)
def integral_of(
    pieces: Array,
    component: int,
    low: float,
    high: float,
) -> float:
    """Return the integral of the modulus from low to high, summed over the pieces on the way."""
    total = 0.0
    start = 0.0
    if low < 0.0:
        total += (min(high, 0.0) - low) * pieces[component, 0, 4]
    for k in range(pieces.shape[1]):
        end = pieces[component, k, 0]
        a = max(low, start)
        b = min(high, end)
        if b > a:
            total += (b - a) * _mean_of_piece(pieces, component, k, a, b)
        start = end
    if high > start:
        total += (high - max(low, start)) * point_modulus(pieces, component, start)
    return total


@compiled(internal=True)
def _across(
    pieces: Array,
    component: int,
    x: float,
    x_old: float,
) -> tuple[float, float, float]:
    """Return what `increment_modulus` does, for an increment that crosses the end of a piece.

    `pieces` is (3, P, 5): upper end and cubic (MPa) of each piece.
    """
    change = x - x_old
    if abs(change) < TINY:
        return point_modulus(pieces, component, 0.5 * (x + x_old)), 0.0, 0.0
    if component == 2 and x * x_old < 0.0:
        integral = integral_of(pieces, component, 0.0, abs(x))
        integral += integral_of(pieces, component, 0.0, abs(x_old))
    elif component == 2:
        a = abs(x)
        b = abs(x_old)
        integral = integral_of(pieces, component, min(a, b), max(a, b))
    else:
        integral = integral_of(pieces, component, min(x, x_old), max(x, x_old))
    mean = integral / abs(change)
    ahead = (point_modulus(pieces, component, x) - mean) / change
    behind = (mean - point_modulus(pieces, component, x_old)) / change
    return mean, ahead, behind


@compiled(_nrt=False)
def increment_modulus(
    pieces: Array,
    component: int,
    x: float,
    x_old: float,
) -> tuple[float, float, float]:
    """Return the mean modulus (MPa) from x_old to x, and its derivatives by x and by x_old.

    `pieces` is (3, P, 5): upper end and cubic (MPa) of each piece.
    """
    a = x_old
    b = x
    sign = 1.0
    if component == 2 and x <= 0.0 and x_old <= 0.0:
        a = -x_old
        b = -x
        sign = -1.0
    end = pieces[component, pieces.shape[1] - 1, 0]
    # A strain that is not a number fails these comparisons, and the mean is not a number.
    if component != 2 and a <= 0.0 and b <= 0.0:
        return pieces[component, 0, 4], 0.0, 0.0
    if a >= end and b >= end:
        return point_modulus(pieces, component, end), 0.0, 0.0
    low = min(a, b)
    high = max(a, b)
    k = _place(pieces, component, high)
    start = pieces[component, k - 1, 0] if k > 0 else 0.0
    if not (low >= start and high <= pieces[component, k, 0]):
        return _across(pieces, component, x, x_old)
    third = pieces[component, k, 1]
    second = pieces[component, k, 2]
    first = pieces[component, k, 3]
    mean = _mean_of_piece(pieces, component, k, a, b)
    ab = 2.0 * a * b
    aa = a * a
    bb = b * b
    ahead = third * (0.25 * (aa + ab + 3.0 * bb)) + second * ((a + 2.0 * b) * (1.0 / 3.0))
    behind = third * (0.25 * (3.0 * aa + ab + bb)) + second * ((2.0 * a + b) * (1.0 / 3.0))
    return mean, sign * (ahead + 0.5 * first), sign * (behind + 0.5 * first)


@compiled(internal=True)
def _add(
    weights: Array,
    k: int,
    share: float,
    a: float,
    b: float,
) -> None:
    """Add a share of the mean powers of the strain from a to b to the weights (P, 4) of piece k."""
    third, second, first = _means(a, b)
    weights[k, 0] += share * third
    weights[k, 1] += share * second
    weights[k, 2] += share * first
    weights[k, 3] += share


@compiled(internal=True)
def _add_way(
    pieces: Array,
    component: int,
    low: float,
    high: float,
    length: float,
    weights: Array,
) -> None:
    """Add the weights of the pieces from low to high, part of an increment of size `length`."""
    start = 0.0
    if low < 0.0:
        _add(weights, 0, (min(high, 0.0) - low) / length, 0.0, 0.0)
    for k in range(_place(pieces, component, high) + 1):
        end = pieces[component, k, 0]
        a = max(low, start)
        b = min(high, end)
        if b > a:
            _add(weights, k, (b - a) / length, a, b)
        if high > end and k == pieces.shape[1] - 1:
            _add(weights, k, (high - max(low, end)) / length, end, end)
        start = end


@compiled(_nrt=False)
def by_pieces(
    pieces: Array,
    component: int,
    x: float,
    x_old: float,
    weights: Array,
) -> tuple[int, int]:
    """Write d mean modulus / d coefficients of each piece; return the range of pieces.

    Parameters
    ----------
    pieces : (3, P, 5) array
        Upper end and cubic (MPa) of each piece of the moduli.
    component : int
    x, x_old : float
        Strain at the end and at the start of the increment.
    weights : (P, 4) array
        Written in the range that is returned.
    """
    a = x_old
    b = x
    length = abs(x - x_old)
    if component == 2 and x * x_old >= 0.0:
        a = abs(x_old)
        b = abs(x)
    if length < TINY:
        a = b = 0.5 * (a + b)
    low = min(a, b)
    high = max(a, b)
    k = _place(pieces, component, high)
    start = pieces[component, k - 1, 0] if k > 0 else 0.0
    if low >= start and high <= pieces[component, k, 0]:
        weights[k, 0], weights[k, 1], weights[k, 2] = _means(a, b)
        weights[k, 3] = 1.0
        return k, k + 1
    turns = component == 2 and low < 0.0  # the shear changes its sign
    first = 0 if turns else _place(pieces, component, low)
    stop = max(k, _place(pieces, component, -low)) + 1 if turns else k + 1
    for i in range(first, stop):
        weights[i] = 0.0
    if length < TINY:
        in_range = min(max(abs(low) if turns else low, 0.0), pieces[component, stop - 1, 0])
        _add(weights, stop - 1, 1.0, in_range, in_range)
    elif turns:
        _add_way(
            pieces,
            component,
            0.0,
            high,
            length,
            weights,
        )
        _add_way(
            pieces,
            component,
            0.0,
            -low,
            length,
            weights,
        )
    else:
        _add_way(
            pieces,
            component,
            low,
            high,
            length,
            weights,
        )
    return first, stop


@compiled(internal=True)
def modulus_slopes(  # type: ignore[no-untyped-def]
    law,
    of_law,
    component,
    x,
    x_old,
    weights,
    row,
):
    """Write the derivatives of the mean of a modulus over an increment by p parameters.

    Parameters
    ----------
    law : CompiledLaw
    of_law : LawSlopes
        By the parameters.
    component : int
        WARP, FILL or SHEAR, of E1, E2 or G12.
    x, x_old : float
        Strain on which it depends, at the end and at the start.
    weights : (P, 4) array
        Scratch for the weights of the powers of the strain in each piece.
    row : (p,) array
        Written.
    """
    first, stop = by_pieces(law.pieces, component, x, x_old, weights)
    row[:] = 0.0
    for k in range(first, stop):
        w0 = weights[k, 0]
        w1 = weights[k, 1]
        w2 = weights[k, 2]
        w3 = weights[k, 3]
        third, second, first_power, constant = of_law.rows[component, k]
        for j in range(row.shape[0]):
            row[j] += w0 * third[j] + w1 * second[j] + w2 * first_power[j] + w3 * constant[j]
