"""Analysis of a bubble test: a sheet held at its rim and inflated, increment by increment.

A soft sheet, or one that thins, has a largest pressure (a limit point), beyond which it rises while
the pressure falls. There the rise of a node is prescribed, and the pressure is an unknown.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import PRESSURE_OFFSET, THICKNESS, BubbleModel, MeasuredShape
from ...meshes.disk import rim_form, rim_share
from ..base import History
from ..pretension import stretched
from .cords import cords_on_sheet
from .factorisation import SingularTangent, Tangent, tangent_for
from .kernel import reference_elements
from .loading import (
    IncrementRecord,
    Loading,
    NoEquilibrium,
    RunRequest,
    lagrange,
    load_labels,
    march,
    monotonic_count,
)
from .membrane import Array, Membrane, arrays_of, initial_moduli
from .sensitivity import Derivatives
from .wall import TENSION_FIELD, Wall


def prepare(
    model: BubbleModel,
    law: HypoelasticLaw,
    tolerance: float,
    wall: Wall,
) -> Membrane:
    """Return the membrane of a bubble; it has no use for `wall`."""
    points, quads = arrays_of(model.mesh)
    free = np.setdiff1d(np.arange(points.size), model.fixed)
    return _membrane_of(model, law, free, tangent_for(quads, points, free), tolerance)


def with_sheet(membrane: Membrane, model: BubbleModel) -> Membrane:
    """Return the membrane of a model that differs from its own in the sheet, not in the quads.

    The storage of its tangent, which has a quarter of the work of `prepare`, is used further.
    """
    tangent = membrane.tangent
    return _membrane_of(model, membrane.law, membrane.free, tangent, membrane.tolerance)


def _membrane_of(
    model: BubbleModel,
    law: HypoelasticLaw,
    free: NDArray[np.intp],
    tangent: Tangent,
    tolerance: float,
) -> Membrane:
    """Return the membrane of a bubble with the storage `tangent` for its unknowns `free`."""
    points, quads = arrays_of(model.mesh)
    return Membrane(
        points,
        quads,
        reference_elements(model.stress_free, quads, model.mesh.warp, model.stretch),
        model.thickness,
        law,
        free,
        tangent,
        tolerance,
        step_limit=0.1 * float(np.ptp(points, axis=0).max()),
        cords=cords_on_sheet(model),
    )


def analyse(membrane: Membrane, model: BubbleModel, request: RunRequest) -> tuple[History, Array]:
    """Inflate a sheet from its unloaded state.

    Returns the history, and the derivatives (frames, nodes, 3, parameters) of the displacements in
    its frames.
    """
    levels = np.array(model.increments)
    shape = membrane.reference.shape
    derivatives = _derivatives(membrane, model, request) if request.parameters else None
    rates = np.zeros((len(levels), *shape, len(request.parameters)))
    record = IncrementRecord(membrane, len(levels))
    keep = model.reported
    judged = set(keep.tolist())
    unstable = []
    membrane.keep_tangent = derivatives is not None or 0 in judged
    for i, u in enumerate(_inflate(membrane, model, request)):
        if i in judged and not membrane.tangent.definite():
            unstable.append(i)
        if derivatives is not None:
            membrane.factor()
            rates[i] = derivatives.increment(u, levels[i]).reshape(*shape, -1)
        record.accept(i, u)
        membrane.keep_tangent = derivatives is not None or i + 1 in judged
    forces = record.forces[keep]
    sets = model.mesh.node_sets
    reactions = {n: forces[:, sets[n]].sum(axis=1) for n in model.supports if n in sets}
    history = History(
        levels[keep],
        record.path[keep],
        record.low,
        record.high,
        reactions,
        iterations=membrane.iterations,
        path=record.path,
        path_slope=rates if request.parameters else None,
        unstable=load_labels(1e3 * levels[unstable], "kPa"),
    )
    return history, rates[keep]


def _inflate(membrane: Membrane, model: BubbleModel, request: RunRequest) -> Iterator[Array]:
    """Yield as `march`; where it fails without derivatives, say where the pressure is largest."""
    levels = model.increments
    path: list[Inflated] = []
    try:
        for i, u in enumerate(march(Inflation(membrane, model), levels, request)):
            path.append(Inflated(u, levels[i]))
            yield u
    except NoEquilibrium as failure:
        limit = limit_point(membrane, path[-1]) if path and not request.parameters else None
        if limit is None:
            raise
        where, _, _ = failure.reason.partition(";")
        raise NoEquilibrium(
            f"{where}: the pressure has its maximum, {limit.pressure * 1e3:.4g} kPa, at a height "
            f"of {limit.height:.4g} mm, and falls beyond (`inflate_to_heights` goes on)"
        ) from None


def inflate_to_heights(
    model: BubbleModel, law: HypoelasticLaw, heights: ArrayLike, tolerance: float = 1e-8
) -> tuple[Array, Array]:
    """Inflate a sheet to apex heights, also beyond a maximum of the pressure.

    Parameters
    ----------
    model : BubbleModel
        Its first increment is the pressure from which heights are prescribed.
    law : HypoelasticLaw
    heights : (n,) array_like, mm
        Rising, above that at the first increment; each ends an increment of the law.
    tolerance : float
        As of `MembraneSolver`.

    Returns
    -------
    pressure : (n,) ndarray, MPa
    displacement : (n, nodes, 3) ndarray, mm

    Raises
    ------
    SolverFailure
        No equilibrium has a height.
    """
    model = stretched(model, law)
    membrane = prepare(model, law, tolerance, TENSION_FIELD)
    level = float(model.increments[0])
    state = Inflated(Inflation(membrane, model).first_equilibrium(level), level)
    states = []
    for height in np.asarray(heights, dtype=float):
        following = at_height(membrane, state, float(height))
        if following is None:
            raise SolverFailure(f"no equilibrium of {height:.4g} mm height; smaller steps may help")
        membrane.accept()
        state = following
        states.append(state)
    pressures = np.array([state.pressure for state in states])
    return pressures, np.array([state.displacement for state in states])


def _derivatives(membrane: Membrane, model: BubbleModel, request: RunRequest) -> Derivatives:
    """Return the derivatives by the requested parameters, at the sheet without stress."""
    of_sheet = {*model.parameters} - {PRESSURE_OFFSET, THICKNESS}
    slopes = {n: model.sheet_slope(n) for n in request.parameters if n in of_sheet}
    at = (model.stress_free, model.yarn, model.stretch)
    return Derivatives(membrane, request.parameters, slopes, at)


def balance(membrane: Membrane, model: MeasuredShape, request: RunRequest) -> tuple[History, Array]:
    """Return the displacement from a measured shape to equilibrium, to first order.

    In each frame it is the step of Newton's method from the measured shape in the space of the
    model's virtual fields: the combination of these fields after which their virtual work
    vanishes. The history has it as its displacement; its derivatives by the parameters,
    (frames, nodes, 3, parameters), follow. SolverFailure if a frame has no valid stress, or a
    singular stiffness.
    """
    derivatives = _derivatives(membrane, model, request)
    still = np.zeros((membrane.reference.size, len(request.parameters)))
    record = IncrementRecord(membrane, len(model.displacements))
    inner = model.fields[membrane.free]
    steps = np.zeros((*model.displacements.shape, 1 + len(request.parameters)))
    for i, (u, pressure) in enumerate(zip(model.displacements, model.pressures, strict=True)):
        if not np.isfinite(membrane.unbalance(u, pressure, with_tangent=True)):
            raise SolverFailure(f"no valid stress in the shape at {pressure * 1e3:.4g} kPa")
        slopes = derivatives.at_fixed_displacement(u, pressure)
        work = model.fields.T @ np.column_stack([membrane.residual, slopes])
        try:
            step = np.linalg.solve(inner.T @ membrane.tangent.times(inner), -work)
        except np.linalg.LinAlgError:
            raise SolverFailure(f"no stiffness at {pressure * 1e3:.4g} kPa") from None
        steps[i] = (model.fields @ step).reshape(steps[i].shape)
        derivatives.advance(still)
        record.accept(i, u)
    load = np.array(model.pressures)
    return History(load, steps[..., 0], record.low, record.high), steps[..., 1:]


@dataclass(eq=False)
class Inflation(Loading):
    """Loading of a flat or nearly flat sheet by a pressure (MPa), with the model's rim motion."""

    look_back = 4  #: number of increments from which the start of the next one is extrapolated
    #: Heights of the dome from which the first increment starts, as multiples of the estimate.
    first_heights = (1.0, 1.5, 0.75, 2.0, 1.25, 0.5)
    #: Higher pressures that are solved first if no height works, as multiples of the first one.
    higher_pressures = (3.0, 10.0)

    membrane: Membrane
    model: BubbleModel

    def equilibrium(self, start: Array, level: float) -> Array | None:
        if self.model.rim_motion is not None:
            start = start.copy()
            start.reshape(-1)[self.model.fixed] = self.model.prescribed(level)
        return self.membrane.equilibrium(start, level)

    def first_equilibrium(self, level: float) -> Array:
        return self._from_flat(level, self.max_halvings)

    def extrapolate(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        """Extrapolate the displacement in p^(1/3), in which it is nearly linear (p: pressure)."""
        count = monotonic_count(levels, level, self.look_back)
        if count == 1:
            return path[-1] * math.cbrt(level / levels[-1])
        x = np.cbrt(levels[-count:])
        return lagrange(x, np.array(path[-count:]), math.cbrt(level))

    def start_within_step(
        self,
        u: Array,
        level: float,
        target: float,
        previous: Array | None,
    ) -> Array:
        return u * (target / level) ** (1.0 / 3.0)

    def failure_message(self, previous: float, level: float, increment: str) -> str:
        where = f"no equilibrium at {level * 1e3:.4g} kPa ({increment})"
        return f"{where}; more increments, or moduli nearer to the data, usually help"

    def _from_flat(self, level: float, halvings: int) -> Array:
        """Return the equilibrium at the first pressure (MPa).

        The search starts from a dome, as a flat membrane without stress has no stiffness; lower
        pressures are tried where it fails. SolverFailure if none leads to an equilibrium.
        """
        displacement = self._from_domes(level)
        if displacement is None and halvings == self.max_halvings:
            displacement = self._from_above(level)
        if displacement is not None:
            return displacement
        if halvings > 0:
            lower = self._from_flat(0.25 * level, halvings - 1)
            displacement = self.reach(0.25 * level, lower, level, lower * 4.0 ** (1 / 3), halvings)
            if displacement is not None:
                return displacement
        raise SolverFailure(f"no equilibrium at the first increment, {level * 1e3:.4g} kPa")

    def _from_domes(self, level: float) -> Array | None:
        """Search for the equilibrium from paraboloids of about the height of Hencky's membrane."""
        membrane = self.membrane
        moduli = initial_moduli(membrane.law)
        fixed = np.setdiff1d(np.arange(membrane.reference.size), membrane.free)
        edge = membrane.reference[fixed[fixed % 3 == 2] // 3, :2]
        if not len(edge):
            return None  # nothing holds the sheet down
        form = rim_form(edge)
        # The circle that rises as high as a taut flat sheet with this elliptic edge.
        size = math.sqrt(2.0 / float(np.trace(form)))
        stiffness = 0.5 * float(np.median(membrane.section)) * (moduli[0] + moduli[1])
        # Hencky: apex = 0.662 R (p R / (E t))^(1/3)
        height = 0.662 * size * (level * size / stiffness) ** (1.0 / 3.0)
        plane = membrane.reference[:, :2]
        dome = 1.0 - rim_share(form, plane)[:, None] ** 2
        # The motion in the plane, -w grad(w)/3, makes the strain along radii of a rise w uniform.
        outwards = 2.0 / 3.0 * dome * (plane @ form)
        for factor in self.first_heights:
            rise = factor * height
            start = np.hstack([rise**2 * outwards, rise * dome])
            start.reshape(-1)[fixed] = 0.0
            displacement = self.equilibrium(start, level)
            if displacement is not None:
                return displacement
        return None

    def _from_above(self, level: float) -> Array | None:
        """Search for the equilibrium from one at a higher pressure, at which a sheet is taut."""
        for factor in self.higher_pressures:
            higher = self._from_domes(factor * level)
            if higher is None:
                continue
            start = self.start_within_step(higher, factor * level, level, None)
            return self.reach(factor * level, higher, level, start, self.max_halvings)
        return None


MAX_ITERATIONS = 30
#: Relative change of the pressure for the derivative of a force that is linear in it.
PRESSURE_STEP = 1e-2


@dataclass(frozen=True, eq=False)
class Inflated:
    """Hold an equilibrium of a bubble.

    Attributes
    ----------
    displacement : (n, 3) ndarray, mm
    pressure : float, MPa
    """

    displacement: Array
    pressure: float

    @property
    def height(self) -> float:
        """Return the largest rise, mm."""
        return float(self.displacement[:, 2].max())


def at_height(membrane: Membrane, start: Inflated, height: float) -> Inflated | None:
    """Return the equilibrium at which the highest node has risen to a height, or None.

    Parameters
    ----------
    membrane : Membrane
        With strain and stress at the start of the increment.
    start : Inflated
        Equilibrium near to it, whose highest node is the one that is prescribed.
    height : float, mm
    """
    node = int(np.argmax(start.displacement[:, 2]))
    place = int(np.searchsorted(membrane.free, 3 * node + 2))
    u = start.displacement * (height / start.height)
    pressure = start.pressure
    for _ in range(MAX_ITERATIONS):
        membrane.unbalance(u, (1.0 + PRESSURE_STEP) * pressure, with_tangent=False)
        residual_beyond = membrane.residual[membrane.free].copy()
        norm = membrane.unbalance(u, pressure, with_tangent=True)
        if not np.isfinite(norm):
            return None
        missing_height = height - u[node, 2]
        if norm < membrane.tolerance and abs(missing_height) < membrane.tolerance * height:
            return Inflated(u, pressure)
        residual = membrane.residual[membrane.free]
        by_pressure = (residual_beyond - residual) / (PRESSURE_STEP * pressure)
        try:
            membrane.tangent.factor()
        except SingularTangent:
            return None
        steps = -membrane.tangent.solve(np.column_stack([residual, by_pressure]))
        pressure_step = (missing_height - steps[place, 0]) / steps[place, 1]
        step = steps[:, 0] + pressure_step * steps[:, 1]
        scale = min(1.0, membrane.step_limit / float(np.abs(step).max()))
        u.reshape(-1)[membrane.free] += scale * step
        pressure += scale * pressure_step
    return None


def limit_point(
    membrane: Membrane,
    start: Inflated,
    *,
    growth: float = 1.03,
    max_growth: float = 3.0,
) -> Inflated | None:
    """Return the first equilibrium above `start` with a maximum of the pressure, or None.

    The strain of the last accepted increment is that at its start. The maximum is that of the
    equilibria found, which are the closer the smaller the growth of a step.

    Parameters
    ----------
    membrane : Membrane
    start : Inflated
    growth, max_growth : float
        Growth of the height in one step, and in all.
    """
    highest = start
    while highest.height < max_growth * start.height:
        following = at_height(membrane, highest, growth * highest.height)
        if following is None:
            return None
        if following.pressure < highest.pressure:
            return highest
        highest = following
    return None
