"""Inflation of a closed membrane from its slack state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...models.inflated import InflatedModel
from ...notes import Note, NoteKind
from ..base import History
from . import bending
from .closed import ClosedMembrane
from .closed_model import closed_membrane
from .march import Asked, Loading, Record, halved, march, straight_on
from .newton import initial_moduli
from .snap import through_snap

Array = NDArray[np.float64]

#: An increment in which the volume grows by a larger share is gone through by volume.
MOST_GROWTH = 0.1


def analyse(membrane: ClosedMembrane, model: InflatedModel, asked: Asked) -> tuple[History, Array]:
    """History of the inflation, or of the bending where the model has one; no derivatives yet.

    The membrane is fresh: no strain, no stress.

    Raises
    ------
    InputError : derivatives or a guess was asked for.
    SolverFailure : an increment of the pressure has no equilibrium.
    """
    if asked.parameters or asked.guess is not None:
        raise InputError(None, "parameters", "a closed membrane takes no parameters or guess")
    levels = np.array(model.pressures)
    volume, wrinkled = np.zeros(len(levels)), np.zeros(len(levels))
    sides, filling = outside_caps(model), Filling(membrane)
    record = Record(membrane, len(levels))
    membrane.keep_tangent = False
    for i, u in enumerate(march(filling, levels, asked)):
        record.accept(i, u)
        volume[i], wrinkled[i] = membrane.volume, membrane.wrinkled_share(sides)
    remarks = tuple(
        Note(
            NoteKind.SNAP,
            f"snaps, or nearly, between {before * 1e3:.4g} and {level * 1e3:.4g} kPa: passed by "
            "leading the volume",
        )
        for before, level in filling.snaps
    )
    if model.bending is not None:
        bent = closed_membrane(
            model, membrane.law, membrane.tolerance, model.fixed(bent=True),
            membrane.wall,
        )  # fmt: skip
        bent.strain_old[:], bent.stress_old[:] = membrane.strain_old, membrane.stress_old
        bent.wrinkle[:] = membrane.wrinkle
        bent.iterations = membrane.iterations
        extremes = (record.low, record.high)
        start = (record.path[-1], float(levels[-1]))
        history = bending.analyse(bent, model, *start, extremes, sides, asked)
        history = replace(history, remarks=(*remarks, *history.remarks))
    else:
        reactions = {
            name: record.forces[:, model.mesh.node_sets[name]].sum(axis=1)
            for name in model.supports
        }
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
        )
    return history, np.zeros((*history.displacement.shape, 0))


def outside_caps(model: InflatedModel) -> NDArray[np.bool_]:
    """(elements,) all but the set "caps": a flat cap is folded from the first kPa on."""
    sides = np.ones(len(model.mesh.quads), dtype=bool)
    sides[model.mesh.element_sets.get("caps", np.empty(0, dtype=np.intp))] = False
    return sides


class Filling(Loading):
    """A closed membrane under a pressure (MPa).

    snaps : the pressures between which it snaps, as they are met.
    """

    most_cuts = 8

    def __init__(self, membrane: ClosedMembrane) -> None:
        self.membrane = membrane
        self.snaps: list[tuple[float, float]] = []

    def equilibrium(self, start: Array, level: float) -> Array | None:
        return self.membrane.equilibrium(start, level)

    def first(self, level: float) -> Array:
        return self._from_slack(level, self.most_cuts)

    def ahead(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        return straight_on(levels, path, level)

    def reached(
        self, lower: float, u: Array, level: float, start: Array, cuts: int
    ) -> Array | None:
        found = self._directly(lower, u, level, start, cuts)
        if found is not None:
            cavity, reference = self.membrane.cavity, self.membrane.reference
            now, then = (cavity.measure(reference + at)[0] for at in (found, u))
            if now < (1.0 + MOST_GROWTH) * then:
                return found
            # Newton may leap over a limit point, but the law needs the strain path on the way.
        self.snaps.append((lower, level))
        return through_snap(self.membrane, u, lower, level)

    def problem(self, before: float, level: float, place: str) -> str:
        return (
            f"no equilibrium at {level * 1e3:.4g} kPa ({place}); more increments usually help, "
            "unless the membrane has a limit pressure below this one"
        )

    def _directly(
        self, lower: float, u: Array, level: float, start: Array, cuts: int
    ) -> Array | None:
        found = self.equilibrium(start, level)
        if found is None and cuts == self.most_cuts:
            # Folds of a cap come and go: what helps against slack helps here before smaller steps.
            found = self.membrane.equilibrium_from_slack(u, level)
        return found if found is not None else halved(self, lower, u, level, cuts)

    def _from_slack(self, level: float, cuts: int) -> Array:
        """Facets carry no pressure until they are stretched."""
        initial_moduli(self.membrane.law)
        none = np.zeros_like(self.membrane.reference)
        found = self.membrane.equilibrium_from_slack(none, level)
        if found is not None:
            return found
        if cuts > 0:
            lower = self._from_slack(0.25 * level, cuts - 1)
            found = self._directly(0.25 * level, lower, level, lower, cuts)
            if found is not None:
                return found
        raise SolverFailure(f"no equilibrium at the first increment, {level * 1e3:.4g} kPa")
