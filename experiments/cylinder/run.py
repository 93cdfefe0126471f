"""The arrays of a run of a bent cylinder that are stored, and how they are read back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...errors import SolverFailure
from ...meshes.beam_model import BeamModel
from ...meshes.cylinder_model import CylinderModel
from ...solvers.base import Array, History
from ..forward import RunRecord

Model = CylinderModel | BeamModel


def deflections_of(model: Model, load: Array) -> Array:
    """Return the deflections (frames,) mm at which a model has its loads (frames,) N."""
    return np.array([0.0, *model.deflections])[: len(load)]


@dataclass(frozen=True, eq=False)
class BendingRun:
    """A run that did not fail; frame 0 is the inflated cylinder.

    Parameters
    ----------
    deflection, load, pressure, volume : (frames,) arrays
        Deflection (mm), load (N), gauge pressure (MPa) and volume of the gas (mm^3) of the whole
        cylinder.
    inflated, bent : (nodes, 3) arrays
        Displacement at the first and at the last frame, mm.
    wrinkled : (frames,) array
        Share of the surface that is wrinkled; empty where the solver does not give it.
    """

    deflection: Array
    load: Array
    pressure: Array
    volume: Array
    inflated: Array
    bent: Array
    wrinkled: Array


def run_of(record: RunRecord) -> BendingRun | None:
    """Return the run of a record; None where it failed."""
    return None if record.failure else BendingRun(**record.arrays)


def arrays_of(model: Model, history: History) -> Mapping[str, Array]:
    """Return the arrays of a history that are stored, by the names of `BendingRun`.

    Raises
    ------
    SolverFailure
        If pressure or volume is missing, or if there are fewer frames than requested and no reason
        is given.
    """
    deflection = np.array([0.0, *model.deflections])
    reached = len(history.load)
    if reached < len(deflection) and not history.early:
        where = f"at {deflection[reached - 1]:g} of {deflection[-1]:g} mm"
        raise SolverFailure(f"the results end {where}, and do not say why", "")
    if history.cavity_pressure is None or history.cavity_volume is None:
        raise SolverFailure("the results have no gas pressure or no volume", "")
    run = BendingRun(
        deflection=deflection[:reached],
        load=np.asarray(history.load, dtype=float),
        pressure=np.asarray(history.cavity_pressure, dtype=float),
        volume=np.asarray(history.cavity_volume, dtype=float),
        inflated=history.displacement[0],
        bent=history.displacement[-1],
        wrinkled=np.asarray(() if history.wrinkled is None else history.wrinkled, dtype=float),
    )
    return vars(run)
