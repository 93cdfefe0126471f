"""The material law at one integration point, compiled: strains, stress update and tangent.

The vectorised law (`law.py`) and the membrane solver call it in compiled loops. In-plane
Cauchy-Green components C11, C22, C12 in the (warp, fill) frame enter through m = (C11 + C22)/2, q =
(C11 - C22)/2, c = C12. Strains are (eps1, eps2, gamma12); Green-Lagrange strain E = ((C11-1)/2,
(C22-1)/2, C12), so that dm = dE1 + dE2, dq = dE1 - dE2, dc = dE3.

`pieces` (3, P, 5) are as `forms.base.pieces_of` writes them. The modulus of an increment is its
MEAN over the strains x_old to x, (F(x) - F(x_old))/(x - x_old) with F its integral: the stress of a
bar is exact in any number of increments, and d(stress)/d(strain) is the modulus at the END of the
increment. Nothing here is compiled with `fastmath`, which gains no time: results are the same bit
by bit, whichever function was compiled first.
"""

import math
from typing import NamedTuple

from ..compilation import compiled
from .forms.base import EVEN, Array
from .memory import recalled_modulus
from .pieces import (
    FILL,
    SHEAR,
    WARP,
    CauchyGreen,
    CompiledLaw,
    Coupling,
    LawTangent,
    PointResponse,
    PointState,
    increment_modulus,
)

#: Positions in the vector `slopes` (SLOPES entries) that `stress_update` writes for `stress_rates`.
#: D11_E1 is dD11/dE1 and so on, D11_NU dD11/dnu12; `stress_update` explains the others. At AHEAD
#: and at BEHIND a (2, 2) matrix begins, at CRIMP one of (2, 3), all row by row.
(
    D11,
    D12,
    D22,
    G12,
    D11_E1,
    D11_E2,
    D22_E1,
    D22_E2,
    BEFORE1,
    BEFORE2,
    BEFORE3,
    D11_NU,
    D22_NU,
    RATIO1,
    RATIO2,
    TAKEN1,
    TAKEN2,
    AHEAD,
) = range(18)
BEHIND, CRIMP = AHEAD + 4, AHEAD + 8
#: Number of entries of `CompiledLaw.coupling` of a law with crimp: nu12, the gains of E1 and E2 by
#: their load ratios, then T1, T2 and S.
CRIMPED = 6

# First section: the load ratio of one increment, on which E1 and E2 may depend.
#
# Stresses along warp and fill have the normalised load ratios gamma1 = s1 / sqrt(s1^2 + s2^2) =
# cos(angle), gamma2 = sin(angle), from 0 (only the warp carries) to a right angle. They are ratios
# of tension: a yarn in compression beside one in tension counts as one without load; where both are
# in compression gamma1 : gamma2 is |s2| : |s1|; without any stress the ratio is 1:1.
#
# The moduli of an increment are taken at the load ratio of its MEAN stress, (s_old + s_new)/2: a
# path of proportional loads then has the same ratio in every increment, and other paths have an
# error of second order in the increment. As s_new depends on the moduli and they on s_new, the
# angle is the root of one equation, between 0 and a right angle.

RIGHT = 0.5 * math.pi
#: Largest number of iterations in the search of the angle, and of the crimp exchange below: each is
#: a Newton step or, where that leaves the bracket, a bisection.
ROUNDS = 60
#: A step of the angle (radians), or of the exchange, of at most this size ends the search.
ROUNDING = 1e-15


@compiled()
def load_angle(warp: float, fill: float) -> tuple[float, float, float]:
    """Return the angle (radians) of the load ratio of two stresses, and its derivatives by them.

    Parameters
    ----------
    warp, fill : float, MPa
        Stress along the yarns.
    """
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


class AtLoadRatio(NamedTuple):
    """The stiffness of an increment with E1 and E2 at one load ratio.

    Attributes
    ----------
    is_valid : bool
        Whether E1, E2 and 1 - nu12 nu21 are positive; the other numbers mean nothing if not.
    cosine, sine : float
        Of the angle of the load ratio, gamma1 and gamma2.
    d11, d12, d22 : float, MPa
        Plane stiffness along the yarns.
    u0, u1 : float, MPa
        Derivatives of the MEAN stress of the increment along warp and fill by the angle, half those
        of the stress at its end.
    """

    is_valid: bool
    cosine: float
    sine: float
    d11: float
    d12: float
    d22: float
    u0: float
    u1: float


@compiled(internal=True)
def _at_load_ratio(
    warp: float,
    fill: float,
    coupling: Coupling,
    angle: float,
    dh0: float,
    dh1: float,
) -> AtLoadRatio:
    """Return the stiffness of an increment at the angle (radians) of a load ratio.

    Parameters
    ----------
    warp, fill : float, MPa
        E1 and E2 at equal loads.
    coupling : Coupling
    angle : float
    dh0, dh1 : float
        The strain increment along the yarns.
    """
    # warp, fill are E1, E2 at equal loads, MPa; dh0, dh1 the strain increment along the yarns.
    nu = coupling[0]
    cosine = math.cos(angle)
    sine = math.sin(angle)
    e1 = warp + coupling[1] * (cosine - EVEN)
    e2 = fill + coupling[2] * (sine - EVEN)
    nu_nu = nu * nu * e2 / e1 if e1 > 0.0 and e2 > 0.0 else 1.0
    is_valid = 1.0 - nu_nu > 1e-3
    if not is_valid:  # numbers by which nothing is divided by zero
        e1 = e2 = 1.0
        nu_nu = 0.0
    inv = 1.0 / (1.0 - nu_nu)
    d11 = e1 * inv
    d22 = e2 * inv
    d12 = nu * d22
    # by1, by2 are dE1/dangle, dE2/dangle; d11_by, d22_by those of D11 and D22 (D12 is nu D22).
    by1 = -coupling[1] * sine
    by2 = coupling[2] * cosine
    inv2 = inv * inv
    d11_by = (inv - nu_nu * inv2) * by1 + nu * nu * inv2 * by2
    d22_by = -nu_nu * inv2 * (e2 / e1) * by1 + inv2 * by2
    u0 = 0.5 * (d11_by * dh0 + nu * d22_by * dh1)
    u1 = 0.5 * (nu * d22_by * dh0 + d22_by * dh1)
    return AtLoadRatio(
        is_valid,
        cosine,
        sine,
        d11,
        d12,
        d22,
        u0,
        u1,
    )


@compiled(internal=True)
def mean_ratio(
    warp: float,
    fill: float,
    coupling: Coupling,
    s_old: Array,
    dh0: float,
    dh1: float,
    slopes: Array,
) -> bool:
    """Find the load ratio of an increment's mean stress, and write it with its sensitivities.

    With u the derivative of the mean stress by the angle (`AtLoadRatio`) and w that of the angle by
    the mean stress, a change r of the end stress at a fixed angle makes a change A r of it once the
    angle follows, and a change b of the start stress adds B b: A = I + u w' / (1 - w'u), B = A - I.

    Parameters
    ----------
    warp, fill : float
        E1 and E2 at equal loads (1:1), MPa.
    coupling : tuple of float
        As `CompiledLaw.coupling`.
    s_old : (3,) array, MPa
        Stress at the start of the increment.
    dh0, dh1 : float
        Increments of the strain along warp and fill.
    slopes : (SLOPES,) array
        The load ratios less 1/sqrt 2 are written at RATIO1 and RATIO2, B at BEHIND; B is added to
        what stands at AHEAD.

    Returns
    -------
    bool
        False where a modulus or 1 - nu12 nu21 is not positive at an angle that was tried, or where
        the angle that was found is no regular root (1 - w'u is not positive).
    """
    angle = load_angle(s_old[0], s_old[1])[0]
    low = 0.0
    high = RIGHT
    turn = w0 = w1 = 0.0
    for _ in range(ROUNDS):
        trial = _at_load_ratio(
            warp,
            fill,
            coupling,
            angle,
            dh0,
            dh1,
        )
        if not trial.is_valid:
            return False
        mean0 = s_old[0] + 0.5 * (trial.d11 * dh0 + trial.d12 * dh1)
        mean1 = s_old[1] + 0.5 * (trial.d12 * dh0 + trial.d22 * dh1)
        mean_angle, w0, w1 = load_angle(mean0, mean1)
        turn = 1.0 - (w0 * trial.u0 + w1 * trial.u1)
        off = mean_angle - angle
        if abs(off) <= ROUNDING or not off == off:
            break
        if off > 0.0:
            low = angle
        else:
            high = angle
        newton = angle + off / turn if turn > 0.0 else -1.0
        if not (low < newton < high):
            # The ends are angles of their own, where one yarn carries all.
            is_end = (mean_angle == 0.0 or mean_angle == RIGHT) and low <= mean_angle <= high
            newton = mean_angle if is_end else 0.5 * (low + high)
        if abs(newton - angle) <= ROUNDING:
            break
        angle = newton
    if not turn > 0.0:
        return False
    slopes[RATIO1] = trial.cosine - EVEN
    slopes[RATIO2] = trial.sine - EVEN
    for i, by in ((0, w0 / turn), (1, w1 / turn)):
        slopes[BEHIND + i] = trial.u0 * by
        slopes[BEHIND + 2 + i] = trial.u1 * by
        slopes[AHEAD + i] += slopes[BEHIND + i]
        slopes[AHEAD + 2 + i] += slopes[BEHIND + 2 + i]
    return True


# Second section: the strains and stresses of a membrane, compiled.


@compiled(internal=True)
def _atanh_ratio(z: float) -> tuple[float, float]:
    """Return f(z) = atanh(sqrt z)/sqrt z and its derivative; the series avoids 0/0 near z = 0."""
    if z < 0.01:
        f = 1.0 + z * (1 / 3 + z * (1 / 5 + z * (1 / 7 + z * (1 / 9 + z * (1 / 11 + z / 13)))))
        slope = 1 / 3 + z * (
            2 / 5 + z * (3 / 7 + z * (4 / 9 + z * (5 / 11 + z * (6 / 13 + z * 7 / 15))))
        )
        return f + z**7 / 15, slope
    s = math.sqrt(z)
    f = math.atanh(s) / s
    return f, (1.0 / (1.0 - z) - f) / (2.0 * z)


@compiled(internal=True)
def log_strain(green: CauchyGreen, h: Array, p: Array) -> bool:
    """Write logarithmic strain h = (eps1, eps2, gamma12) and p = dh/dE (3, 3).

    E is the Green-Lagrange strain. Returns False when C is not positive definite, as of an element
    that an iterate of the solver has turned inside out.
    """
    m = green.m
    q = green.q
    c = green.c
    r = q * q + c * c
    det = m * m - r
    # Below 1e-20 the powers of m in the derivatives underflow.
    if not (m > 1e-20 and det > 1e-9 * m * m):
        return False
    f, f1 = _atanh_ratio(r / (m * m))
    b = f / m
    b_r = f1 / m**3
    b_m = -f / m**2 - 2.0 * r * f1 / m**4
    a = 0.5 * math.log(det)
    h[0] = 0.5 * (a + b * q)
    h[1] = 0.5 * (a - b * q)
    h[2] = b * c
    a_m = m / det
    a_q = -q / det
    a_c = -c / det
    b_q = 2.0 * q * b_r
    b_c = 2.0 * c * b_r
    u_m = b_m * q
    u_q = b + q * b_q
    u_c = q * b_c
    p[0, 0] = 0.5 * (a_m + u_m + a_q + u_q)
    p[0, 1] = 0.5 * (a_m + u_m - a_q - u_q)
    p[0, 2] = 0.5 * (a_c + u_c)
    p[1, 0] = 0.5 * (a_m - u_m + a_q - u_q)
    p[1, 1] = 0.5 * (a_m - u_m - a_q + u_q)
    p[1, 2] = 0.5 * (a_c - u_c)
    p[2, 0] = c * (b_m + b_q)
    p[2, 1] = c * (b_m - b_q)
    p[2, 2] = b + c * b_c
    return True


@compiled(internal=True)
def pull_back(
    green: CauchyGreen,
    t: Array,
    s: Array,
    w: Array,
    g: Array,
) -> None:
    """Write 2nd Piola-Kirchhoff stress s = U^-1 t U^-1 of the corotated stress t (times J).

    Also writes w = ds/dt (3, 3) and g = ds/dE at fixed t (3, 3), E the Green-Lagrange strain. The
    inverse of the stretch U has, for 2 x 2, the closed form k [[C22 + J, -C12], [-C12, C11 + J]]
    with J = sqrt(det C), the area ratio, and k = 1/(J sqrt(tr C + 2 J)).
    """
    m = green.m
    q = green.q
    c = green.c
    j = math.sqrt(m * m - q * q - c * c)
    root = math.sqrt(2.0 * (m + j))
    k = 1.0 / (root * j)
    a = m - q + j
    b = m + q + j
    w1 = k * a
    w2 = k * b
    w3 = -k * c
    w[0, 0] = w1 * w1
    w[0, 1] = w3 * w3
    w[0, 2] = 2.0 * w1 * w3
    w[1, 0] = w3 * w3
    w[1, 1] = w2 * w2
    w[1, 2] = 2.0 * w3 * w2
    w[2, 0] = w1 * w3
    w[2, 1] = w3 * w2
    w[2, 2] = w1 * w2 + w3 * w3
    for i in range(3):
        s[i] = w[i, 0] * t[0] + w[i, 1] * t[1] + w[i, 2] * t[2]
    for i in range(3):
        dm = 0.0 if i == 2 else 1.0
        dq = 1.0 if i == 0 else (-1.0 if i == 1 else 0.0)
        dc = 1.0 if i == 2 else 0.0
        dj = (m * dm - q * dq - c * dc) / j
        dk = -k * ((dm + dj) / (root * root) + dj / j)
        d1 = k * (dm - dq + dj) + a * dk
        d2 = k * (dm + dq + dj) + b * dk
        d3 = -k * dc - c * dk
        g[0, i] = 2.0 * (w1 * d1 * t[0] + (d1 * w3 + w1 * d3) * t[2] + w3 * d3 * t[1])
        g[1, i] = 2.0 * (w3 * d3 * t[0] + (d3 * w2 + w3 * d2) * t[2] + w2 * d2 * t[1])
        g[2, i] = (
            (d1 * w3 + w1 * d3) * t[0]
            + (d1 * w2 + w1 * d2 + 2.0 * w3 * d3) * t[2]
            + (d3 * w2 + w3 * d2) * t[1]
        )


# Third section: crimp that the two yarn families exchange (`forms/ratio.py`), compiled.
#
# Yarns are zigzags whose slopes without load are r1 = T1/S along the warp and r2 = T2/S along the
# fill; S (MPa) is the stiffness of the bed that the coating makes for the crossings. Under stresses
# s1, s2 along the yarns the slopes become r1 - w and r2 + w: w is the exchange of crimp. Balance of
# forces at a crossing gives w = (r1 s1 - r2 s2) / (S + s1 + s2), and the yarns lengthen by the
# strain c(w) = (2 r1 w - w^2, -2 r2 w - w^2). With D the plane stiffness along the yarns and dh the
# strain increment, an increment ends where s = s_old + D (dh - c(w) + c(w_old)). Its only unknown
# is w, the root of w (S + s1 + s2) - r1 s1 + r2 s2, which rises with w in tension. Where
# compression makes the sum S + s1 + s2 less than S/2, S/2 takes its place; and w is kept between
# -r2, where the fill yarns are straight, and r1, where the warp yarns are.
#
# Names: `bed_stiffness` is S; `total` is S + s1 + s2, `pull` the same but at least S/2, and
# `pull_slope` 1 where they are equal, else 0; `dg0, dg1` are D dc/dw, in `_balanced_exchange` half
# of it.


class Crimp(NamedTuple):
    """The constants of a law with crimp: r1 = T1/S, r2 = T2/S, and `bed_stiffness` S (MPa)."""

    r1: float
    r2: float
    bed_stiffness: float


class PlaneStiffness(NamedTuple):
    """Plane stress stiffness along the yarns: s1 = d11 e1 + d12 e2, s2 = d12 e1 + d22 e2; MPa."""

    d11: float
    d12: float
    d22: float


class YarnIncrement(NamedTuple):
    """The exchange at the end of an increment, and the strains of the yarns.

    Attributes
    ----------
    w : float
        The exchange, NaN if not found.
    e0, e1 : float
        The strain increment less that by crimp, which stretches warp and fill yarns.
    """

    w: float
    e0: float
    e1: float


@compiled(internal=True)
def _exchanged(
    s0: float,
    s1: float,
    crimp: Crimp,
    slopes: Array,
) -> tuple[float, float, float]:
    """Return the exchange w at a stress with its derivatives dw/ds1, dw/ds2 (`by0`, `by1`).

    s0, s1 are s1, s2 above: stresses along warp and fill, MPa. Also writes dw/dT1, dw/dT2 and dw/dS
    to the three entries of `slopes` from CRIMP; they follow from `by_r1`, `by_r2` and
    `by_bed_stiffness`, the derivatives of w by r1, r2 and S.
    """
    r1 = crimp.r1
    r2 = crimp.r2
    bed_stiffness = crimp.bed_stiffness
    total = bed_stiffness + s0 + s1
    is_held = total < 0.5 * bed_stiffness
    pull = 0.5 * bed_stiffness if is_held else total
    w = (r1 * s0 - r2 * s1) / pull
    pull_slope = 0.0 if is_held else 1.0
    by0 = (r1 - pull_slope * w) / pull
    by1 = -(r2 + pull_slope * w) / pull
    by_r1 = s0 / pull
    by_r2 = -s1 / pull
    by_bed_stiffness = -w / (bed_stiffness if is_held else pull)
    if w >= r1 or w <= -r2:
        by0 = 0.0
        by1 = 0.0
        by_r1 = 0.0
        by_r2 = 0.0
        by_bed_stiffness = 0.0
        if w >= r1:
            w = r1
            by_r1 = 1.0
        else:
            w = -r2
            by_r2 = -1.0
    slopes[CRIMP] = by_r1 / bed_stiffness
    slopes[CRIMP + 1] = by_r2 / bed_stiffness
    slopes[CRIMP + 2] = by_bed_stiffness - (r1 * by_r1 + r2 * by_r2) / bed_stiffness
    return w, by0, by1


@compiled(internal=True)
def _balanced_exchange(
    stiffness: PlaneStiffness,
    crimp: Crimp,
    w_old: float,
    s_old: Array,
    s_new: Array,
    slopes: Array,
) -> YarnIncrement:
    """Search the exchange at the end of an increment; write the stress along the yarns.

    `off` is what the balance of forces lacks at w, `steep` its derivative by w, and `low`, `high`
    bracket the root.

    Parameters
    ----------
    w_old : float
        Exchange at the start.
    s_old, s_new : (3,) array, MPa
        Stress at the start and the end; s_new[:2] is written.
    slopes : (SLOPES,) array
        The entries TAKEN1 and TAKEN2 are the strain increment along the yarns.
    """
    r1 = crimp.r1
    r2 = crimp.r2
    bed_stiffness = crimp.bed_stiffness
    dh0 = slopes[TAKEN1]
    dh1 = slopes[TAKEN2]
    w = w_old
    low = -r2
    high = r1
    e0 = e1 = 0.0
    for _ in range(ROUNDS):
        e0 = dh0 - (2.0 * r1 - w) * w + (2.0 * r1 - w_old) * w_old
        e1 = dh1 + (2.0 * r2 + w) * w - (2.0 * r2 + w_old) * w_old
        s_new[0] = s_old[0] + stiffness.d11 * e0 + stiffness.d12 * e1
        s_new[1] = s_old[1] + stiffness.d12 * e0 + stiffness.d22 * e1
        total = bed_stiffness + s_new[0] + s_new[1]
        pull_slope = 1.0 if total >= 0.5 * bed_stiffness else 0.0
        pull = max(total, 0.5 * bed_stiffness)
        off = w * pull - r1 * s_new[0] + r2 * s_new[1]
        if not off == off:
            return YarnIncrement(math.nan, e0, e1)
        if (w == r1 and off <= 0.0) or (w == -r2 and off >= 0.0):
            break
        if off > 0.0:
            high = w
        else:
            low = w
        dg0 = stiffness.d11 * (r1 - w) - stiffness.d12 * (r2 + w)
        dg1 = stiffness.d12 * (r1 - w) - stiffness.d22 * (r2 + w)
        steep = pull + 2.0 * ((r1 - pull_slope * w) * dg0 - (r2 + pull_slope * w) * dg1)
        newton = w - off / steep if steep > 0.0 else math.inf
        if not (low < newton < high):
            # The ends are exchanges of their own, where one yarn is straight.
            straight = r1 if newton >= high else -r2
            newton = straight if straight in (low, high) else 0.5 * (low + high)
        if abs(newton - w) <= ROUNDING:
            break
        w = newton
    return YarnIncrement(w, e0, e1)


@compiled(internal=True)
def exchange(
    stiffness: PlaneStiffness,
    coupling: Coupling,
    s_old: Array,
    s_new: Array,
    slopes: Array,
) -> bool:
    """Write the stress along the yarns s_new[:2] after an increment with exchange of crimp.

    Parameters
    ----------
    stiffness : PlaneStiffness
        Of the yarns without exchange, mean over the increment.
    coupling : tuple of float
        Of a law with crimp, see `CompiledLaw.coupling`.
    s_old, s_new : (3,) array, MPa
        Stress at the start, and at the end, of which the first two entries are written.
    slopes : (SLOPES,) array
        TAKEN1 and TAKEN2 are the strain increment of the fabric, and become that of the yarns; what
        begins at AHEAD, BEHIND and CRIMP is written as `stress_update` says.

    Returns
    -------
    bool
        False where S is not positive, or no exchange with a regular tangent is found.
    """
    bed_stiffness = coupling[5]
    if not bed_stiffness > 0.0:
        return False
    r1 = coupling[3] / bed_stiffness
    r2 = coupling[4] / bed_stiffness
    crimp = Crimp(r1, r2, bed_stiffness)
    w_old, old0, old1 = _exchanged(s_old[0], s_old[1], crimp, slopes)
    by_old = slopes[CRIMP], slopes[CRIMP + 1], slopes[CRIMP + 2]
    w, e0, e1 = _balanced_exchange(
        stiffness,
        crimp,
        w_old,
        s_old,
        s_new,
        slopes,
    )
    if not w == w:
        return False
    slopes[TAKEN1] = e0
    slopes[TAKEN2] = e1
    _, by0, by1 = _exchanged(s_new[0], s_new[1], crimp, slopes)
    if w == r1 or w == -r2:
        by0 = by1 = 0.0
    d11, d12, d22 = stiffness
    g0 = 2.0 * (r1 - w)
    g1 = -2.0 * (r2 + w)
    dg0 = d11 * g0 + d12 * g1
    dg1 = d12 * g0 + d22 * g1
    total = 1.0 + by0 * dg0 + by1 * dg1
    if not total > 0.0:
        return False
    # With g = dc/dw (g0, g1), v = dw/ds (by0, by1), and both at the start of the increment as
    # g_old and v_old: A = 1 - D g v' / (1 + v' D g), B = A D g_old v_old'.
    slopes[AHEAD] = 1.0 - dg0 * by0 / total
    slopes[AHEAD + 1] = -dg0 * by1 / total
    slopes[AHEAD + 2] = -dg1 * by0 / total
    slopes[AHEAD + 3] = 1.0 - dg1 * by1 / total
    g0_old = 2.0 * (r1 - w_old)
    g1_old = -2.0 * (r2 + w_old)
    dg0_old = d11 * g0_old + d12 * g1_old
    dg1_old = d12 * g0_old + d22 * g1_old
    for i in range(2):
        through_ahead = slopes[AHEAD + 2 * i] * dg0_old + slopes[AHEAD + 2 * i + 1] * dg1_old
        slopes[BEHIND + 2 * i] = through_ahead * old0
        slopes[BEHIND + 2 * i + 1] = through_ahead * old1
    # For CRIMP: - D dc/d(T1, T2, S) at a fixed stress, the end less the start. by_r1 and by_r2 are
    # the derivatives of 2 r1 and of -2 r2 by (T1, T2, S): those of c at fixed w are by_r w.
    by_r1 = (2.0 / bed_stiffness, 0.0, -2.0 * r1 / bed_stiffness)
    by_r2 = (0.0, -2.0 / bed_stiffness, 2.0 * r2 / bed_stiffness)
    for k in range(3):
        c0 = g0 * slopes[CRIMP + k] - g0_old * by_old[k] + by_r1[k] * (w - w_old)
        c1 = g1 * slopes[CRIMP + k] - g1_old * by_old[k] + by_r2[k] * (w - w_old)
        slopes[CRIMP + k] = -(d11 * c0 + d12 * c1)
        slopes[CRIMP + 3 + k] = -(d12 * c0 + d22 * c1)
    return True


# Fourth section: the stress after an increment, its tangent, and its rates by parameters.


@compiled(internal=True)
def stress_update(
    law: CompiledLaw,
    before: PointState,
    after: PointState,
    response: LawTangent,
) -> bool:
    """Integrate one increment of d sigma = D(eps) d eps with the moduli of `increment_modulus`.

    Parameters
    ----------
    law : CompiledLaw
    before : PointState
        Strain and stress at the start of the increment.
    after : PointState
        Its strain is that of the end, its stress is written. For a law with a memory the strains
        of both states are (9,) as in `memory.py`, and strain[3:] is written.
    response : LawTangent
        Its `tangent` d(stress)/d(strain) and its `slopes` are written. In `slopes`, D11 to D22_E2,
        D11_NU and D22_NU are the plane stiffness and its derivatives, G12 the shear modulus, all
        means over the increment. BEFORE1 to BEFORE3 are the derivatives of the mean E1, E2, G12 by
        their strain at the start. RATIO1, RATIO2 are the load ratios less 1/sqrt 2, that of equal
        loads. TAKEN1, TAKEN2 are the strain increment that the stiffness multiplies: that of the
        fabric less that by crimp. At AHEAD and BEHIND stand A and B (2, 2): with r the change of
        the stress along the yarns while load ratio and crimp exchange are fixed, and b the change
        of that at the start, the stress changes by A r + B b once both follow. At CRIMP stands the
        derivative (2, 3) of r by T1, T2 and S.

    Returns
    -------
    bool
        False when a modulus or 1 - nu12 nu21 is not positive, when the load ratio is not found
        (`mean_ratio`), or the exchange of crimp (`exchange`).
    """
    return _integrate(law, law.coupling, before, after, response)


@compiled(internal=True)
def _integrate(
    law: CompiledLaw,
    coupling: Coupling,
    before: PointState,
    after: PointState,
    response: LawTangent,
) -> bool:
    """Integrate as `stress_update`.

    `coupling` is an argument of its own because its length is part of its type: the compiler leaves
    out the branches of crimp and of memory for laws whose length shows that they have none.
    """
    pieces = law.pieces
    h = after.strain
    h_old = before.strain
    s_old = before.stress
    s_new = after.stress
    tangent = response.tangent
    slopes = response.slopes
    warp, warp_slope, warp_before = increment_modulus(pieces, WARP, h[0], h_old[0])
    fill, fill_slope, fill_before = increment_modulus(pieces, FILL, h[1], h_old[1])
    shear, shear_slope, shear_before = increment_modulus(pieces, SHEAR, h[2], h_old[2])
    if len(coupling) > CRIMPED:
        warp, warp_slope, warp_before = recalled_modulus(law, WARP, h, h_old)
        fill, fill_slope, fill_before = recalled_modulus(law, FILL, h, h_old)
        shear, shear_slope, shear_before = recalled_modulus(law, SHEAR, h, h_old)
    dh0 = h[0] - h_old[0]
    dh1 = h[1] - h_old[1]
    dh2 = h[2] - h_old[2]
    slopes[RATIO1:] = 0.0
    slopes[TAKEN1] = dh0
    slopes[TAKEN2] = dh1
    slopes[AHEAD] = 1.0
    slopes[AHEAD + 3] = 1.0
    if coupling[1] != 0.0 or coupling[2] != 0.0:
        if not mean_ratio(
            warp,
            fill,
            coupling,
            s_old,
            dh0,
            dh1,
            slopes,
        ):
            return False
        warp += coupling[1] * slopes[RATIO1]
        fill += coupling[2] * slopes[RATIO2]
    if not (shear > 0.0 and fill > 0.0 and warp > 0.0):
        return False
    nu = coupling[0]
    nu_nu = nu * nu * fill / warp
    den = 1.0 - nu_nu
    if not den > 1e-3:
        return False
    inv = 1.0 / den
    d11 = warp * inv
    d22 = fill * inv
    d12 = nu * d22
    inv2 = inv * inv
    den_warp = nu_nu / warp
    den_fill = -nu * nu / warp
    d11_e1 = inv - warp * den_warp * inv2
    d11_e2 = -warp * den_fill * inv2
    d22_e1 = -fill * den_warp * inv2
    d22_e2 = inv - fill * den_fill * inv2
    has_coupling = coupling[1] != 0.0 or coupling[2] != 0.0
    if len(coupling) == CRIMPED:
        has_coupling = True
        if not exchange(PlaneStiffness(d11, d12, d22), coupling, s_old, s_new, slopes):
            return False
        dh0 = slopes[TAKEN1]
        dh1 = slopes[TAKEN2]
    else:
        s_new[0] = s_old[0] + d11 * dh0 + d12 * dh1
        s_new[1] = s_old[1] + d12 * dh0 + d22 * dh1
    s_new[2] = s_old[2] + shear * dh2
    tangent[0, 0] = d11 + warp_slope * (d11_e1 * dh0 + nu * d22_e1 * dh1)
    tangent[0, 1] = d12 + fill_slope * (d11_e2 * dh0 + nu * d22_e2 * dh1)
    tangent[1, 0] = d12 + warp_slope * (nu * d22_e1 * dh0 + d22_e1 * dh1)
    tangent[1, 1] = d22 + fill_slope * (nu * d22_e2 * dh0 + d22_e2 * dh1)
    tangent[2, 2] = shear + shear_slope * dh2
    if has_coupling:
        for j in range(2):
            first = tangent[0, j]
            second = tangent[1, j]
            tangent[0, j] = slopes[AHEAD] * first + slopes[AHEAD + 1] * second
            tangent[1, j] = slopes[AHEAD + 2] * first + slopes[AHEAD + 3] * second
    tangent[0, 2] = tangent[1, 2] = tangent[2, 0] = tangent[2, 1] = 0.0
    slopes[D11] = d11
    slopes[D12] = d12
    slopes[D22] = d22
    slopes[G12] = shear
    slopes[D11_E1] = d11_e1
    slopes[D11_E2] = d11_e2
    slopes[D22_E1] = d22_e1
    slopes[D22_E2] = d22_e2
    slopes[BEFORE1] = warp_before
    slopes[BEFORE2] = fill_before
    slopes[BEFORE3] = shear_before
    den_nu = 2.0 * nu * fill / warp * inv2
    slopes[D11_NU] = warp * den_nu
    slopes[D22_NU] = fill * den_nu
    return True


@compiled(internal=True)
def stress_rates(
    slopes: Array,
    nu: float,
    of_moduli: Array,
    by_coupling: Array,
    old: Array,
    ds_old: Array,
    ds_new: Array,
) -> None:
    """Write the derivatives of the stress along the yarns by p parameters, at fixed end strain.

    Parameters
    ----------
    slopes : (SLOPES,) array
        As `stress_update` wrote it for the increment.
    nu : float
        nu12.
    of_moduli : (3, p) array
        Derivatives of the mean E1, E2, G12 at equal loads (1:1) by the p parameters, at fixed
        strains.
    by_coupling : (len(coupling), p) array
        `LawSlopes.coupling`.
    old, ds_old : (3, p) array
        Derivatives of strain and stress (MPa) at the start of the increment by the parameters.
    ds_new : (3, p) array, MPa
        Derivatives of the stress at the end; ds_new[:2] is written. It may be `ds_old`.
    """
    # Numbers instead of entries of `slopes`, which the compiler would read anew after each write.
    before1, before2 = slopes[BEFORE1], slopes[BEFORE2]
    ratio1, ratio2 = slopes[RATIO1], slopes[RATIO2]
    d11_e1, d11_e2, d11_nu = slopes[D11_E1], slopes[D11_E2], slopes[D11_NU]
    d22_e1, d22_e2, d22_nu = slopes[D22_E1], slopes[D22_E2], slopes[D22_NU]
    stiffness = PlaneStiffness(slopes[D11], slopes[D12], slopes[D22])
    dh0, dh1 = slopes[TAKEN1], slopes[TAKEN2]
    ahead00, ahead01, ahead10, ahead11 = (
        slopes[AHEAD],
        slopes[AHEAD + 1],
        slopes[AHEAD + 2],
        slopes[AHEAD + 3],
    )
    behind00, behind01, behind10, behind11 = (
        slopes[BEHIND],
        slopes[BEHIND + 1],
        slopes[BEHIND + 2],
        slopes[BEHIND + 3],
    )
    for j in range(ds_new.shape[1]):
        o0 = old[0, j]
        o1 = old[1, j]
        by_nu = by_coupling[0, j]
        warp = of_moduli[0, j] + o0 * before1 + by_coupling[1, j] * ratio1
        fill = of_moduli[1, j] + o1 * before2 + by_coupling[2, j] * ratio2
        d11 = d11_e1 * warp + d11_e2 * fill + by_nu * d11_nu
        d22 = d22_e1 * warp + d22_e2 * fill + by_nu * d22_nu
        d12 = nu * d22 + by_nu * stiffness.d22
        b0 = ds_old[0, j]
        b1 = ds_old[1, j]
        a0 = b0 + d11 * dh0 + d12 * dh1 - stiffness.d11 * o0 - stiffness.d12 * o1
        a1 = b1 + d12 * dh0 + d22 * dh1 - stiffness.d12 * o0 - stiffness.d22 * o1
        for k in range(CRIMPED - 3 if by_coupling.shape[0] == CRIMPED else 0):
            a0 += slopes[CRIMP + k] * by_coupling[3 + k, j]
            a1 += slopes[CRIMP + 3 + k] * by_coupling[3 + k, j]
        ds_new[0, j] = ahead00 * a0 + ahead01 * a1 + behind00 * b0 + behind01 * b1
        ds_new[1, j] = ahead10 * a0 + ahead11 * a1 + behind10 * b0 + behind11 * b1


@compiled(internal=True)
def referred_stress(
    green: CauchyGreen,
    ratio: float,
    growth: tuple[float, float, float],
    s: Array,
    response: PointResponse,
) -> None:
    """Write the 2nd Piola-Kirchhoff stress of a Cauchy stress, and its derivative by E.

    Parameters
    ----------
    green : CauchyGreen
        Deformation, of which E is the Green-Lagrange strain.
    ratio : float
        Stress resultant (force per current length) over s t0, t0 the thickness at rest.
    growth : (3,) tuple of float
        Derivative of log(ratio) by the log strain.
    s : (3,) array, MPa
        Corotated Cauchy stress; left as it was.
    response : PointResponse
        `law.tangent` and `strain_slope` are read; `pk2`, `stiffness` and `pull` are written.
    """
    stiffness = response.stiffness
    p = response.strain_slope
    law_tangent = response.law.tangent
    pull = response.pull
    work = response.work
    t0 = s[0]
    t1 = s[1]
    t2 = s[2]
    s[0] *= ratio
    s[1] *= ratio
    s[2] *= ratio
    pull_back(green, s, response.pk2, pull, stiffness)
    s[0] = t0
    s[1] = t1
    s[2] = t2
    for i in range(3):
        for j in range(3):
            pull[i, j] *= ratio
    for i in range(3):
        a0 = law_tangent[i, 0] + s[i] * growth[0]
        a1 = law_tangent[i, 1] + s[i] * growth[1]
        a2 = law_tangent[i, 2] + s[i] * growth[2]
        for j in range(3):
            work[i, j] = a0 * p[0, j] + a1 * p[1, j] + a2 * p[2, j]
    for i in range(3):
        for j in range(3):
            stiffness[i, j] += (
                pull[i, 0] * work[0, j] + pull[i, 1] * work[1, j] + pull[i, 2] * work[2, j]
            )


@compiled(internal=True)
def membrane_stress(
    law: CompiledLaw,
    green: CauchyGreen,
    before: PointState,
    after: PointState,
    response: PointResponse,
) -> bool:
    """Write strain, stress, 2nd Piola-Kirchhoff stress and its derivative by E after an increment.

    Parameters
    ----------
    law : CompiledLaw
        Its `area_power` is 1 for constant thickness; it is 0 for an incompressible material, whose
        stress resultant is sigma t0 / J2 with t0 the thickness at rest and J2 the area ratio.
    green : CauchyGreen
        Deformation at the end of the increment.
    before : PointState
        Log strain and Cauchy stress at its start.
    after : PointState
        Log strain and Cauchy stress at its end; written.
    response : PointResponse
        Written.

    Returns
    -------
    bool
        False where `log_strain` or `stress_update` returns it; nothing written counts then.
    """
    if not log_strain(green, after.strain, response.strain_slope):
        return False
    if not stress_update(law, before, after, response.law):
        return False
    ratio = math.exp(law.area_power * (after.strain[0] + after.strain[1]))
    growth = (law.area_power, law.area_power, 0.0)
    referred_stress(green, ratio, growth, after.stress, response)
    return True
