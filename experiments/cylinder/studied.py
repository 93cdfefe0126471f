"""How a cylinder is studied: what refinement or nu12 changes in shape, stiffness and loads."""

from __future__ import annotations

import numpy as np

from ...models.cylinder import CylinderModel
from ...solvers.base import History
from ..base import Studied
from .measures import Array, initial_stiffness, knee_point, limit_point, loads_at


def deflection_curve(model: CylinderModel, history: History) -> tuple[Array, Array]:
    """Deflection (mm) and load (N) from the inflated cylinder to where the run ended."""
    return np.array([0.0, *model.deflections])[: len(history.load)], history.load


def loads(model: CylinderModel, history: History) -> dict[str, float]:
    """Load (N) at the places where the curve is read, as far as the run went."""
    read = loads_at(*deflection_curve(model, history), model.reading.places)
    return {f"load at {place}, N": load for place, load in read.items() if load is not None}


def quantities(model: CylinderModel, history: History) -> dict[str, float]:
    """What a study of the mesh looks at; knee and limit point where the run has them."""
    mesh, over = model.mesh, model.reading.slope_over
    inflated = 0.5 * model.diameter_at(mesh.points + history.displacement[0])
    values = {"radius at mid-span, inflated, mm": inflated}
    if history.cavity_volume is not None:
        values["volume, inflated, l"] = 1e-6 * float(history.cavity_volume[0])
    d, load = deflection_curve(model, history)
    stiffness = initial_stiffness(d, load, over)
    if stiffness is not None:
        values["initial stiffness, N/mm"] = stiffness
    values |= loads(model, history)
    knee = knee_point(d, load, stiffness, over)
    for name, point in (("knee", knee), ("limit", limit_point(d, load))):
        if point is not None:
            values[f"load at the {name} point, N"] = point[1]
    return values


STUDIED = Studied(
    steps=lambda model: (*model.inflation, *model.increments),
    quantities=quantities,
    responses=loads,
    response="load",
    curve=deflection_curve,
)
