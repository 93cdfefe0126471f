"""Runs of cylinders with cards: the arrays that are stored, and the numbers of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure, marks
from ...files import pandas as pd
from ...materials.card import BAND
from ...meshes.beam_model import BeamModel
from ...meshes.cylinder_model import CurveReading, CylinderModel
from ...meshes.mesh import Mesh, surface_strain
from ...readers.bending import BendingCurve, BendingError, model_error, scatter
from ...solvers.base import BandEnd, History
from ..kinds import STRAINS, Array, PredictedRun, RunRecord, Studied, band_of
from .test import CylinderTest


@dataclass(frozen=True, eq=False)
class BendingRun:
    """A run that did not fail; frame 0 is the inflated cylinder.

    deflection, load, pressure, volume : (frames,) mm, N, MPa, mm^3, of the whole cylinder.
    inflated, bent : (nodes, 3) mm at the first and last frame. wrinkled : (frames,) share of the
    surface, or empty.
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


def arrays_of(model: CylinderModel | BeamModel, history: History) -> Mapping[str, Array]:
    """Return the arrays of a history that are stored, by the names of `BendingRun`.

    Raises SolverFailure: no gas; fewer frames than asked for without the solver's reason.
    """
    deflection = np.array([0.0, *model.deflections])
    reached = len(history.load)
    if reached < len(deflection) and not history.early:
        where = f"at {deflection[reached - 1]:g} of {deflection[-1]:g} mm"
        raise SolverFailure(f"the results end {where}, and do not say why", "")
    if history.cavity_pressure is None or history.cavity_volume is None:
        raise SolverFailure("the results have no gas pressure or no volume", "")
    share = () if history.wrinkled is None else history.wrinkled
    curves = (history.load, history.cavity_pressure, history.cavity_volume, share)
    *known, wrinkled = (np.asarray(curve, dtype=float) for curve in curves)
    ends = history.displacement[0], history.displacement[-1]
    values = (deflection[:reached], *known, *ends, wrinkled)
    return dict(zip((field.name for field in fields(BendingRun)), values, strict=True))


#: The initial stiffness is that of a straight line through at least so many frames.
FEWEST = 3
#: The knee: where the slope has fallen to this part of the initial stiffness.
KNEE = 0.5
#: Places in each such stretch at which the slope is looked at.
STEPS = 20
#: A limit point: the load falls by more than this part of it afterwards.
FALL = 0.005
#: Wrinkled beyond the inflated state: share of the surface. The bodies press up to 0.8 % together
#: where they touch, from the first millimetres on, long before the beam wrinkles beside the collar.
ONSET = 0.01
#: The curve is compared with a straight line up to this part of the load at the knee.
STRAIGHT = 0.5

Point = tuple[float, float]  # deflection in mm and load in N


#: Shares of the reference load between which stiffness is compared with measured curves: their
#: first newtons are friction of rig and wall.
SECANT = (0.1, 0.35)
#: What is compared with measured curves beside loads; none of it is the stiffness or the knee of
#: `BendingMeasures`, which begin at zero load.
CURVE_PROPERTIES = ("secant stiffness", "secant knee", "limit point")


@dataclass(frozen=True)
class Against:
    """A run beside the mean of the measured repetitions: (predicted, measured), or None.

    pairs : "secant stiffness" (N/mm, between `SECANT` of the load at the `reference` deflection,
    mm, of each curve), "secant knee" (N, where the slope is half of that), "limit point" and
    "load at PLACE" (N).
    """

    reference: float
    pairs: Mapping[str, tuple[float, float] | None]

    @property
    def ratios(self) -> Mapping[str, float | None]:
        """Return predicted over measured by quantity."""
        return {name: pair and pair[0] / pair[1] for name, pair in self.pairs.items()}


def against_measured(
    reading: CurveReading, d: Array, load: Array, measured: Sequence[BendingCurve]
) -> Against | None:
    """Return a curve beside what was measured; None without repetitions."""
    if not measured:
        return None
    curves = [(d, load), *((c.deflection, c.load) for c in measured)]
    reached = min(float(x[-1]) for x, _ in curves)
    every = {f"load at {n}": p for n, p in reading.places.items()}
    places = {n: p for n, p in every.items() if p <= reached * (1 + 1e-9)}
    reference = max(places.values(), default=reached)
    rows = []
    for x, y in curves:
        stiffness = secant_stiffness(x, y, reference)
        knee, limit = knee_point(x, y, stiffness, reading.slope_over), limit_point(x, y)
        values = stiffness, knee and knee[1], limit and limit[1]
        rows.append({**dict(zip(CURVE_PROPERTIES, values, strict=True)), **loads_at(x, y, places)})
    pairs: dict[str, tuple[float, float] | None] = dict.fromkeys([*CURVE_PROPERTIES, *every])
    for name in rows[0]:
        own, *others = (row[name] for row in rows)
        known = [value for value in others if value is not None]
        whole = own is not None and len(known) == len(others)
        pairs[name] = (float(own or 0.0), float(np.mean(known))) if whole else None
    return Against(reference, pairs)


def secant_stiffness(d: Array, load: Array, reference: float) -> float | None:
    """Return the slope (N/mm) between `SECANT` of the load at a deflection (mm); None: no rise."""
    top = float(np.interp(reference, d, load))
    rising = np.maximum.accumulate(load)
    low, high = (float(np.interp(share * top, rising, d)) for share in SECANT)
    return (SECANT[1] - SECANT[0]) * top / (high - low) if top > 0 and high > low else None


@dataclass(frozen=True)
class BendingMeasures:
    """Numbers of one run that ended; None where unknown.

    stiffness : N/mm. loads : N by place. knee, limit, wrinkles : where the slope has halved, of the
    largest load before a fall, where wrinkles appear. straightness : see `straightness`.
    body_strain, anywhere_strain : see `inflation_strain`. pressure_rise : kPa. reached : mm.
    """

    stiffness: float | None
    loads: Mapping[str, float | None]
    knee: Point | None
    limit: Point | None
    wrinkles: Point | None
    straightness: tuple[float, float] | None
    body_strain: tuple[float, float]
    anywhere_strain: tuple[float, float]
    pressure_rise: float
    reached: float
    error: BendingError | None
    against: Against | None = None

    def describe(self, point: Point | None) -> str:
        """Return load and deflection of a knee or limit point, or up to where there is none."""
        if point is None:
            return f"none up to {self.reached:g} mm"
        deflection, load = point
        return f"{load:.0f} N, {deflection:.0f} mm"


def bending_measures(
    model: CylinderModel | BeamModel, run: BendingRun, measured: Sequence[BendingCurve]
) -> BendingMeasures:
    """Return the numbers of a run of a model, beside what was measured."""
    d, load, over = run.deflection, run.load, model.reading.slope_over
    stiffness = initial_stiffness(d, load, over)
    knee = knee_point(d, load, stiffness, over)
    body, anywhere = inflation_strain(model.mesh, run.inflated)
    return BendingMeasures(
        stiffness=stiffness,
        loads=loads_at(d, load, model.reading.places),
        knee=knee,
        limit=limit_point(d, load),
        wrinkles=wrinkle_onset(run),
        straightness=straightness(d, load, knee[1] if knee else float(load.max())),
        body_strain=body,
        anywhere_strain=anywhere,
        pressure_rise=1e3 * float(run.pressure[-1] - run.pressure[0]),
        reached=float(d[-1]),
        error=model_error(measured, d, load),
        against=against_measured(model.reading, d, load, measured),
    )


def loads_at(d: Array, load: Array, places: Mapping[str, float]) -> dict[str, float | None]:
    """Return the load (N) at places (mm) by name; None at those not reached."""
    end = d[-1] * (1 + 1e-9)
    return {n: float(np.interp(p, d, load)) if p <= end else None for n, p in places.items()}


def initial_stiffness(d: Array, load: Array, over: float) -> float | None:
    """Return the slope (N/mm) of the straight line through the frames up to `over` mm."""
    count = max(int((d <= over * (1 + 1e-9)).sum()), FEWEST)
    if len(d) < 2:
        return None
    return float(np.polyfit(d[:count], load[:count], 1)[0])


def knee_point(d: Array, load: Array, stiffness: float | None, over: float) -> Point | None:
    """Return the point where the slope over `over` mm first is `KNEE` of the initial one."""
    half = 0.5 * over
    if stiffness is None or not stiffness > 0 or d[-1] < 2 * over:
        return None
    at = np.linspace(half, d[-1] - half, max(2, round(STEPS * (d[-1] / over - 1)) + 1))
    slope = (np.interp(at + half, d, load) - np.interp(at - half, d, load)) / over
    below = np.flatnonzero(slope <= KNEE * stiffness)
    if not len(below):
        return None
    i = int(below[0])
    place = float(at[i])
    if i:  # between the two places where it is above and below
        share = (slope[i - 1] - KNEE * stiffness) / (slope[i - 1] - slope[i])
        place = float(at[i - 1] + share * (at[i] - at[i - 1]))
    return place, float(np.interp(place, d, load))


def limit_point(d: Array, load: Array) -> Point | None:
    """Return the largest load, where the load falls afterwards."""
    top = int(np.argmax(load))
    falls = load[top:].min() < (1 - FALL) * load[top]
    return (float(d[top]), float(load[top])) if falls else None


def wrinkle_onset(run: BendingRun) -> Point | None:
    """Return the first frame in which more of the surface is wrinkled than when inflated."""
    if not len(run.wrinkled):
        return None
    more = np.flatnonzero(run.wrinkled > run.wrinkled[0] + ONSET)
    return (float(run.deflection[more[0]]), float(run.load[more[0]])) if len(more) else None


def straightness(d: Array, load: Array, knee: float) -> tuple[float, float] | None:
    """Return R^2 of a line up to `STRAIGHT` of a load; its largest error over its last load."""
    beyond = np.flatnonzero(load > STRAIGHT * knee)
    count = int(beyond[0]) if len(beyond) else len(d)
    if count < FEWEST + 1:
        return None
    x, y = d[:count], load[:count]
    off = y - np.polyval(np.polyfit(x, y, 1), x)
    total = float(((y - y.mean()) ** 2).sum())
    if not total > 0:
        return None
    return 1.0 - float((off**2).sum()) / total, float(np.abs(off).max() / y[-1])


def inflation_strain(mesh: Mesh, inflated: Array) -> tuple[Point, Point]:
    """Return largest (eps1, eps2) of the inflated tube: of quads off seam and caps, and of all."""
    strain = surface_strain(mesh, inflated)[:, :2]
    others = np.zeros(len(mesh.points), dtype=bool)
    for name in ("seam", "caps"):
        if name in mesh.element_sets:
            others[mesh.quads[mesh.element_sets[name]]] = True
    body = mesh.element_sets["body"]
    free = body[~others[mesh.quads[body]].any(axis=1)]
    tube = np.concatenate([body, mesh.element_sets.get("seam", body[:0])])

    def largest(quads: NDArray[np.intp]) -> Point:
        found = strain[quads].max(axis=0)
        return float(found[0]), float(found[1])

    return largest(free if len(free) else body), largest(tube)


CURVE = ("deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3", "wrinkled_share")


def measured_table(tests: Sequence[CylinderTest]) -> pd.DataFrame:
    """Return mean and scatter of the repetitions on a grid; one test at least was measured."""
    parts = []
    for test in tests:
        if test.measured:
            s = scatter(test.measured)
            columns = {"test": test.name, "deflection_mm": s.deflection, "mean_N": s.mean}
            columns |= {"standard_deviation_N": s.deviation, "repetitions": s.count}
            parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def place_names(tests: Iterable[CylinderTest]) -> list[str]:
    """Return the places of listed loads in all tests, each once."""
    return list(dict.fromkeys(name for test in tests for name in test.reading.places))


def load_words(load: float | None, sigma: float | None, unit: str = "") -> str:
    """Return a load (N), with one standard deviation where it is known."""
    if load is None:
        return "-"
    return f"{load:.0f}{unit}" if sigma is None else f"{load:.0f} ± {sigma:.2g}{unit}"


@dataclass(frozen=True, eq=False)
class CylinderOutcome:
    """Results of runs of cylinders with cards, in the order given."""

    runs: Sequence[PredictedRun]

    @cached_property
    def bent(self) -> Mapping[int, BendingRun]:
        """Return the runs that did not fail, by number."""
        found = {i: run_of(run.record) for i, run in enumerate(self.runs)}
        return {i: run for i, run in found.items() if run is not None}

    @cached_property
    def measures(self) -> Mapping[int, BendingMeasures]:
        return {
            i: bending_measures(self.runs[i].model, run, self.runs[i].test.measured)
            for i, run in self.bent.items()
        }

    @cached_property
    def band(self) -> Sequence[BandEnd]:
        """Return the ends of the band that the solver gives, first what is predicted; or none."""
        return band_of(self.runs)

    def other_end(self, number: int) -> int | None:
        """Return the number of the other end of the band of a run, if it did not fail."""
        own = self.runs[number].test, self.runs[number].card, False
        ended = ((i, self.runs[i]) for i in self.bent)
        return next((i for i, run in ended if (run.test, run.card, run.predicted) == own), None)

    @cached_property
    def spreads(self) -> Mapping[int, Array]:
        """Return the standard deviations (frames,) N of the load due to the card, by number."""
        found = {}
        for i, bent in self.bent.items():
            if (around := self.runs[i].around) is not None:
                others = [run_of(record) for record in around.records]
                found[i] = around.sigma(bent.load, [o.load if o else None for o in others])
        return found

    def sigma(
        self, number: int, places: Mapping[str, float] | None = None
    ) -> dict[str, float | None]:
        """Return the standard deviation (N) of the load at places, the test's; None if unknown."""
        if number not in self.spreads:
            return dict.fromkeys(places or self.measures[number].loads)
        places = places or self.runs[number].test.reading.places
        known = loads_at(self.bent[number].deflection, self.spreads[number], places)
        return {n: v if v is not None and np.isfinite(v) else None for n, v in known.items()}

    def measured(self, number: int, name: str) -> tuple[float, float, float] | None:
        """Return the stiffness (N/mm), or the load at knee or limit (N), with its band's ends.

        The band holds both walls, and what the card leaves open of the load at that deflection.
        """
        own = self.measures.get(number)
        value = None if own is None else getattr(own, name)
        if own is None or value is None:
            return None
        over = self.runs[number].test.reading.slope_over
        at, size = (over, value) if name == "stiffness" else value
        sigma = self.sigma(number, {"": at})[""] or 0.0
        off = BAND * sigma / (over if name == "stiffness" else 1.0)
        ends = [size - off, size + off]
        other = self.other_end(number)
        beside = None if other is None else getattr(self.measures[other], name)
        if beside is not None:
            end = beside if name == "stiffness" else beside[1]
            ends += [end - off, end + off]
        return size, min(ends), max(ends)

    @property
    def unsure(self) -> Sequence[str]:
        """Return notes on cards of unknown spread."""
        cards = dict.fromkeys(run.card for run in self.runs if run.material.certainty is None)
        words = f"no spread of loads with {', '.join(cards)}: the card does not say how sure it is"
        return [words] if cards else []

    def ended(self, number: int) -> str:
        """Return how a run ended: "finished", how far it came, or why it failed."""
        record = self.runs[number].record
        if record.failure:
            return f"failed: {record.failure}"
        if not record.early:
            return "finished"
        whole, reached = self.runs[number].test.deflections[-1], self.bent[number].deflection[-1]
        return f"stopped at {reached:g} of {whole:g} mm: {record.early}"

    def error(self, number: int) -> float | None:
        measures = self.measures.get(number)
        return None if measures is None or measures.error is None else measures.error.relative

    def numbers(self, number: int) -> Mapping[str, Any]:
        m = self.measures[number]
        around = self.runs[number].around if number in self.spreads else None
        return {
            "reached_mm": m.reached,
            "stiffness_N_per_mm": m.stiffness,
            "knee": _point(m.knee, m.reached),
            "limit_point": _point(m.limit, m.reached),
            "wrinkle_onset": _point(m.wrinkles, m.reached),
            "load_N": dict(m.loads),
            "load_sigma_N": self.sigma(number),
            "spread": None if around is None else around.words,
            "inflation_strain": {
                "body": dict(zip(STRAINS, m.body_strain, strict=False)),
                "with_seam_and_ends": dict(zip(STRAINS, m.anywhere_strain, strict=False)),
            },
            "straight_before_buckling": m.straightness
            and dict(zip(("r_squared", "largest_deviation"), m.straightness, strict=True)),
            "pressure_rise_kPa": m.pressure_rise,
            "error": None if m.error is None else asdict(m.error),
            **({} if m.against is None else {"against_measured": _against(m.against)}),
        }

    def columns(self, number: int) -> Mapping[str, object]:
        m = self.measures.get(number)
        row: dict[str, object] = {"stiffness_N_per_mm": m and m.stiffness}
        for name in ("knee", "limit", "wrinkles"):
            point = (getattr(m, name) if m else None) or (None, None)
            row |= {f"{name}_mm": point[0], f"{name}_N": point[1]}
        places = [p.replace(" ", "_") for p in self.runs[number].test.reading.places]
        loads = m.loads.values() if m else [None] * len(places)
        row |= {f"load_at_{p}_N": load for p, load in zip(places, loads, strict=True)}
        body, error = (m.body_strain, m.error) if m else ((None, None), None)
        row |= {
            "inflation_warp_strain": body[0],
            "inflation_fill_strain": body[1],
            "pressure_rise_kPa": m and m.pressure_rise,
            "rms_N": error and error.rms,
            "rms_relative": error and error.relative,
            "mean_error_N": error and error.mean,
            "compared": error and error.compared,
            "reached_mm": m and m.reached,
        }
        if m is not None and m.against is not None:
            ratios = m.against.ratios.items()
            row |= {f"{n.replace(' ', '_')}_over_measured": ratio for n, ratio in ratios}
        if number in self.spreads:
            sigma = zip(places, self.sigma(number).values(), strict=True)
            row |= {f"load_at_{p}_sigma_N": value for p, value in sigma}
        return row

    def curve(self, number: int) -> pd.DataFrame:
        run = self.bent.get(number)
        values = [np.empty(0)] * len(CURVE)
        if run is not None:
            share = run.wrinkled if len(run.wrinkled) else np.full(len(run.load), np.nan)
            values = [run.deflection, run.load, 1e3 * run.pressure, run.volume, share]
        curve = pd.DataFrame(dict(zip(CURVE, values, strict=True)))
        if number in self.spreads:
            curve["load_sigma_N"] = self.spreads[number]
        return curve

    def test_numbers(self, test: CylinderTest) -> Mapping[str, Any]:
        return {
            "diameter_mm": test.diameter,
            "pressure_kPa": 1e3 * test.pressure,
            "length_mm": test.length,
            "seam_width_mm": test.seam_width,
            "element_size_mm": test.size,
            "symmetry": test.symmetry,
            "supports": asdict(test.supports),
            "collar": asdict(test.collar),
            "places_mm": dict(test.reading.places),
            "slope_over_mm": test.reading.slope_over,
            "repetitions": len(test.measured),
        }

    def lines(self) -> Sequence[str]:
        """Return a table for the terminal: stiffness, knee, limit, loads, errors run by run."""
        runs, spreads = self.runs, self.spreads
        places = place_names(run.test for run in runs)
        widths = [max(len(p), 13 if spreads else 7) + 2 for p in places]
        compared = any(m.error is not None for m in self.measures.values())
        count = 3 if any(run.wall for run in runs) else 2
        rows = [("test", "card", "wall"), *((run.test.name, run.card, run.wall) for run in runs)]
        names = [row[:count] for row in rows]
        wide = [max(map(len, column)) for column in zip(*names, strict=True)]
        starts = ["  ".join(f"{n:<{w}}" for n, w in zip(row, wide, strict=True)) for row in names]
        points = {i: (m.describe(m.knee), m.describe(m.limit)) for i, m in self.measures.items()}
        columns = list(zip(("knee", "limit point"), *points.values(), strict=False))
        point_widths = [max(map(len, column)) + 2 for column in columns]
        head = f"{starts.pop(0)}   N/mm"
        head += "".join(f"{c[0]:>{w}}" for c, w in zip(columns, point_widths, strict=True))
        head += "".join(f"{p:>{w}}" for p, w in zip(places, widths, strict=True))
        lines = [head + ("   error" if compared else "")]
        for i, run in enumerate(runs):
            m, ended = self.measures.get(i), self.ended(i)
            if m is None:
                lines.append(f"{starts[i]}  {ended}")
                continue
            text = f"{starts[i]} {'-' if m.stiffness is None else f'{m.stiffness:.2f}':>6}"
            text += "".join(f"{p:>{w}}" for p, w in zip(points[i], point_widths, strict=True))
            sigma = self.sigma(i)
            for place, width in zip(places, widths, strict=True):
                text += f"{load_words(m.loads.get(place), sigma.get(place), ' N'):>{width}}"
            if compared:
                text += f"{'-' if m.error is None else f'{100 * m.error.relative:.1f} %':>8}"
            words = [ended] if run.record.early else []
            if marked := marks(run.notes):
                words.append(f"[{', '.join(marked)}]")
            lines.append("  ".join([text, *words]))
        return [*lines, *self.unsure]


def _against(found: Against) -> dict[str, Any]:
    numbers: dict[str, Any] = {"reference_mm": found.reference}
    for name, pair in found.pairs.items():
        key = f"{name.replace(' ', '_')}_{'N_per_mm' if name.endswith('stiffness') else 'N'}"
        numbers[key] = pair and {"predicted": pair[0], "measured": pair[1]}
    return numbers


def _point(point: Point | None, reached: float) -> dict[str, float | None]:
    """Return the numbers of a point, or up to which deflection (mm) there is none."""
    if point is None:
        return {"deflection_mm": None, "load_N": None, "none_up_to_mm": reached}
    return {"deflection_mm": point[0], "load_N": point[1]}


class CylinderPredicted:
    """Predictions of cylinders."""

    arrays = staticmethod(arrays_of)
    outcome = CylinderOutcome

    def depends_on(self, model: CylinderModel | BeamModel) -> Sequence[object]:
        mesh = model.mesh
        if isinstance(model, BeamModel):
            beam = {f.name: getattr(model, f.name) for f in fields(model) if f.name != "mesh"}
            return (sorted(beam), *beam.values())
        return (
            model.thickness, model.inflation, model.deflections, model.increments, model.collar,
            model.supports, model.gas, mesh.points, mesh.quads, mesh.warp, mesh.node_sets,
            *model.cords, model.weight,
        )  # fmt: skip

    def measured(self, test: CylinderTest) -> bool:
        return bool(test.measured)


def deflection_curve(model: CylinderModel | BeamModel, history: History) -> tuple[Array, Array]:
    """Return deflection (mm) and load (N) from the inflated cylinder to where the run ended."""
    return np.array([0.0, *model.deflections])[: len(history.load)], history.load


def loads(model: CylinderModel | BeamModel, history: History) -> dict[str, float]:
    """Return the load (N) at the places where the curve is read, up to the end of the run."""
    read = loads_at(*deflection_curve(model, history), model.reading.places)
    return {f"load at {place}, N": load for place, load in read.items() if load is not None}


def quantities(model: CylinderModel | BeamModel, history: History) -> dict[str, float]:
    """Return the quantities of a mesh study; for a knee or limit point not reached, the travel."""
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
    knee, limit = knee_point(d, load, stiffness, over), limit_point(d, load)
    for name, point in (("knee", knee), ("limit point", limit)):
        if point is None:
            values[f"no {name} up to, mm"] = float(d[-1])
        else:
            values[f"load at the {name}, N"] = point[1]
    return values


STUDIED = Studied(
    steps=lambda model: (*model.inflation, *model.increments),
    quantities=quantities,
    responses=loads,
    response="load",
    curve=deflection_curve,
)
