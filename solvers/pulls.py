"""Pulls of a strip's grips, for solvers that cannot drive its gauge.

An equation for the gauge would put the force at its nodes. Grips that are the gauge are driven as
in the model. Others follow the path on which the membrane opens the gauge under the same law (or an
even stretch, run once to correct it). The solver's own gauge then differs a little, and its results
are interpolated to the model's elongations.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw
from ..meshes.strip_models import UniaxialModel
from .membrane.solver import MembraneSolver

log = logging.getLogger(__name__)

Array = NDArray[np.float64]
#: How much further than expected the grips go, so that the gauge reaches its length for sure.
BEYOND = 1.02
#: mm of elongation over mm of gauge below which a gauge is as long as it should be.
AS_WANTED = 1e-9


def grip_pulls(
    model: UniaxialModel, law: HypoelasticLaw, opened: Callable[[Array], Array], solver: str
) -> tuple[Array, bool]:
    """Return pulls (increments,) mm of the solver's grips, and whether they are the gauge.

    opened : runs the strip at given pulls and returns how far its gauge opened, (increments,) mm.

    Raises SolverFailure : that run did not end well, or its gauge gets shorter.
    """
    driven = direct(model)
    if driven is not None:
        return driven, True
    pulls = as_the_membrane(model, law)
    if pulls is None:
        # As if the whole strip stretched as the gauge does.
        length = float(np.ptp(model.mesh.points[:, 1]))
        even = np.array(model.elongations) * length / model.gauge_length
        pulls = corrected(model, even, opened(even), solver)
    return pulls, False


def direct(model: UniaxialModel) -> Array | None:
    """Return the pulls when the gauge lies between the grips themselves, along the pull."""
    lower, upper = (3 * node + np.arange(3) for node in model.mesh.node_sets["gauge"])
    held = np.isin(np.concatenate([lower[[0, 2]], upper]), model.fixed).all()
    ends = model.mesh.points[model.mesh.node_sets["gauge"]]
    along = ends[0, 0] == ends[1, 0] and ends[0, 1] < ends[1, 1]
    if held and along and lower[1] in model.driven:
        return np.array(model.elongations)
    return None


def as_the_membrane(model: UniaxialModel, law: HypoelasticLaw) -> Array | None:
    """Return pulls (increments + 1,) on which the membrane opens the gauge; None where it fails."""
    try:
        history = MembraneSolver().run(model, law)
    except SolverFailure as failure:
        log.info("grips are pulled evenly first: %s", failure)
        return None
    return _onward(-history.displacement[:, model.mesh.node_sets[model.pulled][0], 1])


def corrected(model: UniaxialModel, pulls: Array, opened: Array, solver: str) -> Array:
    """Return pulls (increments + 1,) at which the gauge of a first run was as it should be.

    They go on beyond its end as steeply as there. pulls, opened : (increments,) mm, of the first
    run and of its gauge.
    """
    gauge, pull = np.insert(opened, 0, 0.0), np.insert(pulls, 0, 0.0)
    if not (np.diff(gauge) > 0).all():
        raise SolverFailure("the gauge gets shorter while the grips move apart", solver)
    levels = np.array(model.elongations)
    steep = (pull[-1] - pull[-2]) / (gauge[-1] - gauge[-2])
    inside = CubicSpline(gauge, pull)(np.minimum(levels, gauge[-1]))
    found = inside + steep * np.maximum(levels - gauge[-1], 0.0)
    return _onward(found)


def at_elongations(opened: Array, model: UniaxialModel, values: Array, solver: str) -> Array:
    """Return `values` (increments of the run, ...) at the model's elongations, by a cubic spline.

    The increments of the run lie near the model's, so that it bridges next to nothing. opened :
    (increments of the run,) mm, elongation of the gauge.

    Raises SolverFailure : the gauge does not reach its length, or gets shorter on the way.
    """
    levels, gauge = np.array(model.elongations), np.insert(opened, 0, 0.0)
    if len(opened) == len(levels) and (
        np.abs(opened - levels).max() <= AS_WANTED * model.gauge_length
    ):
        return values
    if gauge[-1] < levels[-1]:
        problem = (
            f"the gauge opened by {gauge[-1]:.5g} mm only and not by {levels[-1]:.5g}; "
            "refine the mesh, or see whether the law gets too soft between gauge and grips"
        )
        raise SolverFailure(problem, solver)
    if not (np.diff(gauge) > 0).all():
        raise SolverFailure("the gauge gets shorter while the grips move apart", solver)
    whole = np.concatenate([np.zeros((1, *values.shape[1:])), values])
    return np.asarray(CubicSpline(gauge, whole)(levels))


def _onward(pulls: Array) -> Array:
    return np.append(pulls, BEYOND * pulls[-1])
