"""Stress and strain of a wrinkled or slack membrane at one integration point, compiled.

A membrane cannot be compressed: it wrinkles, or goes slack. The strain of the fabric is therefore
h + w, with h the total strain of the mean surface and w the wrinkle strain. In a wrinkled state w =
size n n' with the unit vector n across the wrinkles (their normal); in a slack state it is any
strain that is nowhere negative. The Cauchy stress s and w obey

    s >= 0 (no principal compression),  w >= 0,  s : w = 0

(Roddeman et al., J. Appl. Mech. 54 (1987) 884; Del Piero, Meccanica 24 (1989)). A small share of
the stiffness at zero strain resists w, so that wrinkled and slack parts keep some stiffness.
Newton's method searches the size of w and the angle of n to the warp.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compilation import compiled
from .forms.base import Array
from .pieces import (
    FILL,
    SHEAR,
    WARP,
    CauchyGreen,
    CompiledLaw,
    LawTangent,
    PointResponse,
    PointState,
    increment_modulus,
    point_response,
)
from .point_law import log_strain, referred_stress, stress_update

#: Largest number of iterations of Newton's method.
MAX_ITERATIONS = 25
#: Strain, or stress over stiffness, that counts as zero.
ROUNDING = 1e-13
#: Determinant over squared size up to which a wrinkle strain has one normal, rounding apart.
ONE_WAY = 1e-9
#: Number of wrinkle normals tried, over half a turn, where Newton's method finds no solution.
NORMALS = 36


class FabricIncrement(NamedTuple):
    """An increment of a membrane that may wrinkle.

    Attributes
    ----------
    law : CompiledLaw
    before : PointState
        Strain and stress of the fabric at the start.
    total : (3,) ndarray
        Log strain of the surface at the end.
    after : PointState
        Strain and stress of the fabric at the end; written.
    response : LawTangent
    """

    law: CompiledLaw
    before: PointState
    total: Array
    after: PointState
    response: LawTangent


class Wrinkle(NamedTuple):
    """Directions of a wrinkle strain w = size n n', as (eps1, eps2, gamma12); written.

    Attributes
    ----------
    normal : (3,) array
        n n'; its product with the stress is the stress across the wrinkles.
    along : (3,) array
        Half the derivative of n n' by the angle; its product with the stress is the shear stress
        along them.
    inverse : (2, 2) array
        Inverse of the derivatives of these two stresses by size and angle.
    """

    normal: Array
    along: Array
    inverse: Array


class WrinkleWork(NamedTuple):
    """Work arrays that the functions of this module fill for one point, and again for the next.

    Attributes
    ----------
    total : (3,) ndarray
        Log strain of the surface.
    membrane_stress : (3,) ndarray, MPa
        Stress of the membrane: that of the fabric less what resists the wrinkle strain.
    strain_slope : (3, 3) ndarray
        Derivative of the fabric's strain by the total strain.
    wrinkle : Wrinkle
    stiffness_left, tangent : (3, 3) ndarray
        Scratch.
    """

    total: Array
    membrane_stress: Array
    strain_slope: Array
    wrinkle: Wrinkle
    stiffness_left: Array
    tangent: Array


@compiled()
def wrinkle_work() -> WrinkleWork:
    """Return new work arrays."""
    wrinkle = Wrinkle(np.empty(3), np.empty(3), np.empty((2, 2)))
    return WrinkleWork(
        np.empty(3),
        np.empty(3),
        np.empty((3, 3)),
        wrinkle,
        np.empty((3, 3)),
        np.empty((3, 3)),
    )


@compiled(internal=True)
def smaller_principal(a: float, b: float, c: float) -> float:
    """Return the smaller eigenvalue of [[a, c], [c, b]]."""
    return 0.5 * (a + b) - math.hypot(0.5 * (a - b), c)


@compiled(internal=True)
def _turn_to(angle: float, wrinkle: Wrinkle) -> None:
    """Write the directions of a wrinkle whose normal has an angle to the warp."""
    c = math.cos(angle)
    s = math.sin(angle)
    wrinkle.normal[0] = c * c
    wrinkle.normal[1] = s * s
    wrinkle.normal[2] = 2.0 * c * s
    wrinkle.along[0] = -c * s
    wrinkle.along[1] = c * s
    wrinkle.along[2] = c * c - s * s


@compiled(internal=True)
def _dot(direction: Array, s: Array) -> float:
    """Return the product of a direction (3,) and a stress (3,)."""
    return direction[0] * s[0] + direction[1] * s[1] + direction[2] * s[2]


@compiled(internal=True)
def _stress_with_wrinkle(increment: FabricIncrement, n: Array, size: float) -> bool:
    """Write strain and stress of the fabric with a wrinkle strain; False if the law has no stress.

    Parameters
    ----------
    n : (3,) array
        `Wrinkle.normal`.
    size : float
        Of the wrinkle strain.
    """
    for i in range(3):
        increment.after.strain[i] = increment.total[i] + size * n[i]
    return stress_update(increment.law, increment.before, increment.after, increment.response)


@compiled(internal=True)
def _size_without_stress_across(increment: FabricIncrement, n: Array) -> float:
    """Return the size of a wrinkle strain that leaves no stress across it; NaN if not found.

    Parameters
    ----------
    n : (3,) array
        `Wrinkle.normal`, which is fixed.
    """
    s = increment.after.stress
    tangent = increment.response.tangent
    size = 0.0
    scale = 1e-3
    for _ in range(MAX_ITERATIONS):
        if not _stress_with_wrinkle(increment, n, size):
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


@compiled(internal=True)
def _start(increment: FabricIncrement, wrinkle: Wrinkle) -> tuple[float, float]:
    """Return angle and size of a wrinkle strain from which Newton's method may start; or NaN.

    They lie between two of the normals that are tried, where the shear stress along the wrinkles
    changes its sign.
    """
    s = increment.after.stress
    previous_shear = math.nan
    previous_size = 0.0
    previous_angle = 0.0
    for k in range(NORMALS + 1):
        angle = k * math.pi / NORMALS
        _turn_to(angle, wrinkle)
        size = _size_without_stress_across(increment, wrinkle.normal)
        if math.isnan(size) or size <= 0.0 or s[0] + s[1] < 0.0:
            previous_shear = math.nan
            continue
        shear = _dot(wrinkle.along, s)
        # With tension along the wrinkle the shear rises with the angle through the root.
        if previous_shear <= 0.0 <= shear:
            share = 0.5
            if previous_shear != shear:
                share = previous_shear / (previous_shear - shear)
            return previous_angle + share * (angle - previous_angle), previous_size
        previous_shear = shear
        previous_size = size
        previous_angle = angle
    return math.nan, math.nan


@compiled(internal=True)
def _newton(
    increment: FabricIncrement,
    wrinkle: Wrinkle,
    angle: float,
    size: float,
) -> tuple[float, float]:
    """Return angle and size of the wrinkle strain by Newton's method; NaN if not found."""
    s = increment.after.stress
    tangent = increment.response.tangent
    n = wrinkle.normal
    m = wrinkle.along
    inverse = wrinkle.inverse
    scale = abs(s[0]) + abs(s[1]) + abs(s[2])
    for _ in range(MAX_ITERATIONS):
        _turn_to(angle, wrinkle)
        if not _stress_with_wrinkle(increment, n, size):
            return math.nan, math.nan
        across = _dot(n, s)
        shear = _dot(m, s)
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


@compiled(internal=True)
def slack(increment: FabricIncrement) -> bool:
    """Search the strain at which the fabric has no stress, and write it; False if not found."""
    he = increment.after.strain
    s = increment.after.stress
    tangent = increment.response.tangent
    for i in range(3):
        he[i] = increment.before.strain[i]
    for _ in range(MAX_ITERATIONS):
        if not stress_update(increment.law, increment.before, increment.after, increment.response):
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


@compiled(internal=True)
def _wrinkled(
    increment: FabricIncrement,
    slack_angle: float,
    slack_size: float,
    work: WrinkleWork,
) -> bool:
    """Find the wrinkled state after an increment, and write it; False if none is found.

    Parameters
    ----------
    increment : FabricIncrement
        Its `after` is the state without wrinkles (the stress, at least), and is written.
    slack_angle, slack_size : float
        Angle of the normal, and size, nearest to the strain that would leave no stress at all.
    work : WrinkleWork
        Its `strain_slope` is written.
    """
    s_new = increment.after.stress
    wrinkle = work.wrinkle
    # First the normal of the smaller principal stress that the taut fabric would have.
    angle = 0.5 * math.atan2(-s_new[2], -0.5 * (s_new[0] - s_new[1]))
    _turn_to(angle, wrinkle)
    size = _size_without_stress_across(increment, wrinkle.normal)
    if not math.isnan(size):
        angle, size = _newton(increment, wrinkle, angle, size)
    if math.isnan(size):
        # Hardly taut along the wrinkle: the normal is nearly that of the slack state.
        s_new[:] = 0.0
        angle, size = _newton(increment, wrinkle, slack_angle, slack_size)
    if math.isnan(size):
        angle, size = _start(increment, wrinkle)
        if not math.isnan(size):
            angle, size = _newton(increment, wrinkle, angle, size)
    if math.isnan(size):
        return False
    _write_strain_slope(increment.response.tangent, size, work)
    return True


@compiled(internal=True)
def _write_strain_slope(tangent: Array, size: float, work: WrinkleWork) -> None:
    """Write the derivative of the fabric's strain by the total strain, of a wrinkled state.

    Parameters
    ----------
    tangent : (3, 3) array, MPa
        d stress / d strain of the law.
    size : float
        Of the wrinkle strain.
    work : WrinkleWork
    """
    # d(size, angle) = -inverse [n; m] T dh, and he changes by n d(size) + 2 size m d(angle) + dh.
    n = work.wrinkle.normal
    m = work.wrinkle.along
    inverse = work.wrinkle.inverse
    for j in range(3):
        across = 0.0
        shear = 0.0
        for i in range(3):
            across += n[i] * tangent[i, j]
            shear += m[i] * tangent[i, j]
        grow = inverse[0, 0] * across + inverse[0, 1] * shear
        turn = inverse[1, 0] * across + inverse[1, 1] * shear
        for i in range(3):
            unchanged = 1.0 if i == j else 0.0
            work.strain_slope[i, j] = unchanged - n[i] * grow - 2.0 * size * m[i] * turn


@compiled(internal=True)
def _wrinkled_as_before(increment: FabricIncrement, strain: Array, work: WrinkleWork) -> bool:
    """Find the wrinkled state from the wrinkle strain (3,) of the last evaluation, and write it.

    False where it was taut or slack there, or if no wrinkled state is found; see `_wrinkled`.
    """
    size = strain[0] + strain[1]
    if not size > 0.0 or abs(strain[0] * strain[1] - 0.25 * strain[2] ** 2) > ONE_WAY * size**2:
        return False
    angle = 0.5 * math.atan2(strain[2], strain[0] - strain[1])
    angle, size = _newton(increment, work.wrinkle, angle, size)
    if math.isnan(size):
        return False
    _write_strain_slope(increment.response.tangent, size, work)
    return True


#: States that `relaxed_update` returns; integers of a fixed type, as `pieces.WARP`.
NO_STRESS = np.int64(-1)
TAUT = np.int64(0)
WRINKLED = np.int64(1)
SLACK = np.int64(2)


@compiled(internal=True)
def _stress_with_wrinkles(increment: FabricIncrement, share: float, work: WrinkleWork) -> None:
    """Write the stress with what resists the wrinkle strain, and its derivative as the tangent.

    Arguments as those of `relaxed_update`.
    """
    pieces = increment.law.pieces
    nu = increment.law.coupling[0]
    tangent = increment.response.tangent
    warp = increment_modulus(pieces, WARP, 0.0, 0.0)[0]
    fill = increment_modulus(pieces, FILL, 0.0, 0.0)[0]
    stiffness = work.stiffness_left
    stiffness[:] = 0.0
    stiffness[0, 0] = share * warp / (1.0 - nu * nu * fill / warp)
    stiffness[1, 1] = stiffness[0, 0] * fill / warp
    stiffness[0, 1] = stiffness[1, 0] = nu * stiffness[1, 1]
    stiffness[2, 2] = share * increment_modulus(pieces, SHEAR, 0.0, 0.0)[0]
    total = work.tangent
    for i in range(3):
        work.membrane_stress[i] = increment.after.stress[i]
        for j in range(3):
            work.membrane_stress[i] -= stiffness[i, j] * (
                increment.after.strain[j] - increment.total[j]
            )
            total[i, j] = stiffness[i, j]
            for k in range(3):
                total[i, j] += (tangent[i, k] - stiffness[i, k]) * work.strain_slope[k, j]
    for i in range(3):
        for j in range(3):
            tangent[i, j] = total[i, j]


@compiled(internal=True)
def _relaxed_update(increment: FabricIncrement, share: float, work: WrinkleWork) -> np.int64:
    """Do what `relaxed_update` does."""
    h = increment.total
    he = increment.after.strain
    s_new = increment.after.stress
    strain_slope = work.strain_slope
    strain_slope[:] = 0.0
    for i in range(3):
        he[i] = h[i]
        strain_slope[i, i] = 1.0
    if not stress_update(increment.law, increment.before, increment.after, increment.response):
        return NO_STRESS
    stiffness = increment.response.tangent[0, 0]
    if smaller_principal(s_new[0], s_new[1], s_new[2]) >= -ROUNDING * stiffness:
        for i in range(3):
            work.membrane_stress[i] = s_new[i]
        return TAUT
    t0 = s_new[0]
    t1 = s_new[1]
    t2 = s_new[2]
    state = WRINKLED
    slack_angle = 0.0
    slack_size = 0.0
    if slack(increment):
        w0 = he[0] - h[0]
        w1 = he[1] - h[1]
        w2 = 0.5 * (he[2] - h[2])
        if smaller_principal(w0, w1, w2) >= -ROUNDING:
            state = SLACK
            strain_slope[:] = 0.0
        slack_angle = 0.5 * math.atan2(w2, 0.5 * (w0 - w1))
        slack_size = 0.5 * (w0 + w1) + math.hypot(0.5 * (w0 - w1), w2)
    if state == WRINKLED:
        s_new[0] = t0
        s_new[1] = t1
        s_new[2] = t2
        if not _wrinkled(increment, slack_angle, slack_size, work):
            return NO_STRESS
    _stress_with_wrinkles(increment, share, work)
    return state


@compiled()
def relaxed_update(increment: FabricIncrement, share: float, work: WrinkleWork) -> np.int64:
    """Integrate as `stress_update`, for a membrane that wrinkles.

    Parameters
    ----------
    increment : FabricIncrement
        Its `response.tangent` becomes the derivative of `work.membrane_stress` by the total strain.
    share : float
        Share of the stiffness at zero strain that resists the wrinkle strain.
    work : WrinkleWork
        Its `membrane_stress` and `strain_slope` are written.

    Returns
    -------
    int
        0 where the membrane is taut, 1 where it wrinkles, 2 where it is slack, and -1 where there
        is no stress.
    """
    return _relaxed_update(increment, share, work)


@compiled(internal=True)
def relaxed_membrane_stress(
    increment: FabricIncrement,
    green: CauchyGreen,
    share: float,
    wrinkle_strain: Array,
    response: PointResponse,
    work: WrinkleWork,
) -> np.int64:
    """Write stress and stiffness of a membrane that may wrinkle, as `membrane_stress` does.

    Parameters
    ----------
    increment : FabricIncrement
        Its `total` is written from `green`; its `response` is `response.law`.
    green : CauchyGreen
        Deformation of the surface at the end of the increment.
    share : float
        Share of the stiffness at zero strain that resists the wrinkle strain.
    wrinkle_strain : (3,) array
        That of the last evaluation, from which the search starts; written.
    response : PointResponse
    work : WrinkleWork
        Both are written.

    Returns
    -------
    int
        State, as of `relaxed_update`.
    """
    h = increment.total
    if not log_strain(green, h, response.strain_slope):
        return NO_STRESS
    state = WRINKLED
    if _wrinkled_as_before(increment, wrinkle_strain, work):
        _stress_with_wrinkles(increment, share, work)
    else:
        state = _relaxed_update(increment, share, work)
    if state < 0:
        return NO_STRESS
    area_power = increment.law.area_power
    he = increment.after.strain
    for i in range(3):
        wrinkle_strain[i] = he[i] - h[i]
    slope = work.strain_slope
    ratio = math.exp(area_power * (he[0] + he[1]))
    growth = (
        area_power * (slope[0, 0] + slope[1, 0]),
        area_power * (slope[0, 1] + slope[1, 1]),
        area_power * (slope[0, 2] + slope[1, 2]),
    )
    referred_stress(green, ratio, growth, work.membrane_stress, response)
    return state


@compiled()
def relaxed_increments(
    law: CompiledLaw,
    h: Array,
    h_old: Array,
    s_old: Array,
) -> tuple[Array, Array]:
    """Return strain and stress of the fabric after increments from h_old and s_old.

    Parameters
    ----------
    law : CompiledLaw
        A law without a memory.
    h : (n, 3) array
        Total log strain at the end.
    h_old, s_old : (n, 3) array
        Log strain and stress (MPa) of the fabric at the start.

    Returns
    -------
    strain, stress : (n, 3) ndarray
        At the end; NaN where there is no stress.
    """
    he = np.empty(h.shape)
    s = np.empty(h.shape)
    work = wrinkle_work()
    response = point_response().law
    for i in range(len(h)):
        before = PointState(h_old[i], s_old[i])
        increment = FabricIncrement(law, before, h[i], PointState(he[i], s[i]), response)
        if _relaxed_update(increment, 0.0, work) < 0:
            he[i] = np.nan
            s[i] = np.nan
    return he, s
