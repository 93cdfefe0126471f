"""Bending of an inflated membrane on rigid supports by moving collars, with its gas closed in."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...meshes.cylinder_model import Bending, InflatedModel, RigidCylinder
from ...notes import Note, NoteKind
from ..base import EARLY, SNAP, History
from .closed import ClosedMembrane
from .contact import brought_to_touch, gaps
from .loading import Loading, NoEquilibrium, RunRequest, march, straight_on
from .sensitivity import Neighbours

#: Kinds of notes on a bending.
PENETRATION = NoteKind("penetration")
WRINKLES = NoteKind("wrinkle stiffness")
#: Depth in mm by which the supports penetrate the inflated membrane at first, to be in contact.
BITE = 0.02

Array = NDArray[np.float64]


class RigidBodies:
    """The supports and the moving collars around an inflated membrane.

    Attributes
    ----------
    direction : (3,) ndarray
        Unit vector along which the collars move.
    supports, collars : list of RigidCylinder
        The bodies where they first touch the membrane.
    """

    def __init__(self, membrane: ClosedMembrane, plan: Bending, inflated: Array) -> None:
        self.membrane = membrane
        self.direction = np.asarray(plan.direction, dtype=float)
        position = membrane.reference + inflated
        self.supports = [
            brought_to_touch(body, position, -self.direction, BITE) for body in plan.supports
        ]
        self.collars: list[RigidCylinder] = []
        membrane.penalty = plan.penalty
        membrane.bodies = self.supports
        if plan.weight:
            weight = membrane.node_weight(plan.weight)
            membrane.dead = np.outer(weight, -self.direction).reshape(-1)

    def begin_bending(self, plan: Bending, inflated: Array, pressure: float) -> None:
        """Bring the collars into contact with the membrane on its supports, and close the gas in.

        Parameters
        ----------
        inflated : array
            Displacement (n, 3) mm.
        pressure : float, MPa
            Gauge pressure of the gas.
        """
        position = self.membrane.reference + inflated
        self.collars = [
            brought_to_touch(body, position, self.direction, 0.0) for body in plan.collars
        ]
        volume, _ = self.membrane.cavity.measure(position)
        closed = plan.gas.closed_in(pressure, volume) if plan.gas.constant == "mass" else None
        self.membrane.gas = closed
        self.membrane.pressure = pressure

    def move(self, travel: float) -> None:
        """Move the collars to a distance (mm) from where they first touched the membrane."""
        self.membrane.bodies = list(self.supports)
        for body in self.collars:
            centre = np.asarray(body.centre) + travel * self.direction
            self.membrane.bodies.append(replace(body, centre=tuple(centre.tolist())))

    def pushes(self) -> Array:
        """Return the force of each body on the meshed part, (bodies, 3) N.

        The supports come first, then the collars; it is zero for collars not yet in contact.
        """
        forces = [push.sum(axis=0) for push in self.membrane.contact]
        missing = len(self.supports) + len(self.collars) - len(forces)
        return np.array(forces + [np.zeros(3)] * missing)


@dataclass(frozen=True, eq=False)
class InflatedState:
    """State of the inflated membrane, from which a bending starts.

    Attributes
    ----------
    displacement : (n, 3) array, mm
    pressure : float, MPa
    low, high : (3,) array
        Extremes of the log strains so far.
    """

    displacement: Array
    pressure: float
    low: Array
    high: Array


def analyse(
    membrane: ClosedMembrane,
    model: InflatedModel,
    inflated: InflatedState,
    sides: NDArray[np.bool_],
    request: RunRequest,
    neighbours: Neighbours,
) -> tuple[History, Array]:
    """Bend an inflated membrane by moving the collars in increments.

    Parameters
    ----------
    membrane : ClosedMembrane
        It must have the strain and stress of `inflated`.
    model : InflatedModel
        It must have a bending.
    inflated : InflatedState
    sides : (elements,) array of bool
        Whether an element belongs to the surface whose wrinkled share is reported.
    request : RunRequest
    neighbours : Neighbours
        Neighbours of `membrane`, for the derivatives.

    Returns
    -------
    History
        Its frames are the inflated state and every reported displacement of the collars. `load` is
        the force (N) of the collars on the whole membrane in the direction of their motion. If an
        increment has no equilibrium the history ends with the last frame before it.
    (frames, nodes, 3, k) array
        Derivatives of the displacements by the k parameters of the request.

    Raises
    ------
    SolverFailure
        If there is no equilibrium under the weight, or none at the first reported displacement.
    """
    run = BendingAnalysis(membrane, model, inflated, sides, neighbours)
    run.start()
    run.bend(request)
    return run.history()


@dataclass(eq=False)
class BendingAnalysis:
    """A bending, increment by increment; see `analyse`.

    Lists such as `path`, `travels` and `pushes` have an entry for the inflated state and one for
    each increment.
    """

    #: The membrane has snapped if a node ends further from its extrapolated position than this
    #: many times the collars' motion in the increment.
    leap = 4.0

    membrane: ClosedMembrane
    model: InflatedModel
    inflated: InflatedState
    sides: NDArray[np.bool_]
    neighbours: Neighbours

    def __post_init__(self) -> None:
        assert self.model.bending is not None
        self.plan = self.model.bending
        self.membrane.pressure = self.inflated.pressure
        self.bodies = RigidBodies(self.membrane, self.plan, self.inflated.displacement)
        neighbours = zip(self.neighbours.membranes, self.neighbours.displacements, strict=True)
        self.neighbour_bodies = [RigidBodies(m, self.plan, u) for m, u in neighbours]
        self.low = self.inflated.low.copy()
        self.high = self.inflated.high.copy()
        self.path: list[Array] = []
        self.travels: list[float] = []
        self.pressures: list[float] = []
        self.volumes: list[float] = []
        self.pushes: list[Array] = []
        self.displacement_slopes: list[Array] = []
        self.push_slopes: list[Array] = []
        self.wrinkled: list[float] = []
        #: Wrinkle strain (quads, 4, 3) at the start of the present increment.
        self.wrinkle = self.membrane.wrinkle.copy()
        self.snaps: list[float] = []
        #: Largest force (N, on the meshed part) with which the stiffness left across wrinkles
        #: resists the collars in an increment: the magnitude of its work over their motion.
        self.max_wrinkle_force = 0.0
        #: Largest depth (mm) of a rigid body in the membrane, of all increments.
        self.deepest = 0.0
        #: Why the bending ended early, "" if it did not.
        self.early = ""

    def start(self) -> None:
        """Lay the membrane on its supports, bring the collars to touch it, and close the gas in."""
        membrane = self.membrane
        pressure = self.inflated.pressure
        displacement = self._under_weight()
        self.bodies.begin_bending(self.plan, displacement, pressure)
        displacements = self.neighbours.displacements
        for bodies, u in zip(self.neighbour_bodies, displacements, strict=True):
            bodies.begin_bending(self.plan, u, pressure)
        volume, _ = membrane.cavity.measure(membrane.reference + displacement)
        self.wrinkle = membrane.wrinkle.copy()
        self._record(0.0, displacement, pressure, volume)

    def _under_weight(self) -> Array:
        """Return the displacement (n, 3) mm of the inflated membrane under its weight, if any."""
        inflated = self.inflated.displacement
        if not self.plan.weight:
            return inflated
        displacement = self.membrane.equilibrium(inflated, self.inflated.pressure)
        if displacement is None:
            raise SolverFailure("no equilibrium of the inflated tube under its weight")
        self.neighbours.follow(self.membrane, displacement)
        self.membrane.accept()
        return displacement

    def bend(self, request: RunRequest) -> None:
        """Move the collars; the history ends, without an error, where an equilibrium is missing."""
        moving = CollarMotion(self.membrane, self.bodies.move)
        travels = self.plan.displacements
        origin = (0.0, self.path[0])
        try:
            steps = march(moving, travels, request, origin, len(self.model.pressures))
            for travel, displacement in zip(travels, steps, strict=True):
                self._step(travel, displacement, moving.expected)
        except NoEquilibrium as failure:
            self.early = f"the run stopped early: {failure.reason}"

    def _step(self, travel: float, displacement: Array, expected: Array) -> None:
        """Accept and record an equilibrium.

        Parameters
        ----------
        travel : float, mm
            Motion of the collars.
        expected : array
            Extrapolated displacement (n, 3) mm.
        """
        membrane = self.membrane
        step = travel - self.travels[-1]
        if len(self.path) > 2 and np.abs(displacement - expected).max() > self.leap * step:
            self.snaps.append(travel)
        for bodies in self.neighbour_bodies:
            bodies.move(travel)
        self.neighbours.follow(membrane, displacement)
        work = membrane.wrinkle_work(self.wrinkle)
        self.wrinkle = membrane.wrinkle.copy()
        membrane.accept()
        self._record(travel, displacement, membrane.pressure, membrane.volume)
        self.max_wrinkle_force = max(self.max_wrinkle_force, abs(work) / step)
        position = membrane.reference + displacement
        depths = [-float(gaps(body, position)[0].min()) for body in membrane.bodies]
        self.deepest = max(self.deepest, *depths)
        np.minimum(self.low, membrane.strain_old.min(axis=(0, 1)), out=self.low)
        np.maximum(self.high, membrane.strain_old.max(axis=(0, 1)), out=self.high)

    def _record(
        self,
        travel: float,
        displacement: Array,
        pressure: float,
        volume: float,
    ) -> None:
        """Append the state to those that the history is made of.

        Parameters
        ----------
        travel : float, mm
            Motion of the collars.
        displacement : (nodes, 3) array, mm
        pressure, volume : float, MPa and mm^3
            Of the gas.
        """
        neighbours = self.neighbours
        pushes = self.bodies.pushes()
        neighbour_pushes = [bodies.pushes() for bodies in self.neighbour_bodies]
        self.path.append(displacement)
        self.travels.append(travel)
        self.pressures.append(pressure)
        self.volumes.append(volume)
        self.pushes.append(pushes)
        self.displacement_slopes.append(neighbours.slopes(displacement, neighbours.displacements))
        self.push_slopes.append(neighbours.slopes(pushes, neighbour_pushes))
        self.wrinkled.append(self.membrane.wrinkled_share(self.sides))

    def history(self) -> tuple[History, Array]:
        """Return the history of the reported frames, and derivatives of their displacements."""
        plan = self.plan
        membrane = self.membrane
        frames = self._reported_frames()
        direction = self.bodies.direction
        # The other half takes up forces normal to a symmetry plane.
        copies = self.model.copies * ~membrane.cavity.symmetric
        force = np.array(self.pushes)[frames] * copies
        reactions: dict[str, Array] = {}
        for i, body in enumerate((*plan.supports, *plan.collars)):
            reactions[body.name] = reactions.get(body.name, 0.0) + force[:, i]
        load_slope = None
        if self.neighbours.membranes:
            by_collars = np.array(
                [slopes[len(plan.supports) :].sum(axis=0) for slopes in self.push_slopes]
            )[frames]
            load_slope = np.einsum("fik,i->fk", by_collars, copies * direction)
        history = History(
            reactions[plan.collars[0].name] @ direction,
            np.array(self.path)[frames],
            self.low,
            self.high,
            reactions,
            cavity_pressure=np.array(self.pressures)[frames],
            cavity_volume=self.model.copies * np.array(self.volumes)[frames],
            iterations=membrane.iterations,
            path=np.array(self.path),
            wrinkled=np.array(self.wrinkled)[frames],
            remarks=tuple(self._remarks()),
            early=self.early,
            relaxed=membrane.wrinkle_stiffness is not None,
            load_slope=load_slope,
        )
        return history, np.array(self.displacement_slopes)[frames]

    def _reported_frames(self) -> list[int]:
        """Return the indices of the reported states in `path`; 0 is the inflated state."""
        plan = self.plan
        reported = range(len(plan.displacements)) if plan.reported is None else plan.reported
        frames = [0, *(i + 1 for i in reported if i + 1 < len(self.path))]
        if len(frames) == 1:
            raise SolverFailure(f"no frame of the bending: {self._remarks()[0]}")
        return frames

    def _remarks(self) -> list[Note]:
        """Return notes on an early end, snaps, penetration, and the load that wrinkles carry."""
        remarks = []
        if self.early:
            remarks.append(Note(EARLY, self.early))
        if self.snaps:
            travels = ", ".join(f"{travel:.4g}" for travel in self.snaps)
            remarks.append(Note(SNAP, f"snaps, or nearly, before {travels} mm of deflection"))
        words = f"rigid bodies penetrate {self.deepest:.3g} mm at most"
        remarks.append(Note(PENETRATION, words))
        by_collars = np.array(self.pushes)[:, len(self.plan.supports) :].sum(axis=1)
        largest_push = float(np.abs(by_collars @ self.bodies.direction).max())
        stiffness = self.membrane.wrinkle_stiffness
        if stiffness is not None and largest_push > 0:
            words = (
                f"what stiffness is left to wrinkles ({stiffness:g} of the taut fabric's) "
                f"carries {100 * self.max_wrinkle_force / largest_push:.2g} % of the largest load"
            )
            remarks.append(Note(WRINKLES, words))
        return remarks


class CollarMotion(Loading):
    """Loading of an inflated membrane by the motion of the collars (mm).

    Attributes
    ----------
    move : callable
        Moves the collars to a distance from where they first touched.
    expected : (n, 3) array, mm
        The last extrapolated displacement.
    """

    max_halvings = 3

    def __init__(self, membrane: ClosedMembrane, move: Callable[[float], None]) -> None:
        self.membrane = membrane
        self.move = move
        self.expected = np.zeros_like(membrane.reference)

    def equilibrium(self, start: Array, level: float) -> Array | None:
        self.move(level)
        return self.membrane.equilibrium(start, self.membrane.pressure)

    def extrapolate(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        self.expected = straight_on(levels, path, level)
        return self.expected

    def failure_message(self, previous: float, level: float, increment: str) -> str:
        return f"no equilibrium between {previous:.4g} and {level:.4g} mm of deflection"
