"""Evaluate one run of a bent cylinder: its load curve, wrinkles, strains, error, and its braid.

The curve of load over deflection has a stiffness, a knee and a limit point, which are compared with
measured curves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...lazy_modules import LazyFunction
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel, BraidedWall
from ...meshes.cylinder_model import CurveReading, CylinderModel
from ...meshes.mesh import Mesh, surface_strain
from ...readers.bending import BendingCurve, BendingError, model_error
from ...solvers.base import Array, History
from ..forward import RunRecord

#: Relative difference of deflections up to which they count as equal.
ROUNDING = 1e-9


@dataclass(frozen=True)
class CurveCriteria:
    """Criteria that define stiffness, knee, limit point and straightness of a curve."""

    stiffness_frames: int = 3  # least number of frames whose slope is the initial stiffness
    knee_slope: float = 0.5  # slope at the knee over the stiffness
    knee_positions: int = 20  # number of slopes in each stretch of deflection `slope_over`
    limit_fall: float = 0.005  # least fall of the load after a limit point, over the largest load
    straight_share: float = 0.5  # load up to which straightness counts, over that at the knee
    #: Shares of the reference load between which the secant stiffness is taken to compare with
    #: measured curves, whose first newtons are friction of rig and wall.
    secant_from: float = 0.1
    secant_to: float = 0.35


CRITERIA = CurveCriteria()
#: Properties, besides loads, that are compared with measured curves. They differ from stiffness and
#: knee of `BendingMeasures`, which count from zero load.
CURVE_PROPERTIES = ("secant stiffness", "secant knee", "limit point")


class CurvePoint(NamedTuple):
    """A point of a curve: deflection in mm, load in N."""

    deflection: float
    load: float


def initial_stiffness(d: Array, load: Array, over: float) -> float | None:
    """Return the slope of the straight line through the first frames.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    over : float
        Deflection up to which frames count, mm; at least three frames count.

    Returns
    -------
    float or None
        Stiffness, N/mm; None for a single frame.
    """
    count = max(int((d <= over * (1 + ROUNDING)).sum()), CRITERIA.stiffness_frames)
    if len(d) < 2:
        return None
    return float(np.polyfit(d[:count], load[:count], 1)[0])


def secant_stiffness(d: Array, load: Array, reference: float) -> float | None:
    """Return the slope of the curve between two shares of a reference load (`CurveCriteria`).

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    reference : float
        Deflection, mm, whose load is the reference load.

    Returns
    -------
    float or None
        Secant stiffness, N/mm; None where the load does not rise.
    """
    reference_load = float(np.interp(reference, d, load))
    rising = np.maximum.accumulate(load)
    shares = CRITERIA.secant_from, CRITERIA.secant_to
    low, high = (float(np.interp(share * reference_load, rising, d)) for share in shares)
    if not (reference_load > 0 and high > low):
        return None
    return (CRITERIA.secant_to - CRITERIA.secant_from) * reference_load / (high - low)


def knee_point(
    d: Array,
    load: Array,
    stiffness: float | None,
    over: float,
) -> CurvePoint | None:
    """Return the knee of a curve: the first point where its slope is half of a stiffness.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    stiffness : float or None
        Stiffness that the slope is compared with, N/mm.
    over : float
        Length of deflection over which a slope is taken, mm.

    Returns
    -------
    CurvePoint or None
        None where the slope does not fall so far, without a positive stiffness, or where the curve
        is shorter than twice `over`.
    """
    half = 0.5 * over
    if stiffness is None or not stiffness > 0 or d[-1] < 2 * over:
        return None
    count = round(CRITERIA.knee_positions * (d[-1] / over - 1)) + 1
    positions = np.linspace(half, d[-1] - half, max(2, count))
    slope = (np.interp(positions + half, d, load) - np.interp(positions - half, d, load)) / over
    knee_slope = CRITERIA.knee_slope * stiffness
    softer = np.flatnonzero(slope <= knee_slope)
    if not len(softer):
        return None
    i = int(softer[0])
    deflection = float(positions[i])
    if i:
        share = (slope[i - 1] - knee_slope) / (slope[i - 1] - slope[i])
        deflection = float(positions[i - 1] + share * (positions[i] - positions[i - 1]))
    return CurvePoint(deflection, float(np.interp(deflection, d, load)))


def limit_point(d: Array, load: Array) -> CurvePoint | None:
    """Return the limit point: that of the largest load if the load falls after it, else None.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    """
    top = int(np.argmax(load))
    if not load[top:].min() < (1 - CRITERIA.limit_fall) * load[top]:
        return None
    return CurvePoint(float(d[top]), float(load[top]))


def loads_at(d: Array, load: Array, places: Mapping[str, float]) -> dict[str, float | None]:
    """Return the load (N) at named deflections; None at those not reached.

    Parameters
    ----------
    d : (n,) array, mm
        Deflections of the curve, from the unloaded tube.
    load : (n,) array, N
    places : mapping of str to float, mm
        The deflections by name.
    """
    end = d[-1] * (1 + ROUNDING)
    return {
        name: float(np.interp(place, d, load)) if place <= end else None
        for name, place in places.items()
    }


def straightness(d: Array, load: Array, knee_load: float) -> tuple[float, float] | None:
    """Return how straight a curve is up to half of the load at its knee.

    Parameters
    ----------
    d, load : (frames,) arrays
        Deflection in mm, load in N.
    knee_load : float
        Load at the knee, or the largest load, N.

    Returns
    -------
    r_squared, largest_deviation : float
        R^2 of a straight line through the frames up to that load, and their largest deviation from
        it over their last load. None is returned for fewer than four frames.
    """
    higher_frames = np.flatnonzero(load > CRITERIA.straight_share * knee_load)
    count = int(higher_frames[0]) if len(higher_frames) else len(d)
    if count < CRITERIA.stiffness_frames + 1:
        return None
    x = d[:count]
    y = load[:count]
    deviation = y - np.polyval(np.polyfit(x, y, 1), x)
    total = float(((y - y.mean()) ** 2).sum())
    if not total > 0:
        return None
    r_squared = 1.0 - float((deviation**2).sum()) / total
    return r_squared, float(np.abs(deviation).max() / y[-1])


@dataclass(frozen=True)
class MeasuredComparison:
    """Properties of a predicted curve beside the mean of those of the measured repetitions.

    Parameters
    ----------
    reference : float
        Deflection, mm, whose load is the reference load of the secant stiffness.
    pairs : mapping of str to (float, float) or None
        Predicted and measured value of the secant stiffness (N/mm), and of the loads (N) at the
        secant knee (where the slope is half of that stiffness), at the limit point, and at each
        place ("load at PLACE"). None where any of the curves has no such value.
    """

    reference: float
    pairs: Mapping[str, tuple[float, float] | None]

    @property
    def ratios(self) -> Mapping[str, float | None]:
        """Return predicted over measured value of each property."""
        return {name: pair and pair[0] / pair[1] for name, pair in self.pairs.items()}


def against_measured(
    reading: CurveReading,
    d: Array,
    load: Array,
    measured: Sequence[BendingCurve],
) -> MeasuredComparison | None:
    """Compare a predicted curve with measured repetitions, property by property.

    Parameters
    ----------
    reading : CurveReading
        Deflections at which loads are compared, and the length over which slopes are taken.
    d, load : (frames,) arrays
        Predicted deflection in mm and load in N.
    measured : sequence of BendingCurve
        Measured repetitions; without any, None is returned.
    """
    if not measured:
        return None
    curves = [(d, load), *((c.deflection, c.load) for c in measured)]
    reached = min(float(x[-1]) for x, _ in curves)
    labelled = {f"load at {name}": place for name, place in reading.places.items()}
    places = {n: place for n, place in labelled.items() if place <= reached * (1 + ROUNDING)}
    reference = max(places.values(), default=reached)
    predicted, *repetitions = (
        _compared_values(x, y, reference, reading.slope_over) | loads_at(x, y, places)
        for x, y in curves
    )
    pairs: dict[str, tuple[float, float] | None] = dict.fromkeys([*CURVE_PROPERTIES, *labelled])
    for name, value in predicted.items():
        pairs[name] = _predicted_and_mean(value, [values[name] for values in repetitions])
    return MeasuredComparison(reference, pairs)


def _predicted_and_mean(
    predicted: float | None, measured: Sequence[float | None]
) -> tuple[float, float] | None:
    """Return a predicted value and the mean of the measured ones; None where one is missing."""
    readings = [value for value in measured if value is not None]
    if predicted is None or len(readings) < len(measured):
        return None
    return predicted, float(np.mean(readings))


def _compared_values(
    d: Array,
    load: Array,
    reference: float,
    slope_over: float,
) -> dict[str, float | None]:
    """Return the values of `CURVE_PROPERTIES` of one curve, by name.

    Parameters
    ----------
    d, load : (n,) array
        Deflections (mm) and loads (N) of the curve.
    reference : float, mm
        Deflection to which the secant stiffness is taken.
    slope_over : float, mm
        Range of deflections over which slopes are taken.
    """
    stiffness = secant_stiffness(d, load, reference)
    knee = knee_point(d, load, stiffness, slope_over)
    limit = limit_point(d, load)
    values = stiffness, knee and knee.load, limit and limit.load
    return dict(zip(CURVE_PROPERTIES, values, strict=True))


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
#: Solver of a braid near the neutral angle; no other test imports it when it is read.
membrane_solver = LazyFunction("bubblefit.solvers.membrane.solver", "MembraneSolver")


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
        load = membrane_solver().run(replace(model, section=section), UNUSED_LAW).load
    except (InputError, SolverFailure):
        return None
    assert load is not None
    return next(iter(loads_at(deflections_of(model, load), load, places).values()))
