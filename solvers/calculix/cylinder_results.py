"""From the result file of a cylinder to its `History`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...meshes.volume import enclosed_volume
from ...models.cylinder import CylinderModel
from ..base import History
from .results import extremes, log_strain, whole_times
from .solids import SolidMesh

Array = NDArray[np.float64]


def inflation_history(
    path: Path, model: CylinderModel, solids: SolidMesh, iterations: int
) -> History:
    """Inflation of a cylinder: a frame at every increment of pressure, `load` the gauge pressure.

    Displacements are those of the middle surface; the volume is the whole cylinder's inside it.

    Raises
    ------
    SolverFailure : the file is not there, damaged, or does not hold every increment.
    """
    displacement, _ = whole_times(path, len(model.inflation), len(solids.points))
    middle = np.ascontiguousarray(solids.middle(displacement))
    mesh, pressure = model.mesh, np.array(model.inflation)
    volume = np.array([model.copies * enclosed_volume(mesh.points + u, mesh.quads) for u in middle])
    low, high = extremes(log_strain(mesh, middle, mesh.warp))
    return History(
        pressure,
        middle,
        low,
        high,
        cavity_pressure=pressure,
        cavity_volume=volume,
        iterations=iterations,
        path=middle,
    )
