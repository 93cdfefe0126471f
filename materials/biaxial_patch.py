"""Solve a patch without shear under loads along warp and fill, an increment a load.

Loads are per width before the test:

    n1 = t0 (J2)^p sigma1 / lambda1,    n2 = t0 (J2)^p sigma2 / lambda2,   J2 = lambda1 lambda2
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compilation import compiled
from .forms.base import Array
from .law import HypoelasticLaw, law_slopes
from .pieces import by_pieces
from .point_law import SLOPES, stress_rate, stress_update

#: Newton iterations of one load, and halvings of a step that does not come nearer.
MAX_ITERATIONS = 60
MAX_HALVINGS = 40
#: Unbalanced force, over the largest load, that is taken as none, and up to which rounding may
#: end the iteration.
FORCE_TOLERANCE = 1e-13
ROUNDING = 1e-9
#: kN/m: no fabric carries more.
LARGEST_LOAD = 1000.0


@dataclass(frozen=True, eq=False)
class BiaxialResponse:
    """A patch at one load after the other, as far as there is an equilibrium; NaN beyond.

    Attributes
    ----------
    strain : (n, 2) ndarray
        Logarithmic strain along warp and fill.
    stress : (n, 2) ndarray, MPa
        Cauchy stress.
    slope : (n, 2, parameters) ndarray
        Derivatives of the strain.
    reached : int
        Number of loads with an equilibrium.
    stable : (n,) ndarray of bool
        Whether every further strain takes work.
    """

    strain: Array
    stress: Array
    slope: Array
    reached: int
    stable: NDArray[np.bool_]

    @property
    def elongation(self) -> Array:
        """Return (n, 2) change of length over the length before the test."""
        return np.expm1(self.strain)


def biaxial_response(
    law: HypoelasticLaw, loads: ArrayLike, thickness: float, parameters: Sequence[str] = ()
) -> BiaxialResponse:
    """Compute a patch's strains under one load after the other.

    Parameters
    ----------
    law : HypoelasticLaw
    loads : (n, 2) array_like, N/mm
        Along warp and fill, per width before the test.
    thickness : float, mm
    parameters : sequence of str
        By which the strains are differentiated, see `law.law_slopes`.
    """
    load_path = np.ascontiguousarray(np.atleast_2d(np.asarray(loads, dtype=float)))
    rows, by_coupling = law_slopes(law, parameters, thickness)
    strain, stress = np.full((2, len(load_path), 2), np.nan)
    slope = np.full((len(load_path), 2, len(parameters)), np.nan)
    stable = np.zeros(len(load_path), dtype=bool)
    sheet = (law.pieces, law.coupling, law.area_power, thickness)
    reached = _follow_loads(sheet, load_path, rows, by_coupling, strain, stress, slope, stable)
    return BiaxialResponse(strain, stress, slope, int(reached), stable)


def largest_load(
    law: HypoelasticLaw, thickness: float, shares: Sequence[tuple[float, float]], ends: ArrayLike
) -> float:
    """Find the load up to which the strains of every ratio stay within ends.

    Parameters
    ----------
    law : HypoelasticLaw
    thickness : float, mm
    shares : sequence of (float, float)
        Of the larger load along warp and fill, a pair for each ratio.
    ends : (2,) array_like
        Largest logarithmic strains.

    Returns
    -------
    float, kN/m
        The larger of the two loads; 0 where there is none.
    """
    largest_strain = np.asarray(ends, dtype=float)
    increments = 20
    halvings = 50

    def stays_within(load: float) -> bool:
        larger = np.linspace(0.0, load, increments + 1)[1:]
        for pair in shares:
            response = biaxial_response(law, np.outer(larger, pair), thickness)
            if response.reached < increments or not (response.strain <= largest_strain).all():
                return False
        return True

    low = 0.0
    high = LARGEST_LOAD
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        if stays_within(middle):
            low = middle
        else:
            high = middle
    return low


@compiled()
def _unbalanced(  # type: ignore[no-untyped-def]
    sheet, load, h_old, s_old, h, s, tangent, slopes, unbalanced, k
):
    """Write forces per width less the load to rest (2,), derivatives to k (2, 2).

    sheet : pieces, coupling, area power and thickness (mm) of the law. False where it ends.
    """
    pieces, coupling, power, thickness = sheet
    if not stress_update(pieces, coupling, h, h_old, s_old, s, tangent, slopes):
        return False
    for i in range(2):
        arm = thickness * math.exp(power * (h[0] + h[1]) - h[i])
        unbalanced[i] = arm * s[i] - load[i]
        for j in range(2):
            k[i, j] = arm * (tangent[i, j] + power * s[i])
        k[i, i] -= arm * s[i]
    return True


@compiled()
def _size(force):  # type: ignore[no-untyped-def]
    return max(abs(force[0]), abs(force[1]))


@compiled()
def _equilibrium(  # type: ignore[no-untyped-def]
    sheet, load, largest, h_old, s_old, h, s, tangent, slopes, unbalanced, k
):
    """Write the strain h (3,) under a load, and what `_unbalanced` writes there; False for none."""
    trial = np.zeros(3)
    step = np.empty(2)
    good = _unbalanced(sheet, load, h_old, s_old, h, s, tangent, slopes, unbalanced, k)
    for _ in range(MAX_ITERATIONS):
        if not good or _size(unbalanced) <= FORCE_TOLERANCE * largest:
            break
        size_before = _size(unbalanced)
        det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
        step[0] = (k[0, 1] * unbalanced[1] - k[1, 1] * unbalanced[0]) / det
        step[1] = (k[1, 0] * unbalanced[0] - k[0, 0] * unbalanced[1]) / det
        share = 1.0
        for _ in range(MAX_HALVINGS):
            trial[0] = h[0] + share * step[0]
            trial[1] = h[1] + share * step[1]
            good = _unbalanced(sheet, load, h_old, s_old, trial, s, tangent, slopes, unbalanced, k)
            if good and (_size(unbalanced) < size_before or size_before < ROUNDING * largest):
                break
            share *= 0.5
        h[:] = trial
        if size_before < ROUNDING * largest and _size(unbalanced) >= size_before:
            break
    return good and _size(unbalanced) <= ROUNDING * largest


@compiled()
def _follow_loads(  # type: ignore[no-untyped-def]
    sheet, loads, rows, by_coupling, strain, stress, slope, stable
):
    """Solve load by load; return how many have an equilibrium."""
    pieces, coupling, power, thickness = sheet
    count = by_coupling.shape[1]
    h = np.zeros(3)
    h_old = np.zeros(3)
    s = np.zeros(3)
    s_old = np.zeros(3)
    tangent = np.empty((3, 3))
    slopes = np.empty(SLOPES)
    unbalanced = np.empty(2)
    k = np.empty((2, 2))
    weights = np.empty((pieces.shape[1], 4))
    dh = np.zeros((2, count))
    ds = np.zeros((2, count))
    of_moduli = np.zeros((2, count))
    largest = 1e-12
    for n in range(len(loads)):
        load = loads[n]
        largest = max(largest, max(abs(load[0]), abs(load[1])))
        h[:] = h_old
        if not _equilibrium(
            sheet, load, largest, h_old, s_old, h, s, tangent, slopes, unbalanced, k
        ):
            return n
        det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
        a = k[0, 0] * math.exp(-h[0])
        b = k[1, 1] * math.exp(-h[1])
        across = 0.5 * (k[0, 1] * math.exp(-h[1]) + k[1, 0] * math.exp(-h[0]))
        stable[n] = a > 0.0 and a * b > across * across
        if count > 0:
            of_moduli[:] = 0.0
            for i in range(2):
                first, stop = by_pieces(pieces, i, h[i], h_old[i], weights)
                for piece in range(first, stop):
                    for degree in range(4):
                        for j in range(count):
                            of_moduli[i, j] += weights[piece, degree] * rows[i, piece, degree, j]
            arm0 = thickness * math.exp(power * (h[0] + h[1]) - h[0])
            arm1 = thickness * math.exp(power * (h[0] + h[1]) - h[1])
            for j in range(count):
                stress_rate(slopes, coupling[0], of_moduli, by_coupling, j, dh, ds, ds)
                a0 = ds[0, j]
                a1 = ds[1, j]
                r0 = arm0 * a0
                r1 = arm1 * a1
                dh[0, j] = (k[0, 1] * r1 - k[1, 1] * r0) / det
                dh[1, j] = (k[1, 0] * r0 - k[0, 0] * r1) / det
                ds[0, j] = a0 + tangent[0, 0] * dh[0, j] + tangent[0, 1] * dh[1, j]
                ds[1, j] = a1 + tangent[1, 0] * dh[0, j] + tangent[1, 1] * dh[1, j]
                slope[n, 0, j] = dh[0, j]
                slope[n, 1, j] = dh[1, j]
        for i in range(2):
            strain[n, i] = h[i]
            stress[n, i] = s[i]
        h_old[:] = h
        s_old[:] = s
    return len(loads)
