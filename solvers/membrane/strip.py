"""A strip pulled in its plane, increment by increment of its gauge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.uniaxial import UniaxialModel
from ..base import History
from .derivatives import Derivatives
from .driven import DrivenTangent, Pull
from .element import reference_elements
from .march import Asked, Loading, Record, lagrange, march
from .newton import Membrane, initial_moduli
from .stability import named
from .wall import Wall

Array = NDArray[np.float64]

#: Increments that the start of the next one is extrapolated from.
LOOK_BACK = 4


def prepare(model: UniaxialModel, law: HypoelasticLaw, tolerance: float, wall: Wall) -> Membrane:
    """What does not change from one law to the next; the wall of a sheet is not bent."""
    points = np.array(model.mesh.points, dtype=float)
    quads = np.ascontiguousarray(model.mesh.quads, dtype=np.int64)
    held = np.concatenate([model.fixed, model.driven])
    free = np.setdiff1d(np.arange(points.size), held)
    warp = np.broadcast_to(model.warp, (len(quads), 3))
    return Membrane(
        points,
        quads,
        reference_elements(points, quads, warp),
        model.thickness,
        law,
        free,
        DrivenTangent(quads, points.size, free, model.driven),
        tolerance,
        step_limit=0.1 * float(np.ptp(points, axis=0).max()),
    )


def analyse(membrane: Membrane, model: UniaxialModel, asked: Asked) -> tuple[History, Array]:
    """History, and the derivatives of the displacements by the parameters in every increment.

    The membrane is fresh: no strain, no stress. Direct differentiation through the gauge: the
    strip at a fixed pull moves by a, for one mm of pull by w, and the pull changes so that the
    gauge does not: du = a - w (g a)/(g w), g the derivative of its length. The load's derivative
    is that of the residual at the driven unknowns.

    An increment is stable where the sheet between grips that stand still is, in its plane: a
    machine prescribes their distance, not the load.
    """
    parameters = asked.parameters
    initial_moduli(membrane.law)
    tangent = membrane.tangent
    assert isinstance(tangent, DrivenTangent)
    direction = np.zeros(membrane.reference.size)
    direction[model.driven] = -1.0
    pull = Pull(membrane, tangent, direction, model.mesh.node_sets["gauge"])
    levels, shape, free = np.array(model.elongations), membrane.reference.shape, membrane.free
    rates = np.zeros((len(levels), *shape, len(parameters)))
    load_slope = np.zeros((len(levels), len(parameters)))
    derivatives = Derivatives(membrane, parameters) if parameters else None
    record, unstable = Record(membrane, len(levels)), []
    membrane.keep_tangent = True
    for i, u in enumerate(march(Pulling(pull), levels, asked)):
        if not tangent.definite():
            unstable.append(i)
        if derivatives is not None:
            membrane.factor()
            rate = derivatives.at_fixed_displacement(u)
            w, (_, slope) = pull.response(), pull.elongation(u)
            du = np.zeros_like(rate)
            du[free] = -membrane.tangent.solve(rate[free])
            du -= np.outer(w, slope @ du) / (slope @ w)
            load_slope[i] = direction @ (rate + tangent.edge() @ du)
            derivatives.advance(du)
            rates[i] = du.reshape(*shape, -1)
        record.accept(i, u)
    forces = record.forces
    history = History(
        model.load_factor * (forces.reshape(len(levels), -1) @ direction),
        record.path,
        record.low,
        record.high,
        {
            n: forces[:, model.mesh.node_sets[n]].sum(axis=1)
            for n in (*model.supports, model.pulled)
        },
        iterations=membrane.iterations,
        path=record.path,
        path_slope=rates if parameters else None,
        load_slope=model.load_factor * load_slope if parameters else None,
        unstable=named(levels[unstable], "mm of elongation"),
    )
    return history, rates


class Pulling(Loading):
    """A strip whose gauge is to open by a length (mm)."""

    def __init__(self, pull: Pull) -> None:
        self.pull = pull

    def equilibrium(self, start: Array, level: float) -> Array | None:
        return self.pull.equilibrium(start, level)

    def first(self, level: float) -> Array | None:
        none = np.zeros_like(self.pull.membrane.reference)
        return self.reached(0.0, none, level, self._stretched(level), self.most_cuts)

    def ahead(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        """Extrapolated in the elongation, from zero or from the last increments."""
        x = np.array([0.0, *levels][-LOOK_BACK:])
        known = np.array([np.zeros_like(path[0]), *path][-LOOK_BACK:])
        return lagrange(x, known, level)

    def onward(self, u: Array, at: float, to: float, before: Array | None) -> Array:
        return np.asarray(u * (to / at)) if at > 0 else self._stretched(to)

    def problem(self, before: float, level: float, place: str) -> str:
        where = f"no equilibrium at {level:.4g} mm of gauge elongation ({place})"
        return f"{where}; more increments, or moduli nearer to the data, usually help"

    def guessed(self, guess: Array) -> Array:
        """With the held unknowns at zero and the driven ones at their common value."""
        flat = np.array(guess, dtype=float).reshape(-1)
        driven = self.pull.direction != 0
        free = self.pull.membrane.free
        moved = np.zeros_like(flat)
        moved[free] = flat[free]
        moved[driven] = float(flat[driven].mean())
        return moved.reshape(guess.shape)

    def _stretched(self, elongation: float) -> Array:
        """The strip stretched evenly along y: the start of the first increment."""
        reference = self.pull.membrane.reference
        u = np.zeros_like(reference)
        share = elongation / self.pull.gauge_length
        u[:, 1] = share * (reference[:, 1] - reference[:, 1].max())
        return self.guessed(u)
