"""From the result file of a strip to its `History`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ...errors import SolverFailure
from ...models.uniaxial import UniaxialModel
from ..base import History
from .results import extremes, log_strain, whole_times
from .shells import ShellMesh

Array = NDArray[np.float64]
#: mm of elongation over mm of gauge below which a gauge is as long as it should be.
AS_WANTED = 1e-9


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
    corners = np.ascontiguousarray(
        at_elongations(run, model, run.displacement[:, : shells.corners])
    )
    strain = log_strain(model.mesh, corners, model.warp)
    low, high = extremes(strain)
    # What a support gives is what CalculiX calls the force of its nodes: the inner one.
    sums = {
        name: at_elongations(run, model, run.force[:, shells.node_sets[name]].sum(axis=1))
        for name in (*model.supports, model.pulled)
    }
    load = -model.load_factor * sums[model.pulled][:, 1]
    return History(load, corners, low, high, sums, iterations=iterations, path=corners)


def at_elongations(run: StripRun, model: UniaxialModel, values: Array) -> Array:
    """`values` (increments of the run, ...) at the model's elongations, by a cubic spline.

    The increments of the run lie near the model's, so that it bridges next to nothing.
    """
    levels, gauge = np.array(model.elongations), np.insert(run.gauge, 0, 0.0)
    if len(run.gauge) == len(levels) and (
        np.abs(run.gauge - levels).max() <= AS_WANTED * model.gauge_length
    ):
        return values
    if gauge[-1] < levels[-1]:
        problem = (
            f"the gauge opened by {gauge[-1]:.5g} mm only and not by {levels[-1]:.5g}; "
            "refine the mesh, or see whether the law gets too soft between gauge and grips"
        )
        raise SolverFailure(problem, "calculix")
    if not (np.diff(gauge) > 0).all():
        raise SolverFailure("the gauge gets shorter while the grips move apart", "calculix")
    whole = np.concatenate([np.zeros((1, *values.shape[1:])), values])
    return np.asarray(CubicSpline(gauge, whole)(levels))
