"""Analysis of a strip in a tensile test, by increments of the elongation of its gauge length.

Only increments between which the load curve is not a cubic are solved; the others are read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ...materials.cubic_curves import hermite_weights, spline_slopes
from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import UniaxialModel
from ..base import History
from .factorisation import AroundTangent, SingularTangent, tangent_for
from .kernel import reference_elements
from .loading import (
    IncrementRecord,
    Loading,
    RunRequest,
    equilibrium_at,
    lagrange,
    load_labels,
    monotonic_count,
)
from .membrane import Array, Membrane, arrays_of, initial_moduli
from .sensitivity import Derivatives
from .wall import Wall


@dataclass(frozen=True)
class GaugeIteration:
    """Settings of the iteration on the displacements and the pull, the motion of the driven end."""

    max_corrections: int = 12
    may_grow_below: float = 1e-3  #: below this relative residual a step may increase it
    tolerance: float = 1e-10  #: largest error of the gauge's elongation over the gauge length
    largest_strain: float = 0.025  #: of a step's path, whose loads are then within 2e-5


class DrivenTangent(AroundTangent):
    """The tangent of the free unknowns, together with the rows and columns of driven unknowns.

    Driven unknowns are those of the end that is pulled. The entries of both are in one array
    `data`, which the assembly writes.
    """

    def __init__(
        self,
        quads: NDArray[np.intp],
        points: Array,
        free: NDArray[np.intp],
        driven: NDArray[np.intp],
    ) -> None:
        super().__init__(tangent_for(quads, points, free))
        size = points.size
        dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
        rows = np.repeat(dofs, 12, axis=1)
        columns = np.tile(dofs, (1, 12))
        is_driven = np.isin(rows, driven) | np.isin(columns, driven)
        inner_size = self.inner.data.size
        count = int(is_driven.sum())
        self.data = np.zeros(inner_size + count)
        self.slot = self.slot.copy()
        self.slot[is_driven] = inner_size + np.arange(count)
        self.inner.data = self.data[:inner_size]
        # By rows; entries of one place are not summed, which a product does not need.
        self._by_row = np.argsort(rows[is_driven], kind="stable")
        starts = np.searchsorted(rows[is_driven][self._by_row], np.arange(size + 1))
        csr_parts = np.zeros(count), columns[is_driven][self._by_row], starts
        self._tail = self.data[inner_size:]
        self._edge = scipy.sparse.csr_matrix(csr_parts, shape=(size, size))

    def edge(self) -> scipy.sparse.csr_matrix:
        """Return the matrix (size, size) of the driven rows and columns as last assembled.

        All its other entries are zero.
        """
        self._edge.data[:] = self._tail[self._by_row]
        return self._edge


def prepare(
    model: UniaxialModel,
    law: HypoelasticLaw,
    tolerance: float,
    wall: Wall,
) -> Membrane:
    """Return the strip's membrane."""
    points, quads = arrays_of(model.mesh)
    fixed = np.concatenate([model.fixed, model.driven])
    free = np.setdiff1d(np.arange(points.size), fixed)
    warp = np.broadcast_to(model.warp, (len(quads), 3))
    return Membrane(
        points,
        quads,
        reference_elements(points, quads, warp),
        model.thickness,
        law,
        free,
        DrivenTangent(quads, points, free, model.driven),
        tolerance,
        step_limit=0.1 * float(np.ptp(points, axis=0).max()),
    )


def analyse(membrane: Membrane, model: UniaxialModel, request: RunRequest) -> tuple[History, Array]:
    """Pull a strip from its unloaded state; return the history, and derivatives in all increments.

    Of increments that only load the strip, those are solved that `SolvedIncrements` chooses; the
    others are read between them.

    The derivatives (increments, nodes, 3, parameters) are found by direct differentiation at a
    fixed elongation of the gauge. With a parameter, the displacement changes by a at a fixed pull;
    it changes by w for one mm of pull. The pull changes so that the length of the gauge, whose
    derivative by the displacements is g, stays: du = a - w (g a)/(g w). The derivative of the load
    is that of the residual at the driven unknowns. An increment is called stable if the sheet is
    stable between fixed grips, since a testing machine prescribes their distance and not the load.
    """
    parameters = request.parameters
    initial_moduli(membrane.law)
    tangent = membrane.tangent
    assert isinstance(tangent, DrivenTangent)
    direction = np.zeros(membrane.reference.size)
    direction[model.driven] = -1.0
    pull = Pulling(membrane, tangent, direction, model.mesh.node_sets["gauge"])
    levels = np.array(model.elongations)
    shape = membrane.reference.shape
    free = membrane.free
    rates = list[Array]()
    path_slopes = list[Array]()
    load_slopes = list[Array]()
    derivatives = Derivatives(membrane, parameters) if parameters else None
    record = IncrementRecord(membrane, len(levels))
    membrane.keep_tangent = True
    steps = math.ceil(levels[-1] / pull.gauge_length / pull.settings.largest_strain)
    smallest_count = len(levels) if model.unloaded else max(6, steps)
    increments = SolvedIncrements(levels, smallest_count)
    for i, u in enumerate(pull.solve(increments, request)):
        rates.append(pull.rate.reshape(shape))
        if derivatives is not None:
            rate = derivatives.at_fixed_displacement(u)
            du = np.zeros_like(rate)
            du[free] = -tangent.solve(rate[free])
            du -= np.outer(pull.rate, pull.opening(u, du))
            load_slopes.append(direction @ (rate + tangent.edge() @ du))
            derivatives.advance(du)
            path_slopes.append(du.reshape(*shape, -1))
        record.accept(i, u)
    count = len(increments.solved)
    path = increments.read(record.path[:count], np.array(rates))
    forces = record.forces[:count]
    load = increments.read(forces.reshape(count, -1) @ direction, np.array(pull.force_rates))
    path_slope = load_slope = None
    if parameters:
        path_slope = increments.read(np.array(path_slopes))
        load_slope = model.load_factor * increments.read(np.array(load_slopes))
    sets = model.mesh.node_sets
    history = History(
        model.load_factor * load,
        path,
        record.low,
        record.high,
        {
            name: increments.read(forces[:, sets[name]].sum(axis=1))
            for name in (*model.supports, model.pulled)
        },
        iterations=membrane.iterations,
        path=path,
        path_slope=path_slope,
        load_slope=load_slope,
        unstable=load_labels(levels[increments.unstable], "mm of elongation"),
    )
    return history, np.zeros((*path.shape, 0)) if path_slope is None else path_slope


@dataclass(eq=False)
class Pulling(Loading):
    """Loading of a strip by an elongation (mm) of its gauge length.

    The driven unknowns move together by one amount, the pull, which is found so that the gauge has
    the wanted elongation.

    Attributes
    ----------
    direction : array
        Displacement (3 n,) for one mm of pull, zero at unknowns that are not driven.
    gauge : array
        Its lower and its upper node.
    """

    look_back = 4  #: number of increments from which the start of the next one is extrapolated

    membrane: Membrane
    tangent: DrivenTangent
    direction: Array
    gauge: NDArray[np.intp]
    settings: GaugeIteration = GaugeIteration()

    def __post_init__(self) -> None:
        lower, upper = self.membrane.reference[self.gauge]
        self.gauge_length = float(np.linalg.norm(upper - lower))
        self.driven = np.flatnonzero(self.direction)
        self.rate = np.zeros_like(self.direction)
        self.force_rates = list[float]()

    def solve(self, increments: SolvedIncrements, request: RunRequest) -> Iterator[Array]:
        """Yield the displacement (n, 3) mm at each solved increment; the caller accepts it.

        `rate` is its derivative (3 n,) by the elongation, `force_rates` those of the driving force.
        """
        passed = list[float]()
        path = list[Array]()
        levels = increments.levels
        while not increments.are_complete:
            i = increments.current
            u = equilibrium_at(self, levels, i, increments.previous, request, (passed, path))
            self.membrane.factor()
            w = self.response()
            self.rate = w / self.opening(u, w)
            force = float(self.membrane.residual @ self.direction)
            force_rate = float(self.direction @ (self.tangent.edge() @ self.rate))
            if increments.accept(force, force_rate, self.tangent.definite()):
                yield u
                passed.append(float(levels[i]))
                path.append(u)
                self.force_rates.append(force_rate)
                request.report(i + 1)

    def elongation(self, u: Array) -> float:
        """Return the elongation of the gauge (mm) at the displacement u (n, 3) mm."""
        return math.dist(*(self.membrane.reference[self.gauge] + u[self.gauge])) - self.gauge_length

    def opening(self, u: Array, moves: Array) -> Array:
        """Return the derivatives (...) of the gauge's elongation along displacements (3 n, ...)."""
        lower, upper = self.membrane.reference[self.gauge] + u[self.gauge]
        lower_moves, upper_moves = moves.reshape(*u.shape, *moves.shape[1:])[self.gauge]
        axis = (upper - lower) / math.dist(lower, upper)
        return np.asarray(axis @ (upper_moves - lower_moves))

    def response(self) -> Array:
        """Return the displacement (3 n,) for one mm of pull, by the tangent as last factorised."""
        free = self.membrane.free
        w = self.direction.copy()
        w[free] = -self.tangent.solve((self.tangent.edge() @ self.direction)[free])
        return w

    def equilibrium(self, start: Array, level: float) -> Array | None:
        """Return the equilibrium (n, 3) mm at an elongation of the gauge, or None.

        Newton's iteration is tried on displacements and pull together; where that fails, the
        displacements are found for one pull after the other.

        Parameters
        ----------
        start : (n, 3) array, mm
            Displacement where the iteration starts.
        level : float, mm
            Elongation of the gauge.
        """
        displacement = self._together(start, level)
        return self._in_turn(start, level) if displacement is None else displacement

    def _together(self, start: Array, level: float) -> Array | None:
        """Return the equilibrium (n, 3) mm by iterating displacements and pull together, or None.

        Parameters
        ----------
        start : (n, 3) array, mm
            Where the iteration starts.
        level : float, mm
            Elongation of the gauge.
        """
        m = self.membrane
        u = start.copy()
        free = self.membrane.free
        last = np.inf
        for _ in range(self.settings.max_corrections):
            norm = m.unbalance(u, 0.0, with_tangent=True)
            elongation = self.elongation(u)
            if (
                norm < m.tolerance
                and abs(level - elongation) <= self.settings.tolerance * self.gauge_length
            ):
                return u
            if not norm < max(last, self.settings.may_grow_below):
                return None
            last = norm
            try:
                self.tangent.factor()
            except SingularTangent:
                return None
            loads = np.column_stack([m.residual, self.tangent.edge() @ self.direction])
            moves = np.column_stack([np.zeros_like(self.direction), self.direction])
            moves[free] = -self.tangent.solve(loads[free])
            gained, opens = self.opening(u, moves)
            if not opens > 0:
                return None
            step = moves @ np.array([1.0, (level - elongation - gained) / opens])
            if not np.abs(step).max() <= m.step_limit:
                return None
            u += step.reshape(u.shape)
        return None

    def _in_turn(self, start: Array, level: float) -> Array | None:
        """Return the equilibrium (n, 3) mm, found for one pull after the other, or None.

        Parameters
        ----------
        start : (n, 3) array, mm
            Where the search starts.
        level : float, mm
            Elongation of the gauge.
        """
        m = self.membrane
        u = start
        for _ in range(self.settings.max_corrections):
            displacement = m.equilibrium(u, 0.0)
            if displacement is None:
                return None
            gap = level - self.elongation(displacement)
            if abs(gap) <= self.settings.tolerance * self.gauge_length:
                return displacement
            m.factor()
            w = self.response()
            opens = float(self.opening(displacement, w))
            move = gap / opens if opens > 0 else np.inf
            if abs(move) * np.abs(w).max() > m.step_limit:
                return None
            u = displacement + move * w.reshape(u.shape)
        return None

    def first_equilibrium(self, level: float) -> Array | None:
        none = np.zeros_like(self.membrane.reference)
        return self.reach(0.0, none, level, self._stretched(level), self.max_halvings)

    def extrapolate(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        """Extrapolate by a polynomial in the elongation, through the last increments and zero."""
        count = monotonic_count([0.0, *levels], level, self.look_back)
        x = np.array([0.0, *levels][-count:])
        values = np.array([np.zeros_like(path[0]), *path][-count:])
        return lagrange(x, values, level)

    def start_within_step(
        self,
        u: Array,
        level: float,
        target: float,
        previous: Array | None,
    ) -> Array:
        return u * (target / level) if level > 0 else self._stretched(target)

    def failure_message(self, previous: float, level: float, increment: str) -> str:
        where = f"no equilibrium at {level:.4g} mm of gauge elongation ({increment})"
        return f"{where}; more increments, or moduli nearer to the data, usually help"

    def admissible(self, guess: Array) -> Array:
        """Return a guess (n, 3) with held unknowns at zero and driven ones at their mean value."""
        flat = np.asarray(guess, dtype=float).reshape(-1)
        displacement = np.zeros_like(flat)
        displacement[self.membrane.free] = flat[self.membrane.free]
        displacement[self.driven] = float(flat[self.driven].mean())
        return displacement.reshape(guess.shape)

    def _stretched(self, elongation: float) -> Array:
        """Return the displacement (n, 3) mm of an even stretch by an elongation (mm)."""
        reference = self.membrane.reference
        u = np.zeros_like(reference)
        share = elongation / self.gauge_length
        u[:, 1] = share * (reference[:, 1] - reference[:, 1].max())
        return self.admissible(u)


@dataclass(frozen=True)
class ReadingError:
    """Settings of the estimate of the error of a reading, and of the steps that follow from it."""

    #: Largest value, over a step, of a cubic that is zero at its ends with slopes 0 and 1 there.
    cubic_bound: float = 4 / 27
    #: A response is smooth where its fourth derivative grows by less than this factor in a step,
    max_growth: float = 6.0
    #: and the error of its reading, h^4/384 times this derivative, is multiplied by this.
    safety: float = 4.0
    largest_factor: float = 4.0  #: of one step to the next
    margin: float = 0.9  #: of the step at which the error would be the largest allowed


class SolvedIncrements:
    """Increments that are solved, chosen by the curvature of the response as it is computed.

    A step spans several increments where the response differs little from the cubic that is read
    between its ends, from values and slopes there. How much it differs follows from the cubic of
    the step before. The first three increments have no step between.

    Parameters
    ----------
    levels : (n,) array
        Increasing load levels of all increments.
    smallest_count : int
        Of increments that are solved: in how many steps the law has to follow the path of strain.
    error : float
        Of a response that is read, as a share of the largest so far.
    """

    def __init__(self, levels: Array, smallest_count: int = 10, error: float = 1e-4) -> None:
        self.levels = levels
        self.allowed_error = error
        self.longest_step = max(1, len(levels) // smallest_count)
        self.step = 1
        self.solved: list[int] = []
        self._responses = list[float]()
        self._slopes = list[float]()
        self._is_stable = list[bool]()
        self._fourth_derivative = 0.0
        self.settings = ReadingError()

    @property
    def previous(self) -> int:
        """Return the index of the last solved increment, -1 for none."""
        return self.solved[-1] if self.solved else -1

    @property
    def current(self) -> int:
        """Return the index of the increment to solve."""
        return min(self.previous + self.step, len(self.levels) - 1)

    @property
    def are_complete(self) -> bool:
        """Return whether the last increment is solved."""
        return self.previous == len(self.levels) - 1

    @property
    def unstable(self) -> NDArray[np.intp]:
        """Return the indices of unstable increments, as stability does not change within a step."""
        step_ends = np.searchsorted(self.solved, np.arange(len(self.levels)))
        return np.flatnonzero(~np.array(self._is_stable)[step_ends])

    def accept(self, response: float, slope: float, is_stable: bool = True) -> bool:
        """Accept the current increment by its response; return whether it ends a step.

        If not, the step is too long, and a nearer increment becomes the current one.

        Parameters
        ----------
        response, slope : float
            The response, such as a load, and its derivative by the level.
        is_stable : bool
            Whether the equilibrium is stable; a step ends where that changes.
        """
        i = self.current
        span = i - self.previous
        fourth_derivative, error = self._reading_error(i, response, slope)
        is_change = bool(self.solved) and is_stable != self._is_stable[-1]
        if (error > 1.0 or is_change) and span > 1:
            self.step = span // 2
            return False
        self.solved.append(i)
        self._responses.append(response)
        self._slopes.append(slope)
        self._is_stable.append(is_stable)
        if len(self.solved) > 2:
            self._fourth_derivative = fourth_derivative
            # The error grows with the fourth power of the step.
            factor = self.settings.margin * max(error, 1e-9) ** -0.25
            step = int(min(factor, self.settings.largest_factor) * span)
            self.step = max(1, min(step, self.longest_step))
        return True

    def _reading_error(self, i: int, response: float, slope: float) -> tuple[float, float]:
        """Return the fourth derivative up to i, and the error of a reading over that allowed."""
        if len(self.solved) < 2 or self.longest_step == 1:
            return 0.0, 0.0
        settings = self.settings
        begin, end = self.levels[self.solved[-2:]].tolist()
        values, slopes = self._responses[-2:], self._slopes[-2:]
        last_step = end - begin
        step = float(self.levels[i]) - end
        # The cubic of the last step goes on by powers of the distance from its end.
        secant = (values[1] - values[0]) / last_step
        second = (slopes[0] + 2.0 * slopes[1] - 3.0 * secant) / last_step
        third = (slopes[0] + slopes[1] - 2.0 * secant) / last_step**2
        cubic = values[1] + step * (slopes[1] + step * (second + step * third))
        cubic_slope = slopes[1] + step * (2.0 * second + step * 3.0 * third)
        deviation = abs(response - cubic)
        slope_deviation = abs(slope - cubic_slope)
        both = last_step + step
        # A cubic through values and slopes at a and b deviates at x by a 24th of the fourth
        # derivative times (x - a)^2 (x - b)^2.
        fourth_derivative = max(
            24 * deviation / (step * both) ** 2,
            12 * slope_deviation / (step * both * (both + step)),
        )
        error = settings.cubic_bound * step * slope_deviation
        if fourth_derivative < settings.max_growth * self._fourth_derivative:
            error = min(error, settings.safety * fourth_derivative * step**4 / 384)
        largest = max(map(abs, [*self._responses, response]))
        return fourth_derivative, error / (self.allowed_error * largest)

    def read(self, values: Array, slopes: Array | None = None) -> Array:
        """Return values at all increments (n, ...) from those at solved ones.

        Parameters
        ----------
        values : (solved, ...) array
        slopes : (solved, ...) array, optional
            Derivatives by the level; those of a cubic spline unless given.
        """
        if len(values) == len(self.levels):
            return values
        if slopes is None:
            reading = np.tensordot(self._spline_weights, values, 1)
        else:
            by_value, by_slope = self._weights
            reading = np.tensordot(by_value, values, 1) + np.tensordot(by_slope, slopes, 1)
        reading[self.solved] = values
        return reading

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        return hermite_weights(self.levels[self.solved], self.levels)

    @cached_property
    def _spline_weights(self) -> Array:
        by_value, by_slope = self._weights
        return by_value + by_slope @ spline_slopes(self.levels[self.solved])
