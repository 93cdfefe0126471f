"""What is kept of a cylinder that was inflated and bent: what figures and tables need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...models.cylinder import CylinderModel
from ...solvers.base import History
from ..predicted import RunRecord

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BendingRun:
    """A run that did not fail. Frame 0 is the inflated cylinder; frames are those reached.

    Parameters
    ----------
    deflection, load, pressure, volume : (frames,) mm, N, MPa, mm^3, of the whole cylinder.
    inflated, bent : (nodes, 3) mm of displacement at the first and the last frame.
    wrinkled : (frames,) share of the surface, empty where the solver does not say.
    """

    deflection: Array
    load: Array
    pressure: Array
    volume: Array
    inflated: Array
    bent: Array
    wrinkled: Array


def run_of(record: RunRecord) -> BendingRun | None:
    """The run of a record; None where it failed."""
    return None if record.failure else BendingRun(**record.arrays)


def arrays_of(model: CylinderModel, history: History) -> Mapping[str, Array]:
    """What is kept of a history, by the names of `BendingRun`.

    Raises
    ------
    SolverFailure : no gas; fewer frames than asked for, and no word of the solver why.
    """
    deflection = np.array([0.0, *model.deflections])
    reached = len(history.load)
    if reached < len(deflection) and not early_end(model, history):
        where = f"at {deflection[reached - 1]:g} of {deflection[-1]:g} mm"
        raise SolverFailure(f"the results end {where}, and do not say why", "")
    if history.cavity_pressure is None or history.cavity_volume is None:
        raise SolverFailure("the results have no gas pressure or no volume", "")
    run = BendingRun(
        deflection[:reached],
        np.asarray(history.load, dtype=float),
        np.asarray(history.cavity_pressure, dtype=float),
        np.asarray(history.cavity_volume, dtype=float),
        history.displacement[0],
        history.displacement[-1],
        np.empty(0) if history.wrinkled is None else np.asarray(history.wrinkled, dtype=float),
    )
    return {field.name: getattr(run, field.name) for field in fields(run)}


def early_end(model: CylinderModel, history: History) -> str:
    """The solver's own word for an end before the last deflection, "" where it came so far."""
    if len(history.load) > len(model.deflections):
        return ""
    return history.early


def depends_on(model: CylinderModel) -> tuple[object, ...]:
    """All of a model that its result depends on."""
    mesh = model.mesh
    return (
        model.thickness, model.inflation, model.deflections, model.increments, model.collar,
        model.supports, model.gas, mesh.points, mesh.quads, mesh.warp, mesh.node_sets,
    )  # fmt: skip
