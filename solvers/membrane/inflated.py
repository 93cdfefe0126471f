"""Inflation of a closed membrane from its slack state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...models.inflated import InflatedModel
from ..base import History
from . import bending
from .closed import ClosedMembrane
from .closed_model import closed_membrane
from .newton import initial_moduli
from .snap import through_snap

Array = NDArray[np.float64]

MOST_CUTS = 8
#: An increment in which the volume grows by a larger share is gone through by volume.
MOST_GROWTH = 0.1


def analyse(
    membrane: ClosedMembrane,
    model: InflatedModel,
    parameters: Sequence[str],
    pressure_offset: float,
    guess: Array | None,
) -> tuple[History, Array]:
    """History of the inflation, or of the bending where the model has one; no derivatives yet.

    The membrane is fresh: no strain, no stress.

    Raises
    ------
    InputError : derivatives, an offset of the pressure or a guess was asked for.
    SolverFailure : an increment of the pressure has no equilibrium.
    """
    if parameters or pressure_offset or guess is not None:
        raise InputError(
            None, "parameters", "a closed membrane takes no parameters, pressure offset or guess"
        )
    levels, shape = np.array(model.pressures), membrane.reference.shape
    path, forces = (np.zeros((len(levels), *shape)) for _ in range(2))
    volume, wrinkled = np.zeros(len(levels)), np.zeros(len(levels))
    low, high = np.zeros(3), np.zeros(3)
    remarks: list[str] = []
    sides = outside_caps(model)
    membrane.keep_tangent = False
    for i in range(len(levels)):
        path[i], snapped = _increment(membrane, path[:i], levels, i)
        if snapped:
            remarks.append(
                f"snaps, or nearly, between {levels[i - 1] * 1e3:.4g} and "
                f"{levels[i] * 1e3:.4g} kPa: passed by leading the volume"
            )
        membrane.accept()
        forces[i], volume[i] = membrane.residual.reshape(shape), membrane.volume
        wrinkled[i] = membrane.wrinkled_share(sides)
        np.minimum(low, membrane.strain_old.min(axis=(0, 1)), out=low)
        np.maximum(high, membrane.strain_old.max(axis=(0, 1)), out=high)
    if model.bending is not None:
        bent = closed_membrane(
            model, membrane.law, membrane.tolerance, model.fixed(bent=True),
            membrane.wall,
        )  # fmt: skip
        bent.strain_old[:], bent.stress_old[:] = membrane.strain_old, membrane.stress_old
        bent.wrinkle[:] = membrane.wrinkle
        bent.iterations = membrane.iterations
        history = bending.analyse(bent, model, path[-1], float(levels[-1]), (low, high), sides)
        history = replace(history, remarks=(*remarks, *history.remarks))
    else:
        reactions = {
            name: forces[:, model.mesh.node_sets[name]].sum(axis=1) for name in model.supports
        }
        history = History(
            levels,
            path,
            low,
            high,
            reactions,
            cavity_pressure=levels,
            cavity_volume=model.copies * volume,
            iterations=membrane.iterations,
            path=path,
            wrinkled=wrinkled,
            remarks=tuple(remarks),
        )
    return history, np.zeros((*history.displacement.shape, 0))


def outside_caps(model: InflatedModel) -> NDArray[np.bool_]:
    """(elements,) all but the set "caps": a flat cap is folded from the first kPa on."""
    sides = np.ones(len(model.mesh.quads), dtype=bool)
    sides[model.mesh.element_sets.get("caps", np.empty(0, dtype=np.intp))] = False
    return sides


def _increment(membrane: ClosedMembrane, path: Array, levels: Array, i: int) -> tuple[Array, bool]:
    """Displacement at level i, and whether the membrane snaps on the way."""
    level = float(levels[i])
    if i == 0:
        return _from_slack(membrane, level, MOST_CUTS), False
    before = float(levels[i - 1])
    start = path[-1]
    if i > 1:
        start = start + (level - before) / (before - levels[i - 2]) * (path[-1] - path[-2])
    found = _reach(membrane, before, path[-1], level, start, MOST_CUTS)
    if found is not None:
        now, then = (membrane.cavity.measure(membrane.reference + u)[0] for u in (found, path[-1]))
        if now < (1.0 + MOST_GROWTH) * then:
            return found, False
        # Newton may leap over a limit point, but the law needs the strain path on the way.
    found = through_snap(membrane, path[-1], before, level)
    if found is None:
        raise SolverFailure(
            f"no equilibrium at {level * 1e3:.4g} kPa (increment {i + 1} of {len(levels)}); "
            "more increments usually help, unless the membrane has a limit pressure below this one"
        )
    return found, True


def _from_slack(membrane: ClosedMembrane, level: float, cuts: int) -> Array:
    """First increment: facets carry no pressure until they are stretched."""
    initial_moduli(membrane.law)
    found = membrane.equilibrium_from_slack(np.zeros_like(membrane.reference), level)
    if found is not None:
        return found
    if cuts > 0:
        lower = _from_slack(membrane, 0.25 * level, cuts - 1)
        found = _reach(membrane, 0.25 * level, lower, level, lower, cuts)
        if found is not None:
            return found
    raise SolverFailure(f"no equilibrium at the first increment, {level * 1e3:.4g} kPa")


def _reach(
    membrane: ClosedMembrane, lower: float, u_lower: Array, level: float, start: Array, cuts: int
) -> Array | None:
    """Equilibrium at `level`, through halved steps from `lower`; strain history as for bubbles."""
    found = membrane.equilibrium(start, level)
    if found is None and lower > 0 and cuts == MOST_CUTS:
        # Folds of a cap come and go: what helps against slack helps here before smaller steps do.
        found = membrane.equilibrium_from_slack(u_lower, level)
    if found is not None or cuts == 0:
        return found
    middle = 0.5 * (lower + level)
    u_middle = _reach(membrane, lower, u_lower, middle, u_lower, cuts - 1)
    if u_middle is None:
        return None
    onward = 2.0 * u_middle - u_lower
    return _reach(membrane, middle, u_middle, level, onward, cuts - 1)
