"""Bending of an inflated membrane: gas of constant mass, rigid bodies, a collar that moves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...models.inflated import InflatedModel, RigidCylinder
from ...notes import Note, NoteKind
from ..base import History
from .closed import ClosedMembrane
from .contact import brought_to_touch, gaps
from .march import Asked, Loading, NoEquilibrium, march, straight_on
from .settling import settled

Array = NDArray[np.float64]

#: A node further from where the last increments led to than this many times the collar's way.
SNAP = 4.0
#: mm that the supports bite into the inflated membrane, which hangs free on them from then on.
BITE = 0.02


def analyse(
    membrane: ClosedMembrane,
    model: InflatedModel,
    inflated: Array,
    pressure: float,
    extremes: tuple[Array, Array],
    sides: NDArray[np.bool_],
    asked: Asked,
) -> History:
    """Frames of the bending: first the inflated state, then one for every reported displacement.

    `load` is the force (N) of the collar on the whole membrane along its way, `reactions` those of
    all bodies on it, `wrinkled` a share of `sides` (elements,). Where no equilibrium is found on
    the way, the history ends with the last good frame and says so.

    Raises
    ------
    SolverFailure : there is not even the first reported displacement.
    """
    plan = model.bending
    assert plan is not None
    way = np.asarray(plan.direction, dtype=float)
    position = membrane.reference + inflated
    posts = [brought_to_touch(body, position, -way, BITE) for body in plan.supports]
    collar = brought_to_touch(plan.collar, position, way, 0.0)
    volume, _ = membrane.cavity.measure(position)
    membrane.gas = plan.gas.closed_in(pressure, volume)
    membrane.penalty = plan.penalty
    membrane.keep_tangent = True

    def bodies(moved: float) -> tuple[RigidCylinder, ...]:
        centre = np.asarray(collar.centre) + moved * way
        return (*posts, replace(collar, centre=tuple(centre.tolist())))

    low, high = (extreme.copy() for extreme in extremes)
    path, moves = [inflated], [0.0]
    wrinkle = membrane.wrinkle.copy()
    gas, pushes = [(pressure, volume)], [np.zeros((len(posts) + 1, 3))]
    remarks: list[Note] = []
    snaps: list[float] = []
    early = ""
    wrinkled, of_wrinkles, deepest = [membrane.wrinkled_share(sides)], 0.0, 0.0
    moving = Moving(membrane, bodies)
    # What has no equilibrium on the way ends the history, and is no failure.
    try:
        steps = march(moving, plan.displacements, asked, (0.0, inflated), len(model.pressures))
        for wanted, found in zip(plan.displacements, steps, strict=True):
            if len(path) > 2 and np.abs(found - moving.expected).max() > SNAP * (
                wanted - moves[-1]
            ):
                snaps.append(wanted)
            work = membrane.wrinkle_work(wrinkle)
            wrinkle = membrane.wrinkle.copy()
            membrane.accept()
            path.append(found)
            moves.append(wanted)
            gas.append((membrane.pressure, membrane.volume))
            pushes.append(np.array([push.sum(axis=0) for push in membrane.contact]))
            wrinkled.append(membrane.wrinkled_share(sides))
            of_wrinkles = max(of_wrinkles, abs(work) / (moves[-1] - moves[-2]))
            now = membrane.reference + found
            deepest = max(deepest, *(-float(gaps(b, now)[0].min()) for b in membrane.bodies))
            np.minimum(low, membrane.strain_old.min(axis=(0, 1)), out=low)
            np.maximum(high, membrane.strain_old.max(axis=(0, 1)), out=high)
    except NoEquilibrium as failure:
        early = f"the run stopped early: {failure.reason}"
        remarks.append(Note(NoteKind.EARLY, early))
    frames = [0]
    for i in range(len(plan.displacements)) if plan.reported is None else plan.reported:
        if i + 1 < len(path):
            frames.append(i + 1)
    if len(frames) == 1:
        raise SolverFailure(f"no frame of the bending: {remarks[0]}")
    if snaps:
        where = ", ".join(f"{d:.4g}" for d in snaps)
        words = f"snaps, or nearly, before {where} mm of deflection"
        remarks.append(Note(NoteKind.SNAP, words))
    words = f"rigid bodies penetrate {deepest:.3g} mm at most"
    remarks.append(Note(NoteKind.PENETRATION, words))
    most = float(np.abs(np.array(pushes)[:, -1] @ way).max())
    if membrane.wrinkle_stiffness is not None and most > 0:
        words = (
            f"what stiffness is left to wrinkles ({membrane.wrinkle_stiffness:g} of the taut "
            f"fabric's) carries {100 * of_wrinkles / most:.2g} % of the largest load"
        )
        remarks.append(Note(NoteKind.WRINKLES, words))
    # What is normal to a symmetry plane is taken up by the other half.
    force = model.copies * np.array(pushes)[frames] * ~membrane.cavity.symmetric
    reactions: dict[str, Array] = {}
    for i, body in enumerate((*posts, collar)):
        reactions[body.name] = reactions.get(body.name, 0.0) + force[:, i]
    return History(
        force[:, -1] @ way,
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
    )


class Moving(Loading):
    """A membrane that a collar is moved into, by its way (mm).

    expected : where the last increments led to.
    """

    most_cuts = 3

    def __init__(
        self, membrane: ClosedMembrane, bodies: Callable[[float], tuple[RigidCylinder, ...]]
    ) -> None:
        self.membrane, self.bodies = membrane, bodies
        self.expected = np.zeros_like(membrane.reference)

    def equilibrium(self, start: Array, level: float) -> Array | None:
        self.membrane.bodies = self.bodies(level)
        found = self.membrane.equilibrium(start, self.membrane.pressure)
        # Wrinkles that come and go leave Newton's iteration nowhere to go; so does a limit load.
        return found if found is not None else settled(self.membrane, start)

    def ahead(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        # The way from the inflated state to the first contact says nothing of what follows.
        self.expected = straight_on(levels, path, level) if len(path) > 2 else path[-1]
        return self.expected

    def problem(self, before: float, level: float, place: str) -> str:
        return f"no equilibrium between {before:.4g} and {level:.4g} mm of deflection"
