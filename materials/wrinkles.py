"""Wrinkled and slack states at one integration point, compiled: the strain of the fabric.

The fabric is strained by h + w, total strain and wrinkle strain w = size n n' (n its normal), or
any contraction where slack, such that the Cauchy stress s obeys

    s >= 0 (no principal compression),  w >= 0,  s : w = 0

(Roddeman et al., J. Appl. Mech. 54 (1987) 884; Del Piero, Meccanica 24 (1989)). A share of the
stiffness at zero strain is left to w, so that wrinkled and slack parts keep a tangent. Newton's
iteration searches size and angle of w.
"""

import math

import numpy as np

from ..compilation import compiled
from .forms.base import Array
from .memory import Coupling
from .pieces import FILL, SHEAR, WARP, increment_modulus
from .point_law import SLOPES, log_strain, referred_stress, stress_update

ITERATIONS = 25
#: Strain, or stress over the stiffness, that is taken as none.
ROUNDING = 1e-13
#: Wrinkle normals tried, over half a turn, where Newton's iteration finds none.
NORMALS = 36


@compiled()
def least_principal(a: float, b: float, c: float) -> float:
    """Return the smaller eigenvalue of [[a, c], [c, b]]."""
    return 0.5 * (a + b) - math.hypot(0.5 * (a - b), c)


@compiled()
def _normal(angle: float, n: Array, m: Array) -> None:
    """Write strain n n' of a wrinkle, which takes the stress across it, and m, that along it."""
    c = math.cos(angle)
    s = math.sin(angle)
    n[0] = c * c
    n[1] = s * s
    n[2] = 2.0 * c * s
    m[0] = -c * s
    m[1] = c * s
    m[2] = c * c - s * s


@compiled()
def _across(
    pieces: Array,
    coupling: Coupling,
    h: Array,
    h_old: Array,
    s_old: Array,
    n: Array,
    size: float,
    he: Array,
    s: Array,
    tangent: Array,
    slopes: Array,
) -> float:
    """Return the size of a wrinkle strain along n without stress across it; NaN if not found."""
    scale = abs(size) + 1e-3
    for _ in range(ITERATIONS):
        for i in range(3):
            he[i] = h[i] + size * n[i]
        if not stress_update(pieces, coupling, he, h_old, s_old, s, tangent, slopes):
            return math.nan
        across = 0.0
        slope = 0.0
        for i in range(3):
            across += n[i] * s[i]
            for j in range(3):
                slope += n[i] * tangent[i, j] * n[j]
        if not slope > 0.0:
            return math.nan
        step = -across / slope
        size += step
        if abs(step) < 1e-13 * scale:
            return size
    return math.nan


@compiled()
def _along(s: Array, m: Array) -> float:
    return m[0] * s[0] + m[1] * s[1] + m[2] * s[2]


@compiled()
def _start(
    pieces: Array,
    coupling: Coupling,
    h: Array,
    h_old: Array,
    s_old: Array,
    n: Array,
    m: Array,
    he: Array,
    s: Array,
    tangent: Array,
    slopes: Array,
) -> tuple[float, float]:
    """Return angle and size between the two normals where the shear along changes its sign."""
    shear_before = math.nan
    size_before = 0.0
    angle_before = 0.0
    for k in range(NORMALS + 1):
        angle = k * math.pi / NORMALS
        _normal(angle, n, m)
        size = _across(pieces, coupling, h, h_old, s_old, n, 0.0, he, s, tangent, slopes)
        if math.isnan(size) or size <= 0.0 or s[0] + s[1] < 0.0:
            shear_before = math.nan
            continue
        shear = _along(s, m)
        # With tension along the wrinkle the shear rises with the angle through the root.
        if shear_before <= 0.0 <= shear:
            part = 0.5 if shear_before == shear else shear_before / (shear_before - shear)
            return angle_before + part * (angle - angle_before), size_before
        shear_before = shear
        size_before = size
        angle_before = angle
    return math.nan, math.nan


@compiled()
def _wrinkle(
    pieces: Array,
    coupling: Coupling,
    h: Array,
    h_old: Array,
    s_old: Array,
    angle: float,
    size: float,
    n: Array,
    m: Array,
    he: Array,
    s: Array,
    tangent: Array,
    slopes: Array,
    inverse: Array,
) -> tuple[float, float]:
    """Return angle and size of the wrinkle strain by Newton; inverse (2, 2) of its slope."""
    scale = abs(s[0]) + abs(s[1]) + abs(s[2])
    for _ in range(ITERATIONS):
        _normal(angle, n, m)
        for i in range(3):
            he[i] = h[i] + size * n[i]
        if not stress_update(pieces, coupling, he, h_old, s_old, s, tangent, slopes):
            return math.nan, math.nan
        across = n[0] * s[0] + n[1] * s[1] + n[2] * s[2]
        shear = _along(s, m)
        a = 0.0
        b = 2.0 * shear
        c = 0.0
        d = s[0] + s[1] - 2.0 * across
        for i in range(3):
            for j in range(3):
                a += n[i] * tangent[i, j] * n[j]
                b += n[i] * tangent[i, j] * 2.0 * size * m[j]
                c += m[i] * tangent[i, j] * n[j]
                d += m[i] * tangent[i, j] * 2.0 * size * m[j]
        det = a * d - b * c
        if not (a > 0.0 and det > 0.0):
            return math.nan, math.nan
        inverse[0, 0] = d / det
        inverse[0, 1] = -b / det
        inverse[1, 0] = -c / det
        inverse[1, 1] = a / det
        if abs(across) + abs(shear) < 1e-12 * (scale + abs(s[0]) + abs(s[1]) + abs(a) * 1e-3):
            if size < 0.0 or s[0] + s[1] < 0.0:
                return math.nan, math.nan
            return angle, size
        size -= inverse[0, 0] * across + inverse[0, 1] * shear
        turn = inverse[1, 0] * across + inverse[1, 1] * shear
        angle -= min(max(turn, -0.3), 0.3)
    return math.nan, math.nan


@compiled()
def slack(
    pieces: Array,
    coupling: Coupling,
    h_old: Array,
    s_old: Array,
    he: Array,
    s: Array,
    tangent: Array,
    slopes: Array,
) -> bool:
    """Write the strain of the fabric without any stress to he."""
    for i in range(3):
        he[i] = h_old[i]
    for _ in range(ITERATIONS):
        if not stress_update(pieces, coupling, he, h_old, s_old, s, tangent, slopes):
            return False
        det = tangent[0, 0] * tangent[1, 1] - tangent[0, 1] * tangent[1, 0]
        if not (det > 0.0 and tangent[2, 2] > 0.0):
            return False
        step0 = (tangent[1, 1] * s[0] - tangent[0, 1] * s[1]) / det
        step1 = (tangent[0, 0] * s[1] - tangent[1, 0] * s[0]) / det
        step2 = s[2] / tangent[2, 2]
        he[0] -= step0
        he[1] -= step1
        he[2] -= step2
        if abs(step0) + abs(step1) + abs(step2) < 1e-14:
            s[:] = 0.0
            return True
    return False


@compiled()
def wrinkled(
    pieces: Array,
    coupling: Coupling,
    h: Array,
    h_old: Array,
    s_old: Array,
    away: tuple[float, float],
    he: Array,
    s_new: Array,
    tangent: Array,
    slopes: Array,
    strain_slope: Array,
) -> bool:
    """Find a wrinkle between the `away` angles: he, s_new, and the derivative of he by h."""
    n = np.empty(3)
    m = np.empty(3)
    inverse = np.empty((2, 2))
    # First the normal of the smaller principal stress that the taut fabric would have.
    angle = 0.5 * math.atan2(-s_new[2], -0.5 * (s_new[0] - s_new[1]))
    _normal(angle, n, m)
    size = _across(pieces, coupling, h, h_old, s_old, n, 0.0, he, s_new, tangent, slopes)
    if not math.isnan(size):
        angle, size = _wrinkle(
            pieces,
            coupling,
            h,
            h_old,
            s_old,
            angle,
            size,
            n,
            m,
            he,
            s_new,
            tangent,
            slopes,
            inverse,
        )
    if math.isnan(size):
        # Hardly taut along the wrinkle: the normal is nearly that of the slack state.
        s_new[:] = 0.0
        angle, size = _wrinkle(
            pieces,
            coupling,
            h,
            h_old,
            s_old,
            away[0],
            away[1],
            n,
            m,
            he,
            s_new,
            tangent,
            slopes,
            inverse,
        )
    if math.isnan(size):
        angle, size = _start(pieces, coupling, h, h_old, s_old, n, m, he, s_new, tangent, slopes)
        if not math.isnan(size):
            angle, size = _wrinkle(
                pieces,
                coupling,
                h,
                h_old,
                s_old,
                angle,
                size,
                n,
                m,
                he,
                s_new,
                tangent,
                slopes,
                inverse,
            )
    if math.isnan(size):
        return False
    # d(size, angle) = -inverse [n; m] T dh, and he changes by n d(size) + 2 size m d(angle) + dh.
    for j in range(3):
        across = 0.0
        shear = 0.0
        for i in range(3):
            across += n[i] * tangent[i, j]
            shear += m[i] * tangent[i, j]
        grow = inverse[0, 0] * across + inverse[0, 1] * shear
        turn = inverse[1, 0] * across + inverse[1, 1] * shear
        for i in range(3):
            strain_slope[i, j] -= n[i] * grow + 2.0 * size * m[i] * turn
    return True


@compiled()
def relaxed_update(
    pieces: Array,
    coupling: Coupling,
    share: float,
    h: Array,
    h_old: Array,
    s_old: Array,
    he: Array,
    s_new: Array,
    carried: Array,
    tangent: Array,
    slopes: Array,
    strain_slope: Array,
) -> int:
    """Integrate as `stress_update`, for a membrane that wrinkles.

    h (3,) total strain at the end; h_old, s_old (3,) strain and stress OF THE FABRIC at the start.
    share : of the stiffness at zero strain, left to the wrinkle strain. Writes he, s_new (3,)
    strain and stress of the fabric at the end; carried (3,) the stress with the share of the
    wrinkle strain, tangent (3, 3) its derivative by h, and strain_slope (3, 3) that of he. Returns
    0 where the membrane is taut, 1 where it wrinkles, 2 where it is slack, and -1 where there is no
    stress.
    """
    strain_slope[:] = 0.0
    for i in range(3):
        he[i] = h[i]
        strain_slope[i, i] = 1.0
    if not stress_update(pieces, coupling, h, h_old, s_old, s_new, tangent, slopes):
        return -1
    if least_principal(s_new[0], s_new[1], s_new[2]) >= -ROUNDING * tangent[0, 0]:
        for i in range(3):
            carried[i] = s_new[i]
        return 0
    t0 = s_new[0]
    t1 = s_new[1]
    t2 = s_new[2]
    state = 1
    away = (0.0, 0.0)
    if slack(pieces, coupling, h_old, s_old, he, s_new, tangent, slopes):
        w0 = he[0] - h[0]
        w1 = he[1] - h[1]
        w2 = 0.5 * (he[2] - h[2])
        if least_principal(w0, w1, w2) >= -ROUNDING:
            state = 2
            strain_slope[:] = 0.0
        away = (
            0.5 * math.atan2(w2, 0.5 * (w0 - w1)),
            0.5 * (w0 + w1) + math.hypot(0.5 * (w0 - w1), w2),
        )
    if state == 1:
        s_new[0] = t0
        s_new[1] = t1
        s_new[2] = t2
        if not wrinkled(
            pieces, coupling, h, h_old, s_old, away, he, s_new, tangent, slopes, strain_slope
        ):
            return -1
    nu = coupling[0]
    warp = increment_modulus(pieces, WARP, 0.0, 0.0)[0]
    fill = increment_modulus(pieces, FILL, 0.0, 0.0)[0]
    stiffness_left = np.zeros((3, 3))
    stiffness_left[0, 0] = share * warp / (1.0 - nu * nu * fill / warp)
    stiffness_left[1, 1] = stiffness_left[0, 0] * fill / warp
    stiffness_left[0, 1] = stiffness_left[1, 0] = nu * stiffness_left[1, 1]
    stiffness_left[2, 2] = share * increment_modulus(pieces, SHEAR, 0.0, 0.0)[0]
    total = np.zeros((3, 3))
    for i in range(3):
        carried[i] = s_new[i]
        for j in range(3):
            carried[i] -= stiffness_left[i, j] * (he[j] - h[j])
            for k in range(3):
                total[i, j] += (tangent[i, k] - stiffness_left[i, k]) * strain_slope[k, j]
            total[i, j] += stiffness_left[i, j]
    for i in range(3):
        for j in range(3):
            tangent[i, j] = total[i, j]
    return state


@compiled()
def relaxed_membrane_stress(
    m: float,
    q: float,
    c: float,
    pieces: Array,
    coupling: Coupling,
    area_power: float,
    share: float,
    h_old: Array,
    s_old: Array,
    h: Array,
    he: Array,
    s_new: Array,
    pk2: Array,
    stiffness: Array,
    p: Array,
    law_tangent: Array,
    slopes: Array,
    pull: Array,
    work: Array,
) -> int:
    """Return as `membrane_stress`, of a membrane that wrinkles; or -1."""
    if not log_strain(m, q, c, h, p):
        return -1
    carried = np.empty(3)
    slope = np.empty((3, 3))
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


@compiled()
def relaxed_increments(
    pieces: Array, coupling: Coupling, h: Array, h_old: Array, s_old: Array
) -> tuple[Array, Array]:
    """Return strain and stress (n, 3) of the fabric at total strains h, or NaN; see above."""
    he = np.empty(h.shape)
    s = np.empty(h.shape)
    carried = np.empty(3)
    slopes = np.empty(SLOPES)
    tangent = np.empty((3, 3))
    strain_slope = np.empty((3, 3))
    for i in range(len(h)):
        if (
            relaxed_update(
                pieces,
                coupling,
                0.0,
                h[i],
                h_old[i],
                s_old[i],
                he[i],
                s[i],
                carried,
                tangent,
                slopes,
                strain_slope,
            )
            < 0
        ):
            he[i] = np.nan
            s[i] = np.nan
    return he, s
