"""The load ratio of one increment at one integration point, compiled.

Stresses s1, s2 along warp and fill have the normalised load ratios

    gamma1 = s1 / sqrt(s1^2 + s2^2) = cos(angle),    gamma2 = s2 / sqrt(s1^2 + s2^2) = sin(angle),

an angle from 0 (only the warp carries) to a right angle (only the fill does). They are ratios of
tension: a yarn that is pressed beside one that is pulled counts as one without load, where both
are pressed the ratios are those of |s2| : |s1| (so they stay continuous), and without any stress
the ratio is 1:1.

An increment takes the ratio of its MEAN stress, (s_old + s_new)/2, so that a path on which the
stresses grow in proportion has constant moduli in any number of increments, and the error on
others goes with the square of the increment. s_new depends on the moduli and they on it: the
angle is the root of one equation, which there always is, because the angle of the mean stress is
between 0 and a right angle whatever the moduli.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..caching import compiled
from .forms.base import EVEN

Array = NDArray[np.float64]

RIGHT = 0.5 * math.pi
#: Steps to the angle; half the range each, where Newton's leave it.
ROUNDS = 60
#: Radians.
ROUNDING = 1e-15


@compiled()
def load_angle(warp: float, fill: float) -> tuple[float, float, float]:
    """The angle of the load ratio of two stresses, and its derivatives by them."""
    square = warp * warp + fill * fill
    if warp > 0.0 or fill > 0.0:
        if warp <= 0.0:
            return RIGHT, 0.0, 0.0
        if fill <= 0.0:
            return 0.0, 0.0, 0.0
        if square == 0.0:
            return math.atan2(fill, warp), 0.0, 0.0
        return math.atan2(fill, warp), -fill / square, warp / square
    if square == 0.0:
        return 0.5 * RIGHT, 0.0, 0.0
    # A stress that is not a number gives an angle that is none.
    return math.atan2(-warp, -fill), fill / square, -warp / square


@compiled()
def mean_ratio(
    warp: float, fill: float, coupling: Array, old0: float, old1: float, dh0: float, dh1: float
) -> tuple[float, float, float, float, float, float]:
    """The load ratio of an increment's mean stress, and how the stress depends on itself by it.

    warp, fill : E1, E2 at 1:1, MPa; old0, old1 : stress at the start; dh0, dh1 : strain increment.

    Returns gamma1 and gamma2 less those at 1:1; u (2), half the derivative of the stress by the
    angle; w (2), such that a change r of the stress at a fixed ratio is a change r + u (w . r) of
    it altogether. gamma1 is not a number where a modulus, or 1 - nu12 nu21, is not positive on
    the way.
    """
    nu = coupling[0]
    angle = load_angle(old0, old1)[0]
    low, high = 0.0, RIGHT
    u0 = u1 = w0 = w1 = turn = cosine = sine = 0.0
    for _ in range(ROUNDS):
        cosine, sine = math.cos(angle), math.sin(angle)
        e1, e2 = warp + coupling[1] * (cosine - EVEN), fill + coupling[2] * (sine - EVEN)
        if not (e1 > 0.0 and e2 > 0.0):
            return math.nan, 0.0, 0.0, 0.0, 0.0, 0.0
        nu_nu = nu * nu * e2 / e1
        if not 1.0 - nu_nu > 1e-3:
            return math.nan, 0.0, 0.0, 0.0, 0.0, 0.0
        inv = 1.0 / (1.0 - nu_nu)
        d11, d22 = e1 * inv, e2 * inv
        d12 = nu * d22
        # By the angle: E1 loses what its ratio loses, E2 gains what its ratio gains.
        by1, by2 = -coupling[1] * sine, coupling[2] * cosine
        inv2 = inv * inv
        d11_by = (inv - nu_nu * inv2) * by1 + nu * nu * inv2 * by2
        d22_by = -nu_nu * inv2 * (e2 / e1) * by1 + inv2 * by2
        u0 = 0.5 * (d11_by * dh0 + nu * d22_by * dh1)
        u1 = 0.5 * (nu * d22_by * dh0 + d22_by * dh1)
        mean0 = old0 + 0.5 * (d11 * dh0 + d12 * dh1)
        mean1 = old1 + 0.5 * (d12 * dh0 + d22 * dh1)
        at, w0, w1 = load_angle(mean0, mean1)
        turn = 1.0 - (w0 * u0 + w1 * u1)
        off = at - angle
        if abs(off) <= ROUNDING or not off == off:
            break
        if off > 0.0:
            low = angle
        else:
            high = angle
        ahead = angle + off / turn if turn > 0.0 else -1.0
        if not (low < ahead < high):
            # The ends are angles of their own, where one yarn carries all.
            ahead = at if (at == 0.0 or at == RIGHT) and low <= at <= high else 0.5 * (low + high)
        if abs(ahead - angle) <= ROUNDING:
            break
        angle = ahead
    if not turn > 0.0:
        return math.nan, 0.0, 0.0, 0.0, 0.0, 0.0
    return cosine - EVEN, sine - EVEN, u0, u1, w0 / turn, w1 / turn
