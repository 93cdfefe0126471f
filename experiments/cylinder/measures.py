"""Evaluate one run of a bent cylinder: stiffness, knee, wrinkles, strains, error, braid."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel, BraidedWall
from ...meshes.mesh import Mesh, surface_strain
from ...readers.bending import BendingCurve, BendingError, model_error
from ...solvers.base import Array
from ...solvers.membrane.solver import MembraneSolver
from .curve import (
    CurvePoint,
    MeasuredComparison,
    against_measured,
    initial_stiffness,
    knee_point,
    limit_point,
    loads_at,
    straightness,
)
from .run import BendingRun, Model, deflections_of

#: Share of the surface, beyond that of the inflated state, above which the cylinder counts as
#: wrinkled. Where collar and supports press on it, up to 0.8 % wrinkle from the first millimetres
#: on, long before the tube wrinkles beside the collar.
WRINKLED_SHARE = 0.01

#: Log strains along warp and fill.
StrainPair = tuple[float, float]


@dataclass(frozen=True)
class BendingMeasures:
    """Results of one run that did not fail; None where the curve has no such value.

    Parameters
    ----------
    stiffness : float or None
        Initial stiffness, N/mm.
    loads : mapping of str to float or None
        Load, N, at each named place.
    knee, limit, wrinkles : CurvePoint or None
        Knee (where the slope has halved), limit point, and first frame with wrinkles.
    straightness : (float, float) or None
        R^2 and largest deviation of the first part of the curve, see `curve.straightness`.
    body_strain, anywhere_strain : (float, float)
        Largest log strains of inflation along warp and fill, see `inflation_strain`.
    pressure_rise : float
        Rise of the gas pressure from the first to the last frame, kPa.
    reached : float
        Largest deflection, mm.
    error : BendingError or None
        Error of the load against measured readings.
    against : MeasuredComparison or None
        Comparison of properties with measured curves.
    """

    stiffness: float | None
    loads: Mapping[str, float | None]
    knee: CurvePoint | None
    limit: CurvePoint | None
    wrinkles: CurvePoint | None
    straightness: tuple[float, float] | None
    body_strain: StrainPair
    anywhere_strain: StrainPair
    pressure_rise: float
    reached: float
    error: BendingError | None
    against: MeasuredComparison | None = None

    def describe(self, point: CurvePoint | None) -> str:
        """Return in words the load and deflection of a point, or how far there is none."""
        if point is None:
            return f"none up to {self.reached:g} mm"
        deflection, load = point
        return f"{load:.0f} N, {deflection:.0f} mm"


def bending_measures(
    model: Model, run: BendingRun, measured: Sequence[BendingCurve]
) -> BendingMeasures:
    """Evaluate a run of a model, and compare it with measured repetitions."""
    d = run.deflection
    load = run.load
    over = model.reading.slope_over
    stiffness = initial_stiffness(d, load, over)
    knee = knee_point(d, load, stiffness, over)
    body, anywhere = inflation_strain(model.mesh, run.inflated)
    return BendingMeasures(
        stiffness=stiffness,
        loads=loads_at(d, load, model.reading.places),
        knee=knee,
        limit=limit_point(d, load),
        wrinkles=wrinkle_onset(run),
        straightness=straightness(d, load, knee.load if knee else float(load.max())),
        body_strain=body,
        anywhere_strain=anywhere,
        pressure_rise=1e3 * float(run.pressure[-1] - run.pressure[0]),
        reached=float(d[-1]),
        error=model_error(measured, d, load),
        against=against_measured(model.reading, d, load, measured),
    )


def wrinkle_onset(run: BendingRun) -> CurvePoint | None:
    """Return the first frame in which more of the surface is wrinkled than when inflated."""
    if not len(run.wrinkled):
        return None
    frames = np.flatnonzero(run.wrinkled > run.wrinkled[0] + WRINKLED_SHARE)
    if not len(frames):
        return None
    return CurvePoint(float(run.deflection[frames[0]]), float(run.load[frames[0]]))


def inflation_strain(mesh: Mesh, inflated: Array) -> tuple[StrainPair, StrainPair]:
    """Return the largest strains of the inflated tube along warp and fill.

    Parameters
    ----------
    mesh : Mesh
        With element sets `body`, and `seam` and `caps` where there are any.
    inflated : (nodes, 3) array
        Displacement of the inflated tube, mm.

    Returns
    -------
    body, anywhere : (float, float)
        Largest log strains along warp and fill: of the quads that touch neither seam nor caps, and
        of the whole tube.
    """
    strain = surface_strain(mesh, inflated)[:, :2]
    excluded_nodes = np.zeros(len(mesh.points), dtype=bool)
    for name in ("seam", "caps"):
        if name in mesh.element_sets:
            excluded_nodes[mesh.quads[mesh.element_sets[name]]] = True
    body = mesh.element_sets["body"]
    free = body[~excluded_nodes[mesh.quads[body]].any(axis=1)]
    tube = np.concatenate([body, mesh.element_sets.get("seam", body[:0])])

    def largest(quads: NDArray[np.intp]) -> StrainPair:
        """Return the largest strains of quads with these numbers (n,)."""
        warp, fill = strain[quads].max(axis=0)
        return float(warp), float(fill)

    return largest(free if len(free) else body), largest(tube)


#: Angle from the axis, in degrees, at which a braid carries all of the axial force of the pressure,
#: and none is left to cords.
NEUTRAL_ANGLE = math.degrees(math.atan(math.sqrt(2.0)))
#: Difference from this angle, in degrees, up to which a small error of the angle matters.
SENSITIVE_RANGE = 3.3
#: A small error of a measured angle, in degrees.
ANGLE_ERROR = 0.5
#: Law that a solver asks for. The model does not use it: wall and cords have their own stiffness.
UNUSED_LAW = HypoelasticLaw.linear(1.0, 1.0, 1.0)


def is_near_neutral(model: object) -> bool:
    """Return whether a model is a braided tube with an angle near `NEUTRAL_ANGLE`."""
    if not isinstance(model, BeamModel) or not isinstance(model.section.wall, BraidedWall):
        return False
    return abs(model.section.wall.angle - NEUTRAL_ANGLE) < SENSITIVE_RANGE


def angle_sensitivity(model: BeamModel, load: np.ndarray, places: Mapping[str, float]) -> str:
    """Describe by how much half a degree of the braid's angle changes the load.

    Parameters
    ----------
    model : BeamModel
        Tube with a braid near `NEUTRAL_ANGLE`.
    load : (frames,) array
        Load of the model, N, from the inflated tube on.
    places : mapping of str to float
        Deflections by name, mm; the load is compared at the last one that is reached.

    Returns
    -------
    str
        A sentence without its first capital letter and full stop.
    """
    wall = model.section.wall
    assert isinstance(wall, BraidedWall)
    begin = (
        f"the braid's {wall.angle:g} degrees are near {NEUTRAL_ANGLE:.1f}, where it leaves no "
        "thrust to the cords"
    )
    reached = {n: f for n, f in loads_at(deflections_of(model, load), load, places).items() if f}
    if not reached:
        return f"{begin}: the load depends much on the angle"
    place = list(reached)[-1]
    effects = []
    for error, words in ((-ANGLE_ERROR, "less"), (ANGLE_ERROR, "more")):
        changed_load = _load_at(model, wall.angle + error, {place: places[place]})
        effect = "leaves no equilibrium"
        if changed_load is not None:
            change = 100 * (changed_load / reached[place] - 1)
            effect = f"changes the load at {place} by {change:+.0f} %"
        effects.append(f"half a degree {words} {effect}")
    return f"{begin}: {', '.join(effects)}; measure the angle"


def _load_at(model: BeamModel, angle: float, places: Mapping[str, float]) -> float | None:
    """Return the load (N) with another braid angle (degrees); None without an equilibrium."""
    assert isinstance(model.section.wall, BraidedWall)
    try:
        section = replace(model.section, wall=replace(model.section.wall, angle=angle))
        load = MembraneSolver().run(replace(model, section=section), UNUSED_LAW).load
    except (InputError, SolverFailure):
        return None
    assert load is not None
    return next(iter(loads_at(deflections_of(model, load), load, places).values()))
