"""What the law answers in a biaxial test: strains of a patch at loads per width along its yarns.

The patch is homogeneous, and warp and fill stay perpendicular: the shear is zero. A load per width
is a force over the width that the sheet had before the test, as a cruciform's machine counts it:

    n1 = t0 (J2)^p sigma1 / lambda1,    n2 = t0 (J2)^p sigma2 / lambda2,

J2 = lambda1 lambda2 the area ratio, p the law's `area_power`. The law is integrated from load to
load, one increment each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..caching import compiled
from .law import HypoelasticLaw
from .law_slopes import law_slopes
from .point_law import (
    BEFORE1,
    BEFORE2,
    BY1,
    BY2,
    D11,
    D11_E1,
    D11_E2,
    D11_NU,
    D12,
    D22,
    D22_E1,
    D22_E2,
    D22_NU,
    RATIO1,
    RATIO2,
    SLOPES,
    TURN1,
    TURN2,
    stress_update,
)
from .point_moduli import by_pieces

Array = NDArray[np.float64]

#: Newton iterations of one load, and halvings of a step that does not come nearer.
ROUNDS, HALVINGS = 60, 40
#: Of the largest load: what is left of an equilibrium's forces.
TOLERANCE = 1e-13


@dataclass(frozen=True, eq=False)
class BiaxialResponse:
    """A patch at one load after the other.

    strain : (n, 2) logarithmic, along warp and fill. stress : (n, 2) MPa, Cauchy. slope : (n, 2,
    parameters) derivatives of the strain. reached : how many loads have an equilibrium; rows
    beyond are NaN. stable : (n,) whether every small stretch of the patch takes work.
    """

    strain: Array
    stress: Array
    slope: Array
    reached: int
    stable: NDArray[np.bool_]

    @property
    def elongation(self) -> Array:
        """(n, 2) change of length over the length before the test."""
        return np.expm1(self.strain)


def biaxial_response(
    law: HypoelasticLaw, loads: ArrayLike, thickness: float, parameters: Sequence[str] = ()
) -> BiaxialResponse:
    """The strains of a patch, from the unloaded state.

    Parameters
    ----------
    loads : (n, 2) N/mm (kN/m) along warp and fill, one increment of the law each.
    thickness : mm, before the test.
    parameters : by which the strain is differentiated: "beta_i" (per MPa), "nu12" and
        "thickness" (per mm).
    """
    asked = np.ascontiguousarray(np.atleast_2d(np.asarray(loads, dtype=float)))
    rows, by_coupling = law_slopes(law, parameters, thickness)
    strain, stress = np.full((2, len(asked), 2), np.nan)
    slope = np.full((len(asked), 2, len(parameters)), np.nan)
    stable = np.zeros(len(asked), dtype=bool)
    reached = _path(
        law.pieces, law.coupling, law.area_power, thickness, asked, rows, by_coupling, strain,
        stress, slope, stable,
    )  # fmt: skip
    return BiaxialResponse(strain, stress, slope, int(reached), stable)


@compiled()
def _forces(  # type: ignore[no-untyped-def]
    pieces, coupling, power, thickness, load, h_old, s_old, h, s, tangent, slopes, rest, k
):
    """Forces per width less the load into rest (2,), their derivatives by h into k (2, 2).

    False where a modulus is not positive.
    """
    if not stress_update(pieces, coupling, h, h_old, s_old, s, tangent, slopes):
        return False
    for i in range(2):
        arm = thickness * math.exp(power * (h[0] + h[1]) - h[i])
        rest[i] = arm * s[i] - load[i]
        for j in range(2):
            k[i, j] = arm * (tangent[i, j] + power * s[i])
        k[i, i] -= arm * s[i]
    return True


@compiled()
def _size(rest):  # type: ignore[no-untyped-def]
    return max(abs(rest[0]), abs(rest[1]))


@compiled()
def _path(  # type: ignore[no-untyped-def]
    pieces, coupling, power, thickness, loads, rows, by_coupling, strain, stress, slope, stable
):
    """Load by load; how many have an equilibrium."""
    nu, by_nu, count = coupling[0], by_coupling[0], by_coupling.shape[1]
    h, h_old, trial, s, s_old = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    tangent, slopes = np.empty((3, 3)), np.empty(SLOPES)
    rest, k, step = np.empty(2), np.empty((2, 2)), np.empty(2)
    weights = np.empty((pieces.shape[1], 4))
    dh, ds, own = np.zeros((2, count)), np.zeros((2, count)), np.zeros((2, count))
    largest = 1e-12
    for n in range(len(loads)):
        load = loads[n]
        largest = max(largest, max(abs(load[0]), abs(load[1])))
        h[:] = h_old
        good = _forces(
            pieces, coupling, power, thickness, load, h_old, s_old, h, s, tangent, slopes, rest, k
        )
        for _ in range(ROUNDS):
            if not good or _size(rest) <= TOLERANCE * largest:
                break
            before = _size(rest)
            det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
            step[0] = (k[0, 1] * rest[1] - k[1, 1] * rest[0]) / det
            step[1] = (k[1, 0] * rest[0] - k[0, 0] * rest[1]) / det
            share = 1.0
            for _ in range(HALVINGS):
                trial[0], trial[1] = h[0] + share * step[0], h[1] + share * step[1]
                good = _forces(
                    pieces, coupling, power, thickness, load, h_old, s_old, trial, s, tangent,
                    slopes, rest, k,
                )  # fmt: skip
                if good and (_size(rest) < before or before < 1e-9 * largest):
                    break
                share *= 0.5
            h[:] = trial
            if before < 1e-9 * largest and _size(rest) >= before:
                break  # rounding
        if not good or not _size(rest) <= 1e-9 * largest:
            return n
        det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
        a, b = k[0, 0] * math.exp(-h[0]), k[1, 1] * math.exp(-h[1])
        across = 0.5 * (k[0, 1] * math.exp(-h[1]) + k[1, 0] * math.exp(-h[0]))
        stable[n] = a > 0.0 and a * b > across * across
        if count > 0:
            own[:] = 0.0
            for i in range(2):
                first, stop = by_pieces(pieces, i, h[i], h_old[i], weights)
                for piece in range(first, stop):
                    for power_of in range(4):
                        for j in range(count):
                            own[i, j] += weights[piece, power_of] * rows[i, piece, power_of, j]
            w, f = h[0] - h_old[0], h[1] - h_old[1]
            arm0 = thickness * math.exp(power * (h[0] + h[1]) - h[0])
            arm1 = thickness * math.exp(power * (h[0] + h[1]) - h[1])
            for j in range(count):
                o0, o1 = dh[0, j], dh[1, j]
                warp = own[0, j] + o0 * slopes[BEFORE1] + by_coupling[1, j] * slopes[RATIO1]
                fill = own[1, j] + o1 * slopes[BEFORE2] + by_coupling[2, j] * slopes[RATIO2]
                d11 = slopes[D11_E1] * warp + slopes[D11_E2] * fill + by_nu[j] * slopes[D11_NU]
                d22 = slopes[D22_E1] * warp + slopes[D22_E2] * fill + by_nu[j] * slopes[D22_NU]
                d12 = nu * d22 + by_nu[j] * slopes[D22]
                a0 = ds[0, j] + d11 * w + d12 * f - slopes[D11] * o0 - slopes[D12] * o1
                a1 = ds[1, j] + d12 * w + d22 * f - slopes[D12] * o0 - slopes[D22] * o1
                turn = slopes[BY1] * (a0 + ds[0, j]) + slopes[BY2] * (a1 + ds[1, j])
                a0 += turn * slopes[TURN1]
                a1 += turn * slopes[TURN2]
                r0, r1 = arm0 * a0, arm1 * a1
                dh[0, j] = (k[0, 1] * r1 - k[1, 1] * r0) / det
                dh[1, j] = (k[1, 0] * r0 - k[0, 0] * r1) / det
                ds[0, j] = a0 + tangent[0, 0] * dh[0, j] + tangent[0, 1] * dh[1, j]
                ds[1, j] = a1 + tangent[1, 0] * dh[0, j] + tangent[1, 1] * dh[1, j]
                slope[n, 0, j], slope[n, 1, j] = dh[0, j], dh[1, j]
        for i in range(2):
            strain[n, i], stress[n, i] = h[i], s[i]
        h_old[:] = h
        s_old[:] = s
    return len(loads)
