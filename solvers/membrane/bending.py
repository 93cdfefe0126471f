"""Bending of an inflated membrane: gas of constant mass, rigid bodies, a collar that moves."""

import copy
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw, law_beside, usual_step
from ...meshes.cylinder_model import (
    Bending,
    ClosedGas,
    Collar,
    CylinderModel,
    InflatedModel,
    RigidCylinder,
)
from ...notes import Note, NoteKind
from ..base import EARLY, SNAP, History
from . import closed as closed_model
from .bubble import TENSION_FIELD, Wall
from .closed import ClosedMembrane, brought_to_touch, closed_membrane, gaps
from .extrapolation import straight_on
from .increments import IncrementRecord
from .initial_stiffness import initial_moduli
from .loading import Loading, NoEquilibrium, RunRequest, march, reach_in_halves

#: Kinds of notes that are made here.
PENETRATION = NoteKind("penetration")
WRINKLES = NoteKind("wrinkle stiffness")


Array = NDArray[np.float64]
#: Viscosity over pressure over the size of a facet: in the first step, which hardly moves; factors
#: after a step that was found, and one that was not; the most steps of both kinds.
FIRST, DOWN, UP, MOST_STEPS = 20.0, 0.3, 8.0, 60
#: Likewise: the least; the most, then failure; at or below the third, equilibrium is searched
#: where a step moved no node by more than this share of a facet's size.
LEAST, MOST, LITTLE, NEAR = 1e-3, 1e5, 10.0, 0.05
#: A node further from the extrapolation than this many times the collar's way has snapped.
LEAP = 4.0
#: mm that the supports bite into the inflated membrane, which then hangs free on them.
BITE = 0.02
#: A gas at this many times the pressure nearly prescribes the volume that it fills.
OVERPRESSURE = 50.0
#: Share of the volume for one step, the smallest tried, and how far all of them may lead.
STEP, LEAST_STEP, MOST_GROWTH = 0.01, 1e-4, 2.0
#: An increment in which the volume grows by a larger share is passed by volume.
MOST_GROWTH_INFLATED = 0.1
#: Largest change of a modulus between a membrane and its neighbours.
SHARE = 1e-5


class Neighbours:
    """Membranes of laws next to that of another one, a parameter and a step each, on its way.

    A neighbour has a state of its own. Its equilibrium follows from the membrane's in two steps by
    the tangent of that one (gas, contact, cords, wrinkles): one would leave 1e-3 of a slope.
    """

    def __init__(self, membrane: ClosedMembrane, parameters: Sequence[str]) -> None:
        law = membrane.law
        self.each = []
        acting = {"nu12", *(f"beta_{i}" for i in law.form.free)}  # others of a form stay zero
        self.steps = np.array([usual_step(law, name, 1.0, SHARE) for name in parameters])
        for name, step in zip(parameters, self.steps.tolist(), strict=True):
            neighbour_law = law_beside(law, name, step) if name in acting else law
            self.each.append(_copied(membrane, neighbour_law))
        self.moved = [np.zeros_like(membrane.reference) for _ in self.each]

    def on(self, membrane: ClosedMembrane) -> None:
        """Go on beside a membrane with other supports, which has the state of the one before."""
        originals = self.each
        self.each = [_copied(membrane, copied.law) for copied in originals]
        for copied, old in zip(self.each, originals, strict=True):
            copied.strain_old[:] = old.strain_old
            copied.stress_old[:] = old.stress_old

    def follow(self, membrane: ClosedMembrane, u: Array) -> None:
        """Move to the equilibria beside u (n, 3), that of the membrane, before it is accepted."""
        if not self.each:
            return
        membrane.unbalance(u, membrane.pressure, with_tangent=True)
        membrane.factor()
        free = membrane.free
        for k, neighbour in enumerate(self.each):
            to = u.copy()
            neighbour.unbalance(to, membrane.pressure, with_tangent=False)
            for _ in range(2):
                off = (neighbour.residual - membrane.residual)[free]
                to.reshape(-1)[free] -= membrane.tangent.solve(off)
                if not np.isfinite(neighbour.unbalance(to, membrane.pressure, with_tangent=False)):
                    raise SolverFailure("no derivative: no valid stress next to an equilibrium")
            neighbour.accept()
            self.moved[k] = to

    def slopes(self, value: Array, neighbour_values: Sequence[Array]) -> Array:
        """Return derivatives (..., k) of a quantity by its values at the neighbours."""
        columns = [
            (neighbour_value - value) / step
            for neighbour_value, step in zip(neighbour_values, self.steps, strict=True)
        ]
        return np.stack(columns, axis=-1) if columns else np.zeros((*value.shape, 0))


def _copied(membrane: ClosedMembrane, law: HypoelasticLaw) -> ClosedMembrane:
    """Return a membrane with a state of its own, that of the other one, and another law."""
    copied = copy.copy(membrane)
    for name in ("strain_old", "stress_old", "strain_new", "stress_new", "wrinkle", "residual"):
        setattr(copied, name, getattr(membrane, name).copy())
    copied.law, copied.cords = law, copy.deepcopy(membrane.cords)
    return copied


def settled(membrane: ClosedMembrane, start: Array) -> Array | None:
    """Return the equilibrium (n, 3) to which the membrane alone moves from `start`, or None.

    Backward Euler steps of a viscous motion, residual(u) + viscosity area (u - u_before) = 0; the
    viscosity vanishes as the motion dies down. The law sees the way there as one increment.
    """
    facet = float(np.sqrt(np.median(membrane.elements.area.sum(axis=1))))
    unit = membrane.pressure / facet
    viscosity = FIRST * unit
    u = start
    try:
        for _ in range(MOST_STEPS):
            membrane.drag(viscosity, u)
            viscous = membrane.equilibrium(u, membrane.pressure)
            if viscous is None:
                viscosity *= UP
                if viscosity > MOST * unit:
                    return None
                continue
            motion = float(np.abs(viscous - u).max())
            u = viscous
            restless = viscosity > LITTLE * unit or motion > NEAR * facet
            viscosity = max(DOWN * viscosity, LEAST * unit)
            if restless:
                continue
            membrane.drag(0.0, u)
            equilibrium = membrane.equilibrium(u, membrane.pressure)
            if equilibrium is not None:
                return equilibrium
        return None
    finally:
        membrane.drag(0.0, start)


class Bodies:
    """Supports, and collars by their way, around an inflated membrane."""

    def __init__(self, membrane: ClosedMembrane, plan: Bending, inflated: Array) -> None:
        self.membrane = membrane
        self.way = np.asarray(plan.direction, dtype=float)
        position = membrane.reference + inflated
        self.posts = [brought_to_touch(body, position, -self.way, BITE) for body in plan.supports]
        self.collars: list[RigidCylinder] = []
        membrane.penalty = plan.penalty
        membrane.bodies = self.posts
        if plan.weight:
            weight = membrane.node_weight(plan.weight)
            membrane.dead = np.outer(weight, -self.way).reshape(-1)

    def close(self, plan: Bending, inflated: Array, pressure: float) -> None:
        """Bring the collars to touch the membrane at rest on its supports, and close the gas in."""
        position = self.membrane.reference + inflated
        self.collars = [brought_to_touch(body, position, self.way, 0.0) for body in plan.collars]
        volume, _ = self.membrane.cavity.measure(position)
        closed = plan.gas.closed_in(pressure, volume) if plan.gas.constant == "mass" else None
        self.membrane.gas = closed
        self.membrane.pressure = pressure

    def move(self, travel: float) -> None:
        """Move the collars by a way (mm) from where they touched."""
        self.membrane.bodies = list(self.posts)
        for body in self.collars:
            to = np.asarray(body.centre) + travel * self.way
            self.membrane.bodies.append(replace(body, centre=tuple(to.tolist())))

    def pushes(self) -> Array:
        """Return forces (bodies, 3) N on the meshed part, zero of collars that are not there."""
        forces = [push.sum(axis=0) for push in self.membrane.contact]
        return np.array(
            forces + [np.zeros(3)] * (len(self.posts) + len(self.collars) - len(forces))
        )


def analyse(
    membrane: ClosedMembrane,
    model: InflatedModel,
    inflated: Array,
    pressure: float,
    extremes: tuple[Array, Array],
    sides: NDArray[np.bool_],
    request: RunRequest,
    neighbours: Neighbours,
) -> tuple[History, Array]:
    """Return the frames of the bending: the inflated state and every reported displacement.

    `load` is the force (N) of the collar on the whole membrane along its way, `wrinkled` a share of
    `sides` (elements,). Without an equilibrium on the way the history ends with the last good
    frame. And derivatives of displacements, (frames, nodes, 3, k).
    """
    plan = model.bending
    assert plan is not None
    way = np.asarray(plan.direction, dtype=float)
    membrane.pressure = pressure
    bodies = Bodies(membrane, plan, inflated)
    neighbour_bodies = [
        Bodies(bodies_of_neighbour, plan, u)
        for bodies_of_neighbour, u in zip(neighbours.each, neighbours.moved, strict=True)
    ]
    if plan.weight:
        displacement = membrane.equilibrium(inflated, pressure)
        displacement = settled(membrane, inflated) if displacement is None else displacement
        if displacement is None:
            raise SolverFailure("no equilibrium of the inflated tube under its weight")
        neighbours.follow(membrane, displacement)
        membrane.accept()
        inflated = displacement
    bodies.close(plan, inflated, pressure)
    for bodies_of_neighbour, u in zip(neighbour_bodies, neighbours.moved, strict=True):
        bodies_of_neighbour.close(plan, u, pressure)
    volume, _ = membrane.cavity.measure(membrane.reference + inflated)
    membrane.keep_tangent = True

    low, high = (extreme.copy() for extreme in extremes)
    path = [inflated]
    moves = [0.0]
    wrinkle = membrane.wrinkle.copy()
    gas = [(pressure, volume)]
    pushes = [bodies.pushes()]
    rates = [
        (
            neighbours.slopes(inflated, neighbours.moved),
            neighbours.slopes(
                pushes[0],
                [bodies_of_neighbour.pushes() for bodies_of_neighbour in neighbour_bodies],
            ),
        )
    ]
    remarks: list[Note] = []
    snaps: list[float] = []
    early = ""
    wrinkled = [membrane.wrinkled_share(sides)]
    of_wrinkles = 0.0
    deepest = 0.0
    moving = Moving(membrane, bodies.move)
    # A displacement without equilibrium ends the history, and is no failure.
    try:
        steps = march(moving, plan.displacements, request, (0.0, inflated), len(model.pressures))
        for travel, displacement in zip(plan.displacements, steps, strict=True):
            if len(path) > 2 and np.abs(displacement - moving.expected).max() > LEAP * (
                travel - moves[-1]
            ):
                snaps.append(travel)
            for bodies_of_neighbour in neighbour_bodies:
                bodies_of_neighbour.move(travel)
            neighbours.follow(membrane, displacement)
            work = membrane.wrinkle_work(wrinkle)
            wrinkle = membrane.wrinkle.copy()
            membrane.accept()
            path.append(displacement)
            moves.append(travel)
            gas.append((membrane.pressure, membrane.volume))
            pushes.append(bodies.pushes())
            rates.append(
                (
                    neighbours.slopes(displacement, neighbours.moved),
                    neighbours.slopes(
                        pushes[-1],
                        [bodies_of_neighbour.pushes() for bodies_of_neighbour in neighbour_bodies],
                    ),
                )
            )
            wrinkled.append(membrane.wrinkled_share(sides))
            of_wrinkles = max(of_wrinkles, abs(work) / (moves[-1] - moves[-2]))
            position = membrane.reference + displacement
            deepest = max(deepest, *(-float(gaps(b, position)[0].min()) for b in membrane.bodies))
            np.minimum(low, membrane.strain_old.min(axis=(0, 1)), out=low)
            np.maximum(high, membrane.strain_old.max(axis=(0, 1)), out=high)
    except NoEquilibrium as failure:
        early = f"the run stopped early: {failure.reason}"
        remarks.append(Note(EARLY, early))
    reported = range(len(plan.displacements)) if plan.reported is None else plan.reported
    frames = [0, *(i + 1 for i in reported if i + 1 < len(path))]
    if len(frames) == 1:
        raise SolverFailure(f"no frame of the bending: {remarks[0]}")
    if snaps:
        where = ", ".join(f"{d:.4g}" for d in snaps)
        remarks.append(Note(SNAP, f"snaps, or nearly, before {where} mm of deflection"))
    words = f"rigid bodies penetrate {deepest:.3g} mm at most"
    remarks.append(Note(PENETRATION, words))
    largest_push = float(np.abs(np.array(pushes)[:, len(plan.supports) :].sum(axis=1) @ way).max())
    if membrane.wrinkle_stiffness is not None and largest_push > 0:
        words = (
            f"what stiffness is left to wrinkles ({membrane.wrinkle_stiffness:g} of the taut "
            f"fabric's) carries {100 * of_wrinkles / largest_push:.2g} % of the largest load"
        )
        remarks.append(Note(WRINKLES, words))
    # The other half takes up forces normal to a symmetry plane.
    copies = model.copies * ~membrane.cavity.symmetric
    force = np.array(pushes)[frames] * copies
    reactions: dict[str, Array] = {}
    for i, body in enumerate((*plan.supports, *plan.collars)):
        reactions[body.name] = reactions.get(body.name, 0.0) + force[:, i]
    by_collars = np.array(
        [bodies_of_neighbour[len(plan.supports) :].sum(axis=0) for _, bodies_of_neighbour in rates]
    )[frames]
    history = History(
        reactions[plan.collars[0].name] @ way,
        np.array(path)[frames],
        low,
        high,
        reactions,
        cavity_pressure=np.array([p for p, _ in gas])[frames],
        cavity_volume=model.copies * np.array([v for _, v in gas])[frames],
        iterations=membrane.iterations,
        path=np.array(path),
        wrinkled=np.array(wrinkled)[frames],
        remarks=tuple(remarks),
        early=early,
        relaxed=membrane.wrinkle_stiffness is not None,
        load_slope=np.einsum("fik,i->fk", by_collars, copies * way) if neighbours.each else None,
    )
    return history, np.array([bodies_of_neighbour for bodies_of_neighbour, _ in rates])[frames]


class Moving(Loading):
    """A membrane that a collar moves into, by its way (mm); expected : the extrapolated state."""

    max_halvings = 3

    def __init__(self, membrane: ClosedMembrane, move: Callable[[float], None]) -> None:
        self.membrane = membrane
        self.move = move
        self.expected = np.zeros_like(membrane.reference)

    def equilibrium(self, start: Array, level: float) -> Array | None:
        self.move(level)
        displacement = self.membrane.equilibrium(start, self.membrane.pressure)
        # Newton's iteration fails where wrinkles come and go, and at a limit load.
        return displacement if displacement is not None else settled(self.membrane, start)

    def extrapolate(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        # The way from the inflated state to the first contact says nothing of what follows.
        self.expected = straight_on(levels, path, level) if len(path) > 2 else path[-1]
        return self.expected

    def failure_message(self, previous: float, level: float, increment: str) -> str:
        return f"no equilibrium between {previous:.4g} and {level:.4g} mm of deflection"


def through_snap(membrane: ClosedMembrane, u: Array, previous: float, level: float) -> Array | None:
    """Return the equilibrium at `level` beyond a limit pressure, led there by the volume."""
    outer_pressure = OVERPRESSURE * level
    first, _ = membrane.cavity.measure(membrane.reference + u)
    volume = first
    pressure = previous
    step = STEP
    slope = np.zeros_like(u)
    try:
        while step >= LEAST_STEP and volume < MOST_GROWTH * first:
            membrane.gas = ClosedGas(
                (outer_pressure + pressure) * volume * (1.0 + step), outer_pressure
            )
            displacement = membrane.equilibrium(u + step * slope, 0.0)
            if displacement is None and step < 0.5 * STEP:
                # Snapping gathers in one bulge, and the rest of the wall slackens.
                displacement = membrane.equilibrium_from_slack(u, level)
                if displacement is None:
                    displacement = settled(membrane, u + step * slope)
            if displacement is None:
                step = 0.5 * step
                slope = np.zeros_like(u)
                continue
            if membrane.pressure >= level:
                membrane.gas = None
                return membrane.equilibrium(displacement, level)
            membrane.accept()
            slope = (displacement - u) / step
            u = displacement
            volume = membrane.volume
            pressure = membrane.pressure
            step = min(STEP, 1.5 * step)
        return None
    finally:
        membrane.gas = None


def analyse_inflated(
    membrane: ClosedMembrane, model: InflatedModel, request: RunRequest
) -> tuple[History, Array]:
    """Return the history of inflation or bending of a fresh membrane, and derivatives."""
    if request.guess is not None:
        raise InputError(None, "guess", "a closed membrane takes none")
    neighbours = Neighbours(membrane, request.parameters)
    levels = np.array(model.pressures)
    volume = np.zeros(len(levels))
    wrinkled = np.zeros(len(levels))
    sides = np.ones(len(model.mesh.quads), dtype=bool)
    filling = Filling(membrane)
    sides[model.mesh.element_sets.get("caps", np.empty(0, dtype=np.intp))] = False
    record = IncrementRecord(membrane, len(levels))
    membrane.keep_tangent = False
    rates = np.zeros((*record.path.shape, len(request.parameters)))
    for i, u in enumerate(march(filling, levels, request)):
        neighbours.follow(membrane, u)
        rates[i] = neighbours.slopes(u, neighbours.moved)
        record.accept(i, u)
        volume[i], wrinkled[i] = membrane.volume, membrane.wrinkled_share(sides)
    remarks = tuple(
        Note(
            SNAP,
            f"snaps, or nearly, between {previous * 1e3:.4g} and {level * 1e3:.4g} kPa: passed by "
            "leading the volume",
        )
        for previous, level in filling.snaps
    )
    if model.bending is not None:
        fixed = model.fixed(bent=True)
        bent = closed_membrane(model, membrane.law, membrane.tolerance, fixed, membrane.wall)
        bent.strain_old[:] = membrane.strain_old
        bent.stress_old[:] = membrane.stress_old
        bent.wrinkle[:] = membrane.wrinkle
        neighbours.on(bent)
        for copied, u in [
            (bent, record.path[-1]),
            *zip(neighbours.each, neighbours.moved, strict=True),
        ]:
            if copied.cords is not None:
                copied.cords.begin(copied.reference + u)
        bent.iterations = membrane.iterations
        extremes = (record.low, record.high)
        start = (record.path[-1], float(levels[-1]))
        history, slopes = analyse(bent, model, *start, extremes, sides, request, neighbours)
        return replace(history, remarks=(*remarks, *history.remarks)), slopes
    sets = model.mesh.node_sets
    reactions = {n: record.forces[:, sets[n]].sum(axis=1) for n in model.supports}
    history = History(
        levels,
        record.path,
        record.low,
        record.high,
        reactions,
        cavity_pressure=levels,
        cavity_volume=model.copies * volume,
        iterations=membrane.iterations,
        path=record.path,
        wrinkled=wrinkled,
        remarks=remarks,
        relaxed=membrane.wrinkle_stiffness is not None,
        load_slope=np.zeros((len(levels), len(neighbours.each))) if neighbours.each else None,
    )
    return history, rates


class Filling(Loading):
    """A closed membrane under a pressure (MPa); snaps : pairs of pressures around each snap."""

    max_halvings = 8

    def __init__(self, membrane: ClosedMembrane) -> None:
        self.membrane = membrane
        self.snaps: list[tuple[float, float]] = []

    def equilibrium(self, start: Array, level: float) -> Array | None:
        return self.membrane.equilibrium(start, level)

    def first_equilibrium(self, level: float) -> Array:
        return self._from_slack(level, self.max_halvings)

    def extrapolate(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        return straight_on(levels, path, level)

    def reach(
        self, lower: float, u: Array, level: float, start: Array, halvings: int
    ) -> Array | None:
        displacement = self._directly(lower, u, level, start, halvings)
        if displacement is not None:
            cavity = self.membrane.cavity
            reference = self.membrane.reference
            volume, volume_before = (cavity.measure(reference + at)[0] for at in (displacement, u))
            if volume < (1.0 + MOST_GROWTH_INFLATED) * volume_before:
                return displacement
            # Newton may leap over a limit point, but the law needs the strain path across it.
        self.snaps.append((lower, level))
        return through_snap(self.membrane, u, lower, level)

    def failure_message(self, previous: float, level: float, increment: str) -> str:
        return (
            f"no equilibrium at {level * 1e3:.4g} kPa ({increment}); more increments usually help, "
            "unless the membrane has a limit pressure below this one"
        )

    def _directly(
        self, lower: float, u: Array, level: float, start: Array, halvings: int
    ) -> Array | None:
        displacement = self.equilibrium(start, level)
        if displacement is None and halvings == self.max_halvings:
            # Folds of a cap come and go: treat it as slack before trying smaller steps.
            displacement = self.membrane.equilibrium_from_slack(u, level)
        if displacement is None:
            displacement = reach_in_halves(self, lower, u, level, halvings)
        return displacement

    def _from_slack(self, level: float, halvings: int) -> Array:
        """Return the first equilibrium: facets carry no pressure until they are stretched."""
        initial_moduli(self.membrane.law)
        none = np.zeros_like(self.membrane.reference)
        displacement = self.membrane.equilibrium_from_slack(none, level)
        if displacement is not None:
            return displacement
        if halvings > 0:
            lower = self._from_slack(0.25 * level, halvings - 1)
            displacement = self._directly(0.25 * level, lower, level, lower, halvings)
            if displacement is not None:
                return displacement
        raise SolverFailure(f"no equilibrium at the first increment, {level * 1e3:.4g} kPa")


def prepare(
    model: CylinderModel, law: HypoelasticLaw, tolerance: float, wall: Wall | None
) -> ClosedMembrane:
    """Build the membrane of a cylinder; a tension field unless another wall is given."""
    return closed_model.prepare(closed_membrane_of(model), law, tolerance, wall or TENSION_FIELD)


def analyse_cylinder(
    membrane: ClosedMembrane, model: CylinderModel, request: RunRequest
) -> tuple[History, Array]:
    return analyse_inflated(membrane, closed_membrane_of(model), request)


def closed_membrane_of(model: CylinderModel) -> InflatedModel:
    """Return the cylinder with its posts, whose forces are reported as one, and its ring."""
    sides = (1,) if "symmetry_z" in model.mesh.node_sets else (1, -1)
    supports = model.supports
    collar = model.collar
    posts = [
        RigidCylinder(
            "supports",
            (1.0, 0.0, 0.0),
            (0.0, 0.0, side * 0.5 * supports.span),
            0.5 * supports.diameter,
        )
        if supports.saddle is None
        else _ring("supports", supports.saddle, side * 0.5 * supports.span)
        for side in sides
    ]
    places = [side * 0.5 * collar.spacing for side in sides] if collar.spacing else [0.0]
    bending = Bending(
        posts,
        [_ring("collar", collar, place) for place in places],
        model.increments,
        released="support_bottom",
        gas=model.gas,
        reported=model.reported.tolist(),
        weight=model.weight,
    )
    return InflatedModel(
        model.mesh,
        model.thickness,
        np.asarray(model.mesh.warp),
        model.inflation,
        {**model.guides, "support_bottom": (1,)},
        model.copies,
        bending,
        model.cords,
    )


def _ring(name: str, size: Collar, place: float) -> RigidCylinder:
    """Return a ring around the tube at z = place."""
    centre = (0.0, 0.0, place)
    radius = 0.5 * size.inner_diameter
    return RigidCylinder(name, (0.0, 0.0, 1.0), centre, radius, True, size.length, size.fillet)
