"""Compute uniaxial, trellis and biaxial responses of the law, and tables of its moduli.

Uniaxial: free to contract across. Trellis: yarns keep their length while the angle changes.
Biaxial: a patch without shear, loads per width before the test, an increment a load:

    n1 = t0 (J2)^p sigma1 / lambda1,    n2 = t0 (J2)^p sigma2 / lambda2,   J2 = lambda1 lambda2
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..files import compiled
from .forms.base import COMPONENTS, UNLIMITED, Array
from .law import HypoelasticLaw, law_slopes
from .pieces import by_pieces
from .point_law import SLOPES, stress_rate, stress_update

#: "true": log strain and Cauchy stress. "nominal": change of length (or of angle, radians) and
#: force per reference area (trellis: stress that does work on the angle). "green": Green-Lagrange
#: strain (shear: engineering, 2 E12) and 2nd Piola-Kirchhoff stress. All stresses are forces over
#: areas of the reference thickness.
Measure = Literal["true", "nominal", "green"]
MEASURES: tuple[Measure, ...] = ("true", "nominal", "green")
#: Increments of the law between two points of a curve.
STEPS = 16
ROUNDS = 50


def bar(law: HypoelasticLaw, pulled: int, log_strain: ArrayLike) -> tuple[Array, Array]:
    """Return log strain and Cauchy stress (n, 3), MPa, of a bar; pulled : 0 warp, 1 fill."""
    free = 1 - pulled
    ends = np.asarray(log_strain, dtype=float)
    strains = np.empty((len(ends), 3))
    stresses = np.empty((len(ends), 3))
    state = np.zeros((1, 3))
    stress = np.zeros((1, 3))
    for i, end in enumerate(ends):
        new = state[0, :3].copy()
        new[pulled] = end
        for _ in range(ROUNDS):
            trial, tangent, _ = law.follow(state, new, stress)
            new[free] -= trial[0, free] / tangent[0, free, free]
            if not abs(trial[0, free]) > 1e-13 * abs(trial[0, pulled]):
                break
        trial, _, after = law.follow(state, new, stress)
        if not np.isfinite(trial).all():
            what = f"at {100 * end:.4g} % of log strain of a bar"
            problem = f"a modulus or 1 - nu12 nu21 is not positive {what}"
            raise InputError(None, "beta", problem)
        state = after
        stress = trial
        strains[i] = new
        stresses[i] = trial[0]
    return strains, stresses


def uniaxial_curve(
    law: HypoelasticLaw, pulled: int, log_strain: ArrayLike, measure: Measure
) -> tuple[Array, Array]:
    """Return strain (n,) and stress (n,), MPa, in `measure` at log strains, one after the other."""
    ends = np.asarray(log_strain, dtype=float)
    fine = _refined(ends)
    h, s = bar(law, pulled, fine)
    h = _at(ends, h)
    s = _at(ends, s)
    # Force per reference area: sigma t0 J2^(p - 1) on the width exp(eps across) (law.area_power).
    area = np.exp(law.area_power * (h[:, 0] + h[:, 1]))
    stretch = np.exp(h[:, pulled])
    force = s[:, pulled] * area / stretch
    if measure == "nominal":
        return stretch - 1, force
    if measure == "green":
        return 0.5 * (stretch**2 - 1), force / stretch
    return h[:, pulled], s[:, pulled] * np.exp((law.area_power - 1) * (h[:, 0] + h[:, 1]))


def trellis_curve(
    law: HypoelasticLaw, angle: ArrayLike, measure: Measure
) -> tuple[Array, Array, Array]:
    """Return shear strain, shear stress (n,) and stress along the yarns (n, 2), MPa.

    The last is 2nd Piola-Kirchhoff stress whatever the measure. angle : (n,) rising, radians.
    """
    ends = np.asarray(angle, dtype=float)
    fine = _refined(ends)
    rows = np.empty((len(fine), 9))
    strain = np.zeros((1, 3))
    stress = np.zeros((1, 3))
    for i, turn in enumerate(fine):
        gradient = np.array([[[1.0, np.sin(turn)], [0.0, np.cos(turn)]]])
        pk2, _, strain, stress = law.second_piola_kirchhoff(gradient, strain, stress)
        rows[i] = np.concatenate([pk2[0], strain[0, :3], stress[0]])
    if not np.isfinite(rows).all():
        raise InputError(
            None, "beta", "a modulus or 1 - nu12 nu21 is not positive in a trellis shear"
        )
    rows = _at(ends, rows)
    yarns = rows[:, :2]
    s12 = rows[:, 2]
    area = np.exp(rows[:, 3] + rows[:, 4])
    if measure == "nominal":
        # S12 dC12 = T d(angle) with C12 = sin(angle).
        return ends, s12 * np.cos(ends), yarns
    if measure == "green":
        return np.sin(ends), s12, yarns
    return rows[:, 5], rows[:, 8] * area ** (law.area_power - 1), yarns


def trellis_angle(gamma12: float) -> float:
    """Return the change of angle (radians) at a log strain gamma12 = atanh(sin a)."""
    return float(np.arcsin(np.tanh(gamma12)))


def _refined(ends: Array) -> Array:
    """Return every point, and STEPS increments up to it, from zero; a leading zero adds none."""
    starts = np.concatenate([[0.0], ends[:-1]])
    return np.concatenate(
        [a + (b - a) * np.arange(1, STEPS + 1) / STEPS for a, b in zip(starts, ends, strict=True)]
    )


def _at(ends: Array, fine: Array) -> Array:
    return fine[STEPS - 1 :: STEPS][: len(ends)]


#: Newton iterations of one load, and halvings of a step that does not come nearer.
ROUNDS_BIAXIAL_RESPONSE, HALVINGS = 60, 40
#: Of the largest load: what is left of an equilibrium's forces.
TOLERANCE = 1e-13


@dataclass(frozen=True, eq=False)
class BiaxialResponse:
    """A patch at one load after the other, `reached` of them; beyond NaN; stable: takes work.

    strain : (n, 2) log. stress : (n, 2) MPa, Cauchy. slope : (n, 2, parameters) of the strain.
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
    """Return a patch's strains at loads (n, 2) N/mm; parameters : "beta_i", "nu12", "thickness"."""
    asked = np.ascontiguousarray(np.atleast_2d(np.asarray(loads, dtype=float)))
    rows, by_coupling = law_slopes(law, parameters, thickness)
    strain, stress = np.full((2, len(asked), 2), np.nan)
    slope = np.full((len(asked), 2, len(parameters)), np.nan)
    stable = np.zeros(len(asked), dtype=bool)
    reached = _path(
        law.pieces,
        law.coupling,
        law.area_power,
        thickness,
        asked,
        rows,
        by_coupling,
        strain,
        stress,
        slope,
        stable,
    )
    return BiaxialResponse(strain, stress, slope, int(reached), stable)


@compiled()
def _forces(  # type: ignore[no-untyped-def]
    pieces, coupling, power, thickness, load, h_old, s_old, h, s, tangent, slopes, rest, k
):
    """Write forces per width less the load to rest (2,), derivatives to k (2, 2)."""
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
    """Solve load by load; return how many have an equilibrium."""
    nu = coupling[0]
    count = by_coupling.shape[1]
    h = np.zeros(3)
    h_old = np.zeros(3)
    trial = np.zeros(3)
    s = np.zeros(3)
    s_old = np.zeros(3)
    tangent = np.empty((3, 3))
    slopes = np.empty(SLOPES)
    rest = np.empty(2)
    k = np.empty((2, 2))
    step = np.empty(2)
    weights = np.empty((pieces.shape[1], 4))
    dh = np.zeros((2, count))
    ds = np.zeros((2, count))
    own = np.zeros((2, count))
    largest = 1e-12
    for n in range(len(loads)):
        load = loads[n]
        largest = max(largest, max(abs(load[0]), abs(load[1])))
        h = h_old.copy()
        good = _forces(
            pieces, coupling, power, thickness, load, h_old, s_old, h, s, tangent, slopes, rest, k
        )
        for _ in range(ROUNDS_BIAXIAL_RESPONSE):
            if not good or _size(rest) <= TOLERANCE * largest:
                break
            before = _size(rest)
            det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
            step[0] = (k[0, 1] * rest[1] - k[1, 1] * rest[0]) / det
            step[1] = (k[1, 0] * rest[0] - k[0, 0] * rest[1]) / det
            share = 1.0
            for _ in range(HALVINGS):
                trial[0] = h[0] + share * step[0]
                trial[1] = h[1] + share * step[1]
                good = _forces(
                    pieces,
                    coupling,
                    power,
                    thickness,
                    load,
                    h_old,
                    s_old,
                    trial,
                    s,
                    tangent,
                    slopes,
                    rest,
                    k,
                )
                if good and (_size(rest) < before or before < 1e-9 * largest):
                    break
                share *= 0.5
            h = trial.copy()
            if before < 1e-9 * largest and _size(rest) >= before:
                break  # rounding
        if not good or not _size(rest) <= 1e-9 * largest:
            return n
        det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
        a = k[0, 0] * math.exp(-h[0])
        b = k[1, 1] * math.exp(-h[1])
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
            arm0 = thickness * math.exp(power * (h[0] + h[1]) - h[0])
            arm1 = thickness * math.exp(power * (h[0] + h[1]) - h[1])
            for j in range(count):
                stress_rate(slopes, nu, own, by_coupling, j, dh, ds, ds)
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
        h_old = h.copy()
        s_old = s.copy()
    return len(loads)


#: Increments of each side of a closed path; strain to which it goes along yarns without a range.
SIDE, REACH_CLOSED = 40, 0.05


@dataclass(frozen=True)
class ClosedPath:
    """The work of a law along strains 0, (a, 0), (a, b), (0, b), 0 of warp and fill.

    ends : a and b, log strain. work : MPa, of the whole path; NaN where the law ends before.
    share : of the work from rest to (a, b). A law that has an energy does none.
    """

    ends: tuple[float, float]
    work: float
    share: float

    @property
    def words(self) -> str:
        corners = "0, (a, 0), (a, b), (0, b), 0"
        words = f"Work of the path of log strains {corners} with a, b = {self.ends[0]:.4g}, "
        words += f"{self.ends[1]:.4g}"
        if not np.isfinite(self.work):
            return f"{words} is not known: the law ends on the way."
        return f"{words}: {self.work:.3g} MPa, {100 * self.share:.2g} % of that to (a, b)."


def closed_path(
    law: HypoelasticLaw, ends: Sequence[float] | None = None, side: int = SIDE
) -> ClosedPath:
    """Return the work of first loading along a closed path; ends : those of the law's range, or
    5 % where it has none, unless given. side : increments of each of its four sides."""
    range_ = [float(end) for end in law.strain_range[:2]]
    a, b = ends or [end if end < UNLIMITED else REACH_CLOSED for end in range_]
    plain = law if law.memory is None else replace(law, memory=None)
    shares = np.arange(1, side + 1)[:, None] / side
    corners = [np.array([*corner, 0.0]) for corner in ((0, 0), (a, 0), (a, b), (0, b), (0, 0))]
    path = np.concatenate([start + shares * (end - start) for start, end in pairwise(corners)])
    work = _work(plain.pieces, plain.coupling, path)
    return ClosedPath((a, b), float(work.sum()), float(work.sum() / work[: 2 * side].sum()))


@compiled()
def _work(pieces, coupling, path):  # type: ignore[no-untyped-def]
    """Return (n,) MPa, the work of each increment of strain from rest to path (n, 3), or NaN."""
    work = np.full(len(path), np.nan)
    tangent = np.empty((3, 3))
    slopes = np.empty(SLOPES)
    h = np.zeros(3)
    s = np.zeros(3)
    s_old = np.zeros(3)
    for n in range(len(path)):
        if not stress_update(pieces, coupling, path[n], h, s_old, s, tangent, slopes):
            break
        work[n] = 0.5 * ((s + s_old) * (path[n] - h)).sum()
        h = path[n]
        s_old = s.copy()
    return work


#: kN/m: no fabric carries more. Halvings by which the end is found; increments of the law.
MOST, HALVINGS_BIAXIAL_REACH, LOADS = 1000.0, 50, 20


def largest_load(
    law: HypoelasticLaw, thickness: float, shares: Sequence[tuple[float, float]], ends: ArrayLike
) -> float:
    """Return the larger load (kN/m) at which every ratio keeps within strains (2,), or 0."""
    known = np.asarray(ends, dtype=float)

    def within(load: float) -> bool:
        larger = np.linspace(0.0, load, LOADS + 1)[1:]
        for pair in shares:
            found = biaxial_response(law, np.outer(larger, pair), thickness)
            if found.reached < LOADS or not (found.strain <= known).all():
                return False
        return True

    low = 0.0
    high = MOST
    for _ in range(HALVINGS_BIAXIAL_REACH):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if within(middle) else (low, middle)
    return low


def curve_pieces(law: HypoelasticLaw, name: str, coupled: bool = False) -> Array:
    """Return (n, 5) pieces of a modulus, MPa: upper end, then coefficients, highest power first.
    InputError for a law that depends on the loads' ratio, unless `coupled`: it is known, too."""
    if law.of_load_ratio and not coupled:
        problem = (
            f"a {law.form.name} law is for the solvers membrane and calculix: its stiffness "
            "depends on the ratio of the loads, and here moduli are of strain"
        )
        raise InputError(None, "form", problem)
    rows = law.pieces[COMPONENTS[name]]
    # What repeats the last piece ends where it does.
    return np.asarray(rows[: 1 + int((np.diff(rows[:, 0]) > 0).sum())])


def piece_constants(law: HypoelasticLaw, coupled: bool = False) -> tuple[float, ...]:
    """Return the numbers of pieces of E1, E2 and G12 (3), then the pieces of each, row by row."""
    curves = [curve_pieces(law, name, coupled) for name in ("E1", "E2", "G12")]
    numbers = np.concatenate([curve.ravel() for curve in curves])
    return (*(float(len(curve)) for curve in curves), *numbers.tolist())


#: Points from zero strain to the end of the range.
POINTS = 121
#: Where a table ends when the law's range does not.
REACH = 0.3
#: Strain over which a table makes the jump of a modulus: a table takes one value a strain.
JUMP = 1e-6
#: Difference of two pieces where they meet, over the modulus there, that is more than rounding.
ROUNDING = 1e-9
#: Strains between two points at which the error of a table is looked for.
BETWEEN = 16


@dataclass(frozen=True, eq=False)
class ModulusTable:
    """One tangent modulus by its log strain; straight between points, held beyond both ends.

    strain, modulus : (n,); G12 from -end to end. error : largest relative difference from the law
    between the points. jumps : strains where it jumps. reaches : the law's whole range is covered.
    """

    name: str
    strain: Array
    modulus: Array
    error: float
    jumps: Array
    reaches: bool

    def at(self, strain: NDArray[np.float64] | float) -> Array:
        """Return the modulus (MPa) that a solver reads off the table."""
        return np.asarray(np.interp(strain, self.strain, self.modulus))


def modulus_table(
    law: HypoelasticLaw, name: str, points: int = POINTS, reach: float = REACH
) -> ModulusTable:
    """Return a modulus at equally spaced strains and ends of pieces; reach : if it has no range."""
    if points < 2:
        raise InputError(None, "points", f"expected at least 2, got {points}")
    if not 0 < reach < UNLIMITED:
        raise InputError(None, "reach", f"expected a positive strain, got {reach:g}")
    component = COMPONENTS[name]
    end = float(law.strain_range[component])
    reaches = end < UNLIMITED
    end = end if reaches else reach
    strain = np.linspace(0.0, end, points)
    knots, jumps = _meetings(law, name, end)
    # An equally spaced strain inside a jump would make it a step of two slopes.
    spaced = strain[(np.abs(strain[:, None] - knots - JUMP / 2) >= JUMP).all(axis=1)]
    beyond = np.minimum(jumps + JUMP, end)
    strain = np.unique(np.concatenate([[0.0, end], spaced, knots, beyond]))
    modulus = law.modulus(name, strain)
    error = _error(law, name, strain, modulus, jumps)
    if name == "G12":
        strain = np.concatenate([-strain[:0:-1], strain])
        modulus = np.concatenate([modulus[:0:-1], modulus])
    return ModulusTable(name, strain, modulus, error, jumps, reaches)


def modulus_tables(
    law: HypoelasticLaw, points: int = POINTS, reach: float = REACH
) -> dict[str, ModulusTable]:
    return {name: modulus_table(law, name, points, reach) for name in COMPONENTS}


def _meetings(law: HypoelasticLaw, name: str, end: float) -> tuple[Array, Array]:
    """Return strains before `end` where one piece gives way to the next, and where it jumps."""
    pieces = curve_pieces(law, name)
    knots = pieces[:-1, 0]
    here, there = (
        np.array([np.polyval(piece[1:], knot) for piece, knot in zip(side, knots, strict=True)])
        for side in (pieces[:-1], pieces[1:])
    )
    jump = np.abs(there - here) > ROUNDING * np.maximum(np.abs(here), np.abs(there))
    inside = knots < end
    return knots[inside], knots[inside & jump]


def _error(law: HypoelasticLaw, name: str, strain: Array, modulus: Array, jumps: Array) -> float:
    starts = strain[:-1]
    widths = np.diff(strain)
    smooth = ~np.isin(starts, jumps)
    shares = np.arange(1, BETWEEN) / BETWEEN
    x = (starts[smooth, None] + widths[smooth, None] * shares).ravel()
    exact = law.modulus(name, x)
    off = np.abs(np.interp(x, strain, modulus) - exact)
    return float(np.max(off / np.maximum(np.abs(exact), np.finfo(float).tiny)))
