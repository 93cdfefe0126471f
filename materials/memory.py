"""Unloading and reloading of the law: permanent set and hysteresis, compiled.

A law with a memory keeps, for each strain component x (warp, fill, shear), the largest strain m of
its history and a stress f, the integral of the component's modulus along the history. On first
loading f = F(x), the integral of the modulus from 0 to x without a memory. Below m, with the
permanent set p = m set / (1 + saturation m), L = m - p, F = F(m), K = F / L, s = (x - p) / L, and
(x0, f0) the strain and stress where the present unloading or reloading began,

    unloading from (x0, f0)             f = f0 g(s) / g(s0),  g = (2 - U) s + (U - 1) s^2
    reloading from (x0, f0) to (m, F)   F - f = R K (m - x) + B ((m - x) / (m - x0))^2
                                        with B = F - f0 - R K (m - x0)
    below p, both ways                  f = (2 - U) K (x - p); of shear F (x - p) / (m + p)

U and R are the tangent moduli at m, of unloading and of reloading, over the mean stiffness K; a
whole loop from m to p and back dissipates F L (U - R) / 6. The modulus of an increment is
(f - f_old) / (x - x_old), so that each branch is exact in any number of increments. Shear of either
sign follows the same curves; m has the sign of the largest shear.

The strain vector of such a law has 9 entries: eps1, eps2, gamma12, then m of each, then f of each.
coupling[3:] has the constants set, U, R and saturation of warp, then those of fill and of shear.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..compilation import compiled
from ..errors import InputError
from .forms.base import STRAIN_NAMES, Array
from .pieces import CompiledLaw, LawSlopes, by_pieces, increment_modulus, integral_of, point_modulus

#: Number of entries of `coupling`, and of a strain vector, of a law without a memory.
PLAIN = 3
#: Increments of strain below this are not divided by, as f - f_old would be rounding.
TINY = 1e-10
QUANTITIES = ("set", "unloading", "reloading", "saturation")
#: Names of the parameters, in the order of `coupling`.
NAMES = tuple(f"{quantity}_{name}" for name in STRAIN_NAMES for quantity in QUANTITIES)
FIELDS = ("permanent_set", "unloading", "reloading", "saturation")
#: Positions in the vector that `recall` writes: f and m after the increment; the derivatives of f
#: by x, x_old, f_old, m, F, set, U, R and saturation (BY_FADE); the strain (its size) at which F is
#: taken (TOP); and 1 where that is the new strain x, as on first loading (ON).
(
    F_NEW,
    M_NEW,
    BY_X,
    BY_OLD,
    BY_F,
    BY_M,
    BY_TOP,
    BY_SET,
    BY_U,
    BY_R,
    BY_FADE,
    TOP,
    ON,
) = range(13)
RECALLED = 13


@dataclass(frozen=True)
class Memory:
    """Constants of unloading and reloading; each is given for warp, fill and shear.

    Parameters
    ----------
    permanent_set : (3,) sequence of float
        Share of the largest strain m that remains without stress, in the limit of small m; 0 to
        below 1.
    unloading, reloading : (3,) sequence of float
        Tangent modulus at m, where unloading begins and where reloading ends, over the mean modulus
        between permanent set and m; 1 <= reloading <= unloading < 2.
    saturation : (3,) sequence of float
        Per unit of strain, 0 or more: how fast that share falls as m grows, to
        permanent_set / (1 + saturation m).

    Raises
    ------
    InputError
        For numbers out of these ranges.
    """

    permanent_set: Sequence[float]
    unloading: Sequence[float]
    reloading: Sequence[float] = (1.0, 1.0, 1.0)
    saturation: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for field in FIELDS:
            values = tuple(float(x) for x in getattr(self, field))
            if len(values) != len(STRAIN_NAMES):
                problem = f"expected a number of {', '.join(STRAIN_NAMES)}, got {len(values)}"
                raise InputError(None, f"memory.{field}", problem)
            object.__setattr__(self, field, values)
        for name, *constants in zip(STRAIN_NAMES, *(getattr(self, f) for f in FIELDS), strict=True):
            permanent, up, back, fade = constants
            if not 0 <= permanent < 1:
                problem = f"{name}: expected 0 to below 1, got {permanent:g}"
                raise InputError(None, "memory.permanent_set", problem)
            if not 1 <= back <= up < 2:
                problem = f"{name}: expected 1 <= reloading <= unloading < 2, got {back:g}, {up:g}"
                raise InputError(None, "memory.unloading", problem)
            if not 0 <= fade < math.inf:
                raise InputError(
                    None, "memory.saturation", f"{name}: expected 0 or more, got {fade:g}"
                )

    @property
    def constants(self) -> tuple[float, ...]:
        """Return the numbers that `NAMES` lists."""
        rows = zip(*(getattr(self, field) for field in FIELDS), strict=True)
        return tuple(x for row in rows for x in row)

    @classmethod
    def of(cls, constants: Sequence[float]) -> "Memory":
        """Return the memory of the numbers that `NAMES` lists."""
        return cls(*(constants[k :: len(FIELDS)] for k in range(len(FIELDS))))

    def with_constants(self, numbers: Mapping[str, float]) -> "Memory":
        """Return the memory with other numbers by name; reloading stays below unloading."""
        constants = dict(zip(NAMES, self.constants, strict=True)) | dict(numbers)
        for k in range(2, len(NAMES), len(QUANTITIES)):
            # A step of a fit may leave reloading above unloading by rounding.
            constants[NAMES[k]] = min(constants[NAMES[k]], constants[NAMES[k - 1]])
        return Memory.of(list(constants.values()))

    def kept(self, component: int, largest: float) -> float:
        """Return the permanent set (log strain) of a component after a largest strain."""
        fade = 1.0 + self.saturation[component] * largest
        return self.permanent_set[component] * largest / fade


class Loop(NamedTuple):
    """Constants of unloading and reloading below a largest strain m, which counts as positive.

    Attributes
    ----------
    component : int
    m : float
    share : float
        The share of m that is permanent set.
    top : float, MPa
        F(m).
    unloading, reloading : float
        U and R.
    """

    component: int
    m: float
    share: float
    top: float
    unloading: float
    reloading: float


@compiled(internal=True)
def _below_set(loop: Loop, b: float, out: Array) -> None:
    """Write f and derivatives at the strain b below the permanent set, on a straight line.

    Loading and unloading are the same there.

    Parameters
    ----------
    loop : Loop
    b : float
    out : array
        Written at the positions F_NEW, BY_X and so on, as `recall` describes.
    """
    m = loop.m
    top = loop.top
    p = loop.share * m
    if loop.component == 2:
        slope = top / (m + p)
        by_set = -slope / (1.0 + loop.share)
    else:
        slope = (2.0 - loop.unloading) * top / (m - p)
        by_set = slope / (1.0 - loop.share)
        out[BY_U] = -top / (m - p) * (b - p)
    out[F_NEW] = slope * (b - p)
    out[BY_X] = slope
    out[BY_M] = -slope / m * (b - p) - slope * loop.share
    out[BY_SET] = by_set * (b - p) - slope * m
    out[BY_TOP] = (b - p) * slope / top


@compiled(internal=True)
def _unloading(
    loop: Loop,
    a: float,
    b: float,
    f: float,
    out: Array,
) -> None:
    """Write f and its derivatives after unloading from the strain a with the stress f to b.

    Parameters
    ----------
    out : array
        Written at the positions F_NEW, BY_X and so on, as `recall` describes.
    """
    m = loop.m
    up = loop.unloading
    p = loop.share * m
    length = m - p
    s0 = (a - p) / length
    s1 = (b - p) / length
    g0 = ((2.0 - up) + (up - 1.0) * s0) * s0
    g1 = ((2.0 - up) + (up - 1.0) * s1) * s1
    slope0 = (2.0 - up) + 2.0 * (up - 1.0) * s0
    slope1 = (2.0 - up) + 2.0 * (up - 1.0) * s1
    share = f / g0
    out[F_NEW] = share * g1
    out[BY_F] = g1 / g0
    out[BY_X] = share * slope1 / length
    out[BY_OLD] = -share * g1 / g0 * slope0 / length
    by0 = slope0 * -a / (length * m)
    by1 = slope1 * -b / (length * m)
    out[BY_M] = share * (by1 - g1 / g0 * by0)
    by0 = slope0 * m * (s0 - 1.0) / length
    by1 = slope1 * m * (s1 - 1.0) / length
    out[BY_SET] = share * (by1 - g1 / g0 * by0)
    out[BY_U] = share * (s1 * (s1 - 1.0) - g1 / g0 * s0 * (s0 - 1.0))


@compiled(internal=True)
def _reloading(
    loop: Loop,
    a: float,
    b: float,
    f: float,
    out: Array,
) -> None:
    """Write f and its derivatives after reloading from the strain a with the stress f to b < m.

    Parameters
    ----------
    out : array
        Written at the positions F_NEW, BY_X and so on, as `recall` describes.
    """
    m = loop.m
    p = loop.share * m
    length = m - p
    mean = loop.top / length
    from_set = a < p
    if from_set:
        a = p
        f = 0.0
    whole_way = m - a
    remaining_way = m - b
    steep = loop.reloading * mean
    q = remaining_way / whole_way
    excess = loop.top - f - steep * whole_way
    out[F_NEW] = loop.top - steep * remaining_way - excess * q * q
    out[BY_X] = steep + 2.0 * excess * q / whole_way
    by_a = -steep * q * q - 2.0 * excess * q * q / whole_way
    by_steep = whole_way * q * q - remaining_way
    out[BY_M] = steep * (q * q - 1.0) - 2.0 * excess * q * (b - a) / (whole_way * whole_way)
    out[BY_M] -= by_steep * steep / m
    out[BY_TOP] = 1.0 - q * q + by_steep * loop.reloading / length
    out[BY_SET] = by_steep * steep / (1.0 - loop.share)
    out[BY_R] = by_steep * mean
    if from_set:
        out[BY_M] += by_a * loop.share
        out[BY_SET] += by_a * m
    else:
        out[BY_OLD] = by_a
        out[BY_F] = q * q


@compiled(internal=True)
def _first_loading(
    pieces: Array,
    k: int,
    x: float,
    out: Array,
) -> None:
    """Write f = F(x) and its derivatives beyond the largest strain.

    Parameters
    ----------
    pieces : (3, P, 5) array
        Upper end and cubic (MPa) of each piece of the moduli.
    k : int
        Component of the strain.
    x : float
    out : array
        Written at the positions F_NEW, BY_X and so on, as `recall` describes.
    """
    if k == 2 or x > 0.0:
        out[ON] = 1.0
        out[TOP] = abs(x)
        out[M_NEW] = x
        out[BY_TOP] = -1.0 if x < 0.0 else 1.0
        out[F_NEW] = out[BY_TOP] * integral_of(pieces, k, 0.0, abs(x))
        out[BY_X] = point_modulus(pieces, k, x)


@compiled(internal=True)
def recall(
    law: CompiledLaw,
    k: int,
    x: float,
    x_old: float,
    largest: float,
    stress_old: float,
    out: Array,
) -> bool:
    """Write stress f and largest strain m of a component after an increment, and derivatives of f.

    Parameters
    ----------
    law : CompiledLaw
        A law with a memory.
    k : int
        Component: 0 warp, 1 fill, 2 shear.
    x, x_old : float
        Its log strain at the end and at the start of the increment.
    largest : float
        m before the increment, with its sign.
    stress_old : float
        f before the increment, MPa.
    out : (RECALLED,) array
        Written; its entries are named from F_NEW to ON.

    Returns
    -------
    bool
        False where the whole increment is first loading; the derivatives are then those of F(x).
    """
    pieces = law.pieces
    coupling = law.coupling
    out[:] = 0.0
    out[M_NEW] = largest
    m = abs(largest)
    side = -1.0 if largest < 0.0 else 1.0
    a = side * x_old
    b = side * x
    first = m == 0.0 or (a >= m and b >= a)
    if first or b > m or (k == 2 and b < -m):
        _first_loading(pieces, k, x, out)
        return not first
    fade = 1.0 / (1.0 + coupling[6 + 4 * k] * m)
    share = coupling[3 + 4 * k] * fade
    top = integral_of(pieces, k, 0.0, m)
    loop = Loop(
        k,
        m,
        share,
        top,
        coupling[4 + 4 * k],
        coupling[5 + 4 * k],
    )
    p = share * m
    out[TOP] = m
    if b < p or (b <= p and b >= a):
        _below_set(loop, b, out)
    elif b < a:
        _unloading(loop, a, b, side * stress_old, out)
    else:
        _reloading(loop, a, b, side * stress_old, out)
    # From the share that is kept to its parameters.
    out[BY_M] -= out[BY_SET] * share * coupling[6 + 4 * k] * fade
    out[BY_FADE] = -out[BY_SET] * share * m * fade
    out[BY_SET] *= fade
    # Of the side on which the largest strain lies: f, F and the constants have its sign.
    for entry in (F_NEW, BY_TOP, BY_SET, BY_U, BY_R, BY_FADE):
        out[entry] *= side
    return True


@compiled()
def recalled_modulus(
    law: CompiledLaw,
    k: int,
    h: Array,
    h_old: Array,
) -> tuple[float, float, float]:
    """Return the mean modulus of component k and its derivatives, of a law with a memory.

    As `increment_modulus`, for the increment from the strain vector h_old (9,) to h (9,), of which
    m and f of the component are written.
    """
    out = np.empty(RECALLED)
    x = h[k]
    x_old = h_old[k]
    stress_old = h_old[6 + k]
    is_recalled = recall(
        law,
        k,
        x,
        x_old,
        h_old[3 + k],
        stress_old,
        out,
    )
    h[3 + k] = out[M_NEW]
    h[6 + k] = out[F_NEW]
    if not is_recalled:
        return increment_modulus(law.pieces, k, x, x_old)
    change = x - x_old
    if abs(change) < TINY:
        return out[BY_X], 0.0, 0.0
    mean = (out[F_NEW] - stress_old) / change
    return mean, (out[BY_X] - mean) / change, (out[BY_OLD] + mean) / change


@compiled(internal=True)
def remember(
    law: CompiledLaw,
    k: int,
    h: Array,
    h_old: Array,
    slopes: LawSlopes,
    dh_old: Array,
    weights: Array,
    mean: Array,
    out: Array,
) -> None:
    """Carry derivatives by p parameters through the memory of component k, at fixed strain h[k].

    Parameters
    ----------
    law : CompiledLaw
        A law with a memory.
    k : int
        Component: 0 warp, 1 fill, 2 shear.
    h, h_old : (9,) array
        Strain vectors at the end and at the start of the increment.
    slopes : LawSlopes
        Derivatives of the law's constants by the parameters.
    dh_old : (9, p) array
        Derivatives of h_old by the parameters. Those of m and f of the component are replaced by
        their derivatives after the increment.
    weights : (P, 4) array
        Scratch.
    mean : (p,) array
        Derivatives of the mean modulus of the increment at fixed strains; written unless all of the
        increment is first loading.
    out : (RECALLED,) array
        Written as by `recall`.
    """
    pieces = law.pieces
    is_recalled = recall(
        law,
        k,
        h[k],
        h_old[k],
        h_old[3 + k],
        h_old[6 + k],
        out,
    )
    change = h[k] - h_old[k]
    by_m = out[BY_M]
    if out[ON] == 0.0:  # F is that of the largest strain before
        steep = point_modulus(pieces, k, out[TOP])
        by_m += out[BY_TOP] * (-steep if h_old[3 + k] < 0.0 else steep)
    first, stop = by_pieces(pieces, k, out[TOP], 0.0, weights)
    for j in range(mean.shape[0]):
        total = 0.0
        for piece in range(first, stop):
            for power in range(4):
                total += weights[piece, power] * slopes.rows[k, piece, power, j]
        total *= out[BY_TOP] * out[TOP]
        total += by_m * dh_old[3 + k, j] + out[BY_F] * dh_old[6 + k, j]
        for i in range(4):
            total += out[BY_SET + i] * slopes.coupling[PLAIN + 4 * k + i, j]
        if is_recalled:
            mean[j] = (total - dh_old[6 + k, j]) / change if abs(change) >= TINY else 0.0
        dh_old[6 + k, j] = total + out[BY_OLD] * dh_old[k, j]
        dh_old[3 + k, j] *= 1.0 - out[ON]


@compiled()
def own_stress(
    law: CompiledLaw,
    k: int,
    strain: Array,
    slopes: LawSlopes,
) -> tuple[Array, Array]:
    """Return the stress f of one component along a history of its strain, and its derivatives.

    For warp (k = 0) and fill (k = 1) it is the stress of a bar that is pulled along these yarns and
    free to contract across.

    Parameters
    ----------
    law : CompiledLaw
        A law with a memory.
    k : int
        Component.
    strain : (n,) array
        Log strain, one increment after the other, from a first one that begins at zero.
    slopes : LawSlopes
        Derivatives of the law's constants by p parameters.

    Returns
    -------
    stress : (n,) ndarray, MPa
    stress_slopes : (n, p) ndarray
        Derivatives of the stress by the parameters.
    """
    count = slopes.coupling.shape[1]
    stress = np.empty(len(strain))
    stress_slopes = np.empty((len(strain), count))
    out = np.empty(RECALLED)
    h = np.zeros(9)
    h_old = np.zeros(9)
    by = np.zeros((9, count))
    weights = np.empty((law.pieces.shape[1], 4))
    mean = np.empty(count)
    for i in range(len(strain)):
        h[k] = strain[i]
        remember(
            law,
            k,
            h,
            h_old,
            slopes,
            by,
            weights,
            mean,
            out,
        )
        h_old[k] = strain[i]
        h_old[3 + k] = out[M_NEW]
        h_old[6 + k] = out[F_NEW]
        stress[i] = out[F_NEW]
        stress_slopes[i] = by[6 + k]
    return stress, stress_slopes
