"""From the result file of a strip to its `History`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...models.uniaxial import UniaxialModel
from ..base import History
from ..pulls import at_elongations
from ..strains import extremes, log_strain
from .results import whole_times
from .shells import ShellMesh

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StripRun:
    """Increment by increment of the pull: elongation of the gauge (n,) mm, displacement and nodal
    force (n, nodes of the shells, 3) mm and N."""

    gauge: Array
    displacement: Array
    force: Array


def strip_run(path: Path, model: UniaxialModel, shells: ShellMesh, count: int) -> StripRun:
    """The `count` increments of a .frd file.

    Raises
    ------
    SolverFailure : the file is not there, damaged, or does not hold every increment.
    """
    u, force = whole_times(path, count, len(shells.points))
    lower, upper = (shells.points[n] + u[:, n] for n in model.mesh.node_sets["gauge"])
    return StripRun(np.linalg.norm(upper - lower, axis=1) - model.gauge_length, u, force)


def strip_history(
    run: StripRun, model: UniaxialModel, shells: ShellMesh, iterations: int
) -> History:
    """Load, displacement and reactions where the gauge has the model's elongations.

    Raises
    ------
    SolverFailure : the gauge does not reach its length, or gets shorter on the way.
    """

    def at_levels(values: Array) -> Array:
        return at_elongations(run.gauge, model, values, "calculix")

    corners = np.ascontiguousarray(at_levels(run.displacement[:, : shells.corners]))
    strain = log_strain(model.mesh, corners, model.warp)
    low, high = extremes(strain)
    # What a support gives is what CalculiX calls the force of its nodes: the inner one.
    sums = {
        name: at_levels(run.force[:, shells.node_sets[name]].sum(axis=1))
        for name in (*model.supports, model.pulled)
    }
    load = -model.load_factor * sums[model.pulled][:, 1]
    return History(load, corners, low, high, sums, iterations=iterations, path=corners)
