"""Tension field: a membrane that wrinkles instead of carrying compression, compiled.

A wrinkle takes up strain across itself without stress. At a point with total strain h the fabric
itself is strained by h + w, the wrinkle strain w = size n n' (n its normal), or any contraction
where it is slack, such that the Cauchy stress s obeys

    s >= 0 (no principal compression),  w >= 0,  s : w = 0,

which for a linear law is the projection of the trial stress on the tensile ones in the norm of
the compliance (Roddeman et al., J. Appl. Mech. 54 (1987) 884; Del Piero, Meccanica 24 (1989)).
The law is integrated along the strain of the fabric, h + w. What is left to the wrinkle strain is
a share of the stiffness at zero strain, so that wrinkled and slack parts keep a tangent.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..caching import compiled
from .point_law import log_strain, referred_stress, stress_update
from .point_moduli import increment_modulus
from .wrinkles import ROUNDING, least_principal, slack, wrinkled

Array = NDArray[np.float64]


@compiled()
def relaxed_update(
    pieces: Array, coupling: Array, share: float, h: Array, h_old: Array, s_old: Array,
    he: Array, s_new: Array, carried: Array, tangent: Array, slopes: Array, strain_slope: Array,
) -> int:  # fmt: skip
    """As `stress_update`, for a membrane that wrinkles.

    h (3,) total strain at the end; h_old, s_old (3,) strain and stress OF THE FABRIC at the start.
    share : of the stiffness at zero strain, left to the wrinkle strain.

    Writes he, s_new (3,) strain and stress of the fabric at the end; carried (3,) the stress with
    the share of the wrinkle strain, tangent (3, 3) its derivative by h, and strain_slope (3, 3)
    that of he. Returns 0 where the membrane is taut, 1 where it wrinkles, 2 where it is slack, and
    -1 where there is no stress, as in `stress_update`.
    """
    strain_slope[:] = 0.0
    for i in range(3):
        he[i] = h[i]
        strain_slope[i, i] = 1.0
    if not stress_update(pieces, coupling, h, h_old, s_old, s_new, tangent, slopes):
        return -1
    if least_principal(s_new[0], s_new[1], s_new[2]) >= -ROUNDING * tangent[0, 0]:
        carried[:] = s_new
        return 0
    t0, t1, t2 = s_new[0], s_new[1], s_new[2]
    state, away = 1, (0.0, 0.0)
    if slack(pieces, coupling, h_old, s_old, he, s_new, tangent, slopes):
        w0, w1, w2 = he[0] - h[0], he[1] - h[1], 0.5 * (he[2] - h[2])
        if least_principal(w0, w1, w2) >= -ROUNDING:
            state = 2
            strain_slope[:] = 0.0
        away = (
            0.5 * math.atan2(w2, 0.5 * (w0 - w1)),
            0.5 * (w0 + w1) + math.hypot(0.5 * (w0 - w1), w2),
        )
    if state == 1:
        s_new[0], s_new[1], s_new[2] = t0, t1, t2
        if not wrinkled(
            pieces, coupling, h, h_old, s_old, away, he, s_new, tangent, slopes, strain_slope
        ):  # fmt: skip
            return -1
    nu = coupling[0]
    warp = increment_modulus(pieces, 0, 0.0, 0.0)[0]
    fill = increment_modulus(pieces, 1, 0.0, 0.0)[0]
    rest = np.zeros((3, 3))
    rest[0, 0] = share * warp / (1.0 - nu * nu * fill / warp)
    rest[1, 1] = rest[0, 0] * fill / warp
    rest[0, 1] = rest[1, 0] = nu * rest[1, 1]
    rest[2, 2] = share * increment_modulus(pieces, 2, 0.0, 0.0)[0]
    total = np.zeros((3, 3))
    for i in range(3):
        carried[i] = s_new[i]
        for j in range(3):
            carried[i] -= rest[i, j] * (he[j] - h[j])
            for k in range(3):
                total[i, j] += (tangent[i, k] - rest[i, k]) * strain_slope[k, j]
            total[i, j] += rest[i, j]
    tangent[:] = total
    return state


@compiled()
def relaxed_membrane_stress(
    m: float, q: float, c: float, pieces: Array, coupling: Array, area_power: float,
    share: float, h_old: Array, s_old: Array, h: Array, he: Array, s_new: Array, pk2: Array,
    stiffness: Array, p: Array, law_tangent: Array, slopes: Array, pull: Array, work: Array,
) -> int:  # fmt: skip
    """As `membrane_stress`, for a membrane that wrinkles; returns as `relaxed_update`.

    The stress resultant goes with the area of the fabric, not with that of the wrinkled surface.
    """
    if not log_strain(m, q, c, h, p):
        return -1
    carried, slope = np.empty(3), np.empty((3, 3))
    state = relaxed_update(
        pieces, coupling, share, h, h_old, s_old, he, s_new, carried, law_tangent, slopes, slope
    )
    if state < 0:
        return -1
    ratio = math.exp(area_power * (he[0] + he[1]))
    growth = (
        area_power * (slope[0, 0] + slope[1, 0]),
        area_power * (slope[0, 1] + slope[1, 1]),
        area_power * (slope[0, 2] + slope[1, 2]),
    )
    referred_stress(m, q, c, ratio, growth, carried, pk2, stiffness, p, law_tangent, pull, work)
    return state
