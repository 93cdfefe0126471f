"""Equilibria of a membrane: one level (Newton, line search), level after level, derivatives.

Strain is committed at levels only: the result does not depend on how a level was reached.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw, law_slopes
from ..base import Progress
from .cords import Cords
from .factorisation import SingularTangent, Tangent
from .kernel import (
    POINT,
    ReferenceElements,
    advance,
    assemble,
    by_sheet,
    element_slopes,
    explicit,
)

Array = NDArray[np.float64]
MOST_ITERATIONS, MOST_BACKTRACKS = 40, 8
# Below this residual, a step that shrank the residual this much is followed by a chord step
# (no new tangent): it costs a quarter of a Newton step and still gains one to two digits.
CHORD_BELOW, CHORD_GAIN = 1e-2, 0.15
# Below this residual, steps that gain no digits are rounding (fine meshes at low pressure), unless
# the residual falls from step to step (a tangent that is nearly singular).
ROUNDING_BELOW, MOST_IDLE = 1e-6, 3
# A slack sheet at low pressure can wander among folds without end: after so many iterations a
# residual beyond this, and so many times the first one, has not been seen to come back.
WANDERING, FAR, FARTHER = 12, 1e3, 5.0
# Where a modulus jumps full steps go to and fro: after this many, every step has to gain.
MOST_FRUITLESS = 3
#: Steps of a line search: after as many without equilibrium, half the way is tried instead.
MOST_STEPS = 16
#: Residuals computed in one step, and the share of the work along it that is good enough.
MOST_TRIALS, LEFT = 10, 0.5
#: A step is good enough, too, where the residual falls to this part or was as small as this.
GAIN, SMALL = 0.1, 1e-2
#: Part of the way to the end known to be too far: at least, where only that is known, at most.
NEAREST, BLIND, FARTHEST = 0.1, 0.3, 0.9
#: By name of a parameter, derivatives (n, 3) of the reference places and of the stress-free ones,
#: (3,) of the direction of the warp, and (elements, 4, 2, 2) of the stretch of the yarns.
SheetSlopes = Mapping[str, tuple[Array, Array, Array, Array]]


@dataclass(eq=False)
class Membrane:
    """State of an equilibrium iteration: strain and stress at start and end of an increment.

    reference (n, 3) mm; thickness mm, one or (elements,), as section; strain_* (elements, 4,
    law.state); stress_*, wrinkle (elements, 4, 3), the last the strain of the fabric less that of
    the surface; step_limit mm: the largest nodal correction of one iteration; keep_tangent: end
    every increment with its tangent assembled; wrinkle_stiffness: share left to wrinkles; None: the
    membrane carries compression. cords : beside it, None without.
    """

    reference: Array
    quads: NDArray[np.intp]
    elements: ReferenceElements
    thickness: float | Array
    law: HypoelasticLaw
    free: NDArray[np.intp]
    tangent: Tangent
    tolerance: float
    step_limit: float
    keep_tangent: bool = False
    iterations: int = 0
    wrinkle_stiffness: float | None = None
    cords: Cords | None = None
    wrinkle: Array = field(init=False)
    section: Array = field(init=False)
    strain_old: Array = field(init=False)
    stress_old: Array = field(init=False)
    strain_new: Array = field(init=False)
    stress_new: Array = field(init=False)
    residual: Array = field(init=False)

    def __post_init__(self) -> None:
        shape = (len(self.quads), 4, 3)
        state = (len(self.quads), 4, self.law.state)
        self.section = np.array(np.broadcast_to(self.thickness, len(self.quads)), dtype=float)
        self.strain_old = np.zeros(state)
        self.stress_old = np.zeros(shape)
        self.strain_new = np.zeros(state)
        self.stress_new = np.zeros(shape)
        self.wrinkle = np.zeros(shape)
        self.residual = np.zeros(3 * len(self.reference))

    def unbalance(self, u: Array, pressure: float, with_tangent: bool) -> float:
        """Return the largest free residual over the largest pressure force; inf without stress."""
        law = self.law
        e = self.elements
        force = assemble(
            self.reference + u,
            self.quads,
            e.values,
            e.slopes,
            e.area,
            self.section,
            pressure,
            law.pieces,
            law.coupling,
            law.area_power,
            self.strain_old,
            self.stress_old,
            self.strain_new,
            self.stress_new,
            self.tangent.slot,
            self.tangent.data,
            self.residual,
            with_tangent,
            self.wrinkle_stiffness,
            self.wrinkle,
        )
        self.iterations += 1
        if force < 0:
            return np.inf
        self.further_forces(u, with_tangent)
        if force == 0.0:  # no pressure: reactions of the prescribed unknowns are the measure
            force = float(np.abs(self.residual).max()) or 1.0
        ratio = float(np.abs(self.residual[self.free]).max()) / force
        return ratio if np.isfinite(ratio) else np.inf

    def further_forces(self, u: Array, with_tangent: bool) -> None:
        """Add forces beside stress and pressure to `residual` (and the tangent): of cords."""
        if self.cords is None:
            return
        pull, stiff = self.cords.forces(self.reference + u)
        np.add.at(self.residual.reshape(-1, 3), self.cords.nodes, pull)
        if with_tangent:
            self.add(self.tangent.slot[self.cords.quads], stiff.reshape(-1, 144))
            tangent = self.tangent
            for opens, steep in self.cords.sliding:
                tangent = tangent.inner  # type: ignore[attr-defined]
                tangent.border = opens[self.free]
                tangent.stiffness = steep

    def add(self, slot: NDArray[np.int64], entries: Array) -> None:
        """Add entries to the tangent at their places; those below zero are held."""
        slot, entries = np.broadcast_arrays(slot, entries)
        is_free = slot >= 0
        np.add.at(self.tangent.data, slot[is_free], entries[is_free])

    def accept(self) -> None:
        self.strain_old[:] = self.strain_new
        self.stress_old[:] = self.stress_new

    def factor(self) -> None:
        """Factorise the tangent that `keep_tangent` left; SolverFailure at a limit point."""
        try:
            self.tangent.factor()
        except SingularTangent:
            raise SolverFailure("the tangent is singular: a limit point") from None

    def equilibrium(self, u: Array, pressure: float) -> Array | None:
        """Return the displacement (n, 3) in equilibrium at `pressure`, from u; or None."""
        u = u.copy()
        flat = u.reshape(-1)
        step = start = np.empty(0)
        last = np.inf
        scale = 1.0
        backtracks = 0
        chord = False
        smallest = np.inf
        first = np.inf
        idle = 0
        jumps = self.law.jumps
        fruitless = 0
        for k in range(MOST_ITERATIONS):
            norm = self.unbalance(u, pressure, with_tangent=self.keep_tangent or not chord)
            first = norm if k == 0 else first
            if k >= WANDERING and norm > max(FAR, FARTHER * first):
                return None
            if norm < self.tolerance:
                return u
            idle = idle + (norm > 0.5 * last) if 0.5 * smallest < norm < ROUNDING_BELOW else 0
            if idle >= MOST_IDLE:
                return u
            fruitless = fruitless + 1 if jumps and norm > 0.5 * smallest else 0
            smallest = min(smallest, norm)
            worse = norm > (20.0 * last + 1e-3 if fruitless < MOST_FRUITLESS else last)
            if len(step) and worse and backtracks < MOST_BACKTRACKS:
                scale = 0.35 * scale
                backtracks = backtracks + 1
                chord = False
                flat[self.free] = start + scale * step
                continue
            if not np.isfinite(norm):
                return None
            if chord and norm > CHORD_GAIN * last:
                chord = False
                if not self.keep_tangent:
                    self.unbalance(u, pressure, with_tangent=True)
            try:
                step = -self.tangent.step(self.residual[self.free], not chord)
            except SingularTangent:
                return None
            largest = float(np.abs(step).max())
            if not np.isfinite(largest):
                return None
            start = flat[self.free].copy()
            scale = min(1.0, self.step_limit / largest) if largest > 0 else 1.0
            flat[self.free] = start + scale * step
            last = norm
            backtracks = 0
            chord = norm < CHORD_BELOW and scale == 1.0
        return None


def initial_moduli(law: HypoelasticLaw) -> tuple[float, float, float]:
    """Return E1, E2, G12 at zero strain, MPa; SolverFailure unless all are positive."""
    e1, e2, g12 = (float(modulus(0.0)) for modulus in (law.E1, law.E2, law.G12))
    if not min(e1, e2, g12) > 0:
        raise SolverFailure(
            "no equilibrium at all: E1, E2, G12 at zero strain are "
            f"{e1:.3g}, {e2:.3g}, {g12:.3g} MPa and must be positive"
        )
    return e1, e2, g12


def forgets(law: HypoelasticLaw, description: str) -> None:
    """Raise SolverFailure for a law with a memory, which `description` does not take."""
    if law.memory is not None:
        losses = "unloading, permanent set and hysteresis are lost"
        raise SolverFailure(
            f"{description} takes no law with a memory ({losses}): use the card without it"
        )


def initial_stiffness(law: HypoelasticLaw) -> Array:
    """Return the plane stress stiffness (3, 3) at zero strain, MPa; fails as `initial_moduli`."""
    initial_moduli(law)
    none = np.zeros(3)
    _, tangent = law.increment(none, none, none)
    return tangent[0]


class NoEquilibrium(SolverFailure):
    """A step from a level to the next one that was not found."""


@dataclass(frozen=True, eq=False)
class RunRequest:
    """Options of an analysis; guess : (increments or fewer, nodes, 3) to start each from."""

    parameters: Sequence[str] = ()
    guess: Array | None = None
    tell: Callable[[Progress], None] | None = None


@dataclass(frozen=True)
class Done:
    time: float


class Loading:
    """One way of loading a membrane, by a level: a pressure, an elongation, a deflection."""

    most_cuts = 6  #: how often a step between two levels is halved at most

    def equilibrium(self, start: Array, level: float) -> Array | None:
        """Return the displacement (nodes, 3) at a level, from `start`; None if not found."""
        raise NotImplementedError

    def first(self, level: float) -> Array | None:
        """Return the displacement at the first level, from the unloaded membrane."""
        raise NotImplementedError

    def ahead(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        """Return a start for the next level after the path so far."""
        raise NotImplementedError

    def onward(self, u: Array, at: float, to: float, previous: Array | None) -> Array:
        """Return a start inside a halved step, straight on from u; previous : as far back."""
        return u if previous is None else np.asarray(2.0 * u - previous)

    def guessed(self, guess: Array) -> Array:
        return guess

    def reached(
        self, lower: float, u: Array, level: float, start: Array, cuts: int
    ) -> Array | None:
        """Return the equilibrium at `level` from `start`, else in steps from u, at `lower`."""
        displacement = self.equilibrium(start, level)
        return displacement if displacement is not None else halved(self, lower, u, level, cuts)

    def problem(self, previous: float, level: float, place: str) -> str:
        """Return the message where `level` cannot be reached; place : "increment 3 of 7"."""
        raise NotImplementedError


def march(
    loading: Loading,
    levels: Sequence[float] | Array,
    request: RunRequest,
    origin: tuple[float, Array] | None = None,
    finished: int = 0,
) -> Iterator[Array]:
    """Yield the displacement (nodes, 3) at each level; the caller accepts it before the next one.

    origin : level and displacement to start from, else unloaded. finished : earlier increments
    of the model.
    """
    passed, path = ([origin[0]], [origin[1]]) if origin is not None else ([], [])
    for i, level in enumerate(float(value) for value in levels):
        displacement = None
        if request.guess is not None and i < len(request.guess):
            start = loading.guessed(request.guess[i])
            if path and i:  # what a guess lacks is much the same at neighbouring levels
                start = start + path[-1] - loading.guessed(request.guess[i - 1])
            displacement = loading.equilibrium(start, level)
        if displacement is None and request.guess is not None and not path:
            displacement = _from_guess(loading, levels, request.guess)
        if displacement is None and path:
            start = loading.ahead(passed, path, level)
            displacement = loading.reached(passed[-1], path[-1], level, start, loading.most_cuts)
        elif displacement is None:
            displacement = loading.first(level)
        if displacement is None:
            place = f"increment {i + 1} of {len(levels)}"
            raise NoEquilibrium(loading.problem(passed[-1] if passed else 0.0, level, place))
        yield displacement
        passed.append(level)
        path.append(displacement)
        if request.tell is not None:
            request.tell(Done(finished + i + 1))


def _from_guess(loading: Loading, levels: Sequence[float] | Array, guess: Array) -> Array | None:
    """Return the first equilibrium, back from the first level whose guess leads to one."""
    for level, start in list(zip(levels, guess, strict=False))[1:]:
        higher = loading.equilibrium(loading.guessed(start), level)
        if higher is not None:
            begin = loading.onward(higher, level, levels[0], None)
            return loading.reached(level, higher, levels[0], begin, loading.most_cuts)
    return None


def halved(loading: Loading, lower: float, u: Array, level: float, cuts: int) -> Array | None:
    """Return the equilibrium at `level` in two steps from `lower`, each perhaps halved again."""
    if cuts == 0:
        return None
    middle = 0.5 * (lower + level)
    start = loading.onward(u, lower, middle, None)
    halfway = Loading.reached(loading, lower, u, middle, start, cuts - 1)
    if halfway is None:
        return None
    start = loading.onward(halfway, middle, level, u)
    return Loading.reached(loading, middle, halfway, level, start, cuts - 1)


def last_way(levels: Sequence[float], level: float, limit: int) -> int:
    """Return how many of the last levels lie one after the other on the way to the next one."""
    steps = np.sign(np.diff([*levels, level]))[::-1]
    reversals = np.flatnonzero(steps != steps[0])
    return min(limit, int(reversals[0]) if len(reversals) else len(steps))


def straight_on(levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
    """Return the point on the line through the last two of the path; else its last one."""
    if len(path) < 2:
        return path[-1]
    ahead = (level - levels[-1]) / (levels[-1] - levels[-2])
    return np.asarray(path[-1] + ahead * (path[-1] - path[-2]))


def lagrange(x: Array, values: Array, at: float) -> Array:
    """Return the polynomial through `values` (k, nodes, 3) at x (k,), at another place."""
    shares = [
        math.prod((at - x[b]) / (x[a] - x[b]) for b in range(len(x)) if b != a)
        for a in range(len(x))
    ]
    return np.asarray(np.einsum("a,ank->nk", shares, values))


class Record:
    """Record of increments: path (increments, nodes, 3) mm, forces N, extremes of strain (3,)."""

    def __init__(self, membrane: Membrane, count: int) -> None:
        self.membrane = membrane
        self.path, self.forces = (np.zeros((count, *membrane.reference.shape)) for _ in range(2))
        self.low = np.zeros(3)
        self.high = np.zeros(3)

    def accept(self, i: int, u: Array) -> None:
        self.membrane.accept()
        self.path[i] = u
        self.forces[i] = self.membrane.residual.reshape(u.shape)
        strain = self.membrane.strain_old[..., :3]
        np.minimum(self.low, strain.min(axis=(0, 1)), out=self.low)
        np.maximum(self.high, strain.max(axis=(0, 1)), out=self.high)


# Newton's iteration with a line search, for contact and wrinkles: their stiffness jumps.
#
# A full step from a tangent without a node's contact lands far inside a body. The residual's work
# along the step changes its sign where the energy is least (Matthies and Strang, Int. J. Numer.
# Methods Eng. 14 (1979) 1613); gas, contact and an increment of the law are nearly conservative.


def searched_equilibrium(membrane: Membrane, u: Array, pressure: float) -> Array | None:
    u = u.copy()
    norm = membrane.unbalance(u, pressure, with_tangent=True)
    smallest = np.inf
    idle = 0
    for _ in range(MOST_STEPS):
        if norm < membrane.tolerance:
            return u
        idle = idle + 1 if 0.5 * smallest < norm < ROUNDING_BELOW else 0
        if idle >= MOST_IDLE:
            return u
        smallest = min(smallest, norm)
        if not np.isfinite(norm):
            return None
        try:
            membrane.tangent.factor()
        except SingularTangent:
            return None
        step = -membrane.tangent.solve(membrane.residual[membrane.free])
        if not np.isfinite(step).all():
            return None
        norm = _along(membrane, u, pressure, step, norm)
    return u if norm < membrane.tolerance else None


def _along(membrane: Membrane, u: Array, pressure: float, step: Array, norm: float) -> float:
    """Move u along the step as far as is good; return the residual there, with its tangent."""
    flat = u.reshape(-1)
    free = membrane.free
    start = flat[free].copy()
    slope = float(step @ membrane.residual[free])
    largest = float(np.abs(step).max())
    part = min(1.0, membrane.step_limit / largest) if largest > 0 else 1.0
    low = 0.0
    slope_low = slope
    high = math.inf
    slope_high = math.nan
    for trial in range(MOST_TRIALS):
        flat[free] = start + part * step
        # Most steps are taken as they are, so that the first comes with its tangent.
        norm_there = membrane.unbalance(u, pressure, with_tangent=trial == 0)
        slope_there = float(step @ membrane.residual[free]) if np.isfinite(norm_there) else math.nan
        if norm_there < GAIN * norm or norm < SMALL or abs(slope_there) <= LEFT * abs(slope):
            break
        if slope_there * slope > 0 and abs(slope_there) <= abs(slope):
            if high == math.inf:
                break
            low = part
            slope_low = slope_there
        else:
            high = part
            slope_high = slope_there if slope_there * slope < 0 else math.nan
        share = slope_low / (slope_low - slope_high)
        share = BLIND if math.isnan(share) else min(FARTHEST, max(NEAREST, share))
        part = low + share * (high - low)
    if trial > 0:
        norm_there = membrane.unbalance(u, pressure, with_tangent=True)
    return norm_there


def named(levels: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Return loads (n,) in words, by number and unit."""
    return tuple(f"{level:.4g} {unit}" for level in levels.tolist())


class Derivatives:
    """Derivatives of displacement, strain and stress, carried along the strain path.

    parameters : "beta_i", "nu12", "pressure_offset", "thickness", and those of `sheet`: slopes of
    the sheet's own parameters, at: stress_free (n, 3) mm, places of the nodes without stress, yarn
    (3,), the warp, and stretch (elements, 4, 2, 2).
    """

    def __init__(
        self,
        membrane: Membrane,
        parameters: Sequence[str],
        sheet: SheetSlopes | None = None,
        at: tuple[Array, Array, Array] | None = None,
    ) -> None:
        self.membrane = membrane
        law = membrane.law
        names = list(parameters)
        shape = (len(membrane.quads), 4, 3, len(names))
        remembered = law.state - 3
        self.rows, self.by_coupling = law_slopes(law, names, float(np.mean(membrane.thickness)))
        self.push = names.index("pressure_offset") if "pressure_offset" in names else -1
        self.stress = np.zeros(shape)
        self.fresh = np.empty(shape)
        self.strain = np.zeros((*shape[:2], law.state, len(names)))
        self.point = np.empty((len(membrane.quads), 4, POINT + remembered))
        self.rate = np.empty((membrane.reference.size, len(names)))
        self.columns: list[int] = []
        if sheet and at is not None:
            self.columns = [names.index(name) for name in sheet]
            surface, ways, turns, by = (
                np.stack(columns) for columns in zip(*sheet.values(), strict=True)
            )
            stress_free, yarn, stretch = at
            self.surface, self.ways = (
                np.ascontiguousarray(np.moveaxis(columns, 0, -1)) for columns in (surface, ways)
            )
            self.slopes, self.area = element_slopes(
                stress_free, membrane.quads, ways, yarn, turns, stretch, by
            )
            self.green = np.empty((*shape[:3], len(sheet)))
            self.sheet_rate = np.empty((membrane.reference.size, len(sheet)))

    def at_fixed_displacement(self, u: Array, pressure: float = 0.0) -> Array:
        """Return the explicit derivative of the residual at the equilibrium u, (3 n, np)."""
        m = self.membrane
        e = self.membrane.elements
        law = self.membrane.law
        explicit(
            m.reference + u,
            m.quads,
            e.values,
            e.slopes,
            e.area,
            m.section,
            law.pieces,
            law.coupling,
            law.area_power,
            m.strain_old,
            m.stress_old,
            self.rows,
            self.by_coupling,
            self.push,
            self.strain,
            self.stress,
            self.fresh,
            self.point,
            self.rate,
        )
        if self.columns:
            by_sheet(
                m.reference + u,
                m.quads,
                e.values,
                e.slopes,
                e.area,
                m.section,
                pressure,
                law.pieces,
                law.coupling,
                law.area_power,
                m.strain_old,
                m.stress_old,
                self.surface,
                self.slopes,
                self.area,
                self.green,
                self.sheet_rate,
            )
            self.rate[:, self.columns] += self.sheet_rate
            if m.cords is not None:
                self.rate[:, self.columns] += m.cords.slopes(
                    m.reference + u, self.surface, self.ways
                )
        return self.rate

    def advance(self, du: Array) -> None:
        """Take strain and stress derivatives to the end of the increment, du (3 n, np)."""
        m = self.membrane
        self.stress, self.fresh = self.fresh, self.stress
        advance(m.quads, m.elements.slopes, self.point, du, self.strain, self.stress)
        if self.columns:
            to_strain, to_stress = (
                self.point[..., first : first + 9].reshape(*self.point.shape[:2], 3, 3)
                for first in (6, 15)
            )
            strain = to_strain @ self.green
            self.strain[..., :3, self.columns] += strain
            for first in range(3, self.strain.shape[2], 3):
                factor = self.point[..., POINT + first - 3 : POINT + first, None]
                self.strain[..., first : first + 3, self.columns] += factor * strain
            self.stress[..., self.columns] += to_stress @ strain

    def increment(self, u: Array, pressure: float = 0.0) -> Array:
        """Return d u / d parameters (3 n, np) at the equilibrium u, before it is accepted."""
        m = self.membrane
        rate = self.at_fixed_displacement(u, pressure)
        du = np.zeros_like(rate)
        du[m.free] = -m.tangent.solve(rate[m.free])
        self.advance(du)
        return du
