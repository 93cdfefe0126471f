"""Predicted bending of cylinders with material cards: numbers, tables, bands and lines of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ...lazy_modules import pandas as pd
from ...materials.card import BAND
from ...meshes.beam_model import BeamModel
from ...notes import marks_of
from ...readers.bending import BendingError, scatter
from ...solvers.base import Array, BandEnd, History
from ..forward import STRAINS, Studied
from ..predicted import PredictedRun, band_of
from .measures import (
    BendingMeasures,
    BendingRun,
    CurvePoint,
    MeasuredComparison,
    Model,
    angle_sensitivity,
    arrays_of,
    bending_measures,
    deflections_of,
    initial_stiffness,
    is_near_neutral,
    knee_point,
    limit_point,
    loads_at,
    run_of,
)
from .test import CylinderTest

#: Columns of a curve.
CURVE_COLUMNS = ("deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3", "wrinkled_share")

#: Columns of runs.csv before the loads at places, and after them.
COLUMNS_BEFORE_LOADS = (
    "stiffness_N_per_mm",
    "knee_mm",
    "knee_N",
    "limit_mm",
    "limit_N",
    "wrinkles_mm",
    "wrinkles_N",
)
COLUMNS_AFTER_LOADS = (
    "inflation_warp_strain",
    "inflation_fill_strain",
    "pressure_rise_kPa",
    "rms_N",
    "rms_relative",
    "mean_error_N",
    "compared",
    "reached_mm",
)


def measured_table(tests: Sequence[CylinderTest]) -> pd.DataFrame:
    """Return mean and scatter of the measured loads of each test over a grid of deflections.

    At least one of the tests has measured loads.
    """
    tables = []
    for test in tests:
        if not test.measured:
            continue
        spread = scatter(test.measured)
        columns = {
            "test": test.name,
            "deflection_mm": spread.deflection,
            "mean_N": spread.mean,
            "standard_deviation_N": spread.deviation,
            "repetitions": spread.count,
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def place_names(tests: Iterable[CylinderTest]) -> list[str]:
    """Return the names of the places at which any of the tests lists loads, each once."""
    return list(dict.fromkeys(name for test in tests for name in test.reading.places))


@dataclass(frozen=True, eq=False)
class CylinderOutcome:
    """Results of runs of cylinders with material cards.

    Parameters
    ----------
    runs : sequence of PredictedRun
        All runs; "number" is everywhere the index of a run in this sequence, from 0.
    """

    runs: Sequence[PredictedRun]

    @cached_property
    def bent(self) -> Mapping[int, BendingRun]:
        """Return the stored arrays of the runs that did not fail, by number."""
        stored = {i: run_of(run.record) for i, run in enumerate(self.runs)}
        return {i: run for i, run in stored.items() if run is not None}

    @cached_property
    def measures(self) -> Mapping[int, BendingMeasures]:
        """Return the evaluation of the runs that did not fail, by number."""
        return {
            i: bending_measures(self.runs[i].model, run, self.runs[i].test.measured)
            for i, run in self.bent.items()
        }

    @cached_property
    def band(self) -> Sequence[BandEnd]:
        """Return the ends of the solver's band, the predicted one first; empty without a band."""
        return band_of(self.runs)

    def other_end(self, number: int) -> int | None:
        """Return the number of the run at the other end of a run's band, if it did not fail."""
        test = self.runs[number].test
        card = self.runs[number].card
        for i in self.bent:
            run = self.runs[i]
            if (run.test, run.card, run.predicted) == (test, card, False):
                return i
        return None

    @cached_property
    def spreads(self) -> Mapping[int, Array]:
        """Return the standard deviations (frames,) N of the load due to the card, by number."""
        spreads = {}
        for i, bent in self.bent.items():
            around = self.runs[i].around
            if around is not None:
                neighbours = [run_of(record) for record in around.records]
                loads = [None if run is None else run.load for run in neighbours]
                spreads[i] = around.sigma(bent.load, loads)
        return spreads

    def sigma(
        self, number: int, places: Mapping[str, float] | None = None
    ) -> dict[str, float | None]:
        """Return the standard deviation of the load due to the card.

        Parameters
        ----------
        number : int
            Number of the run.
        places : mapping of str to float, optional
            Deflections by name, mm; those of the test unless given.

        Returns
        -------
        dict of str to float or None
            Standard deviation, N, by name of the place; None where it is unknown.
        """
        if number not in self.spreads:
            return dict.fromkeys(places or self.measures[number].loads)
        places = places or self.runs[number].test.reading.places
        sigmas = loads_at(self.bent[number].deflection, self.spreads[number], places)
        return {
            name: sigma if sigma is not None and np.isfinite(sigma) else None
            for name, sigma in sigmas.items()
        }

    def with_band(
        self, number: int, name: Literal["stiffness", "knee", "limit"]
    ) -> tuple[float, float, float] | None:
        """Return stiffness, knee or limit load of a run with the ends of its uncertainty band.

        The band contains the results of both assumptions on the wall, each with the uncertainty of
        the load at that deflection that is due to the card.

        Parameters
        ----------
        number : int
            Number of the run.
        name : {"stiffness", "knee", "limit"}
            Which result.

        Returns
        -------
        value, low, high : float
            Stiffness in N/mm, or load at the knee or the limit point in N. None is returned where
            the run has no such result.
        """
        measures = self.measures.get(number)
        value = None if measures is None else getattr(measures, name)
        if value is None:
            return None
        slope_over = self.runs[number].test.reading.slope_over
        if name == "stiffness":
            deflection = slope_over
            size = value
            load_per_size = slope_over
        else:
            deflection = value.deflection
            size = value.load
            load_per_size = 1.0
        sigma = self.sigma(number, {"": deflection})[""] or 0.0
        half_band = BAND * sigma / load_per_size
        ends = [size - half_band, size + half_band]
        other_end = self.other_end(number)
        other_value = None if other_end is None else getattr(self.measures[other_end], name)
        if other_value is not None:
            other_size = other_value if name == "stiffness" else other_value.load
            ends += [other_size - half_band, other_size + half_band]
        return size, min(ends), max(ends)

    @cached_property
    def unsure(self) -> Sequence[str]:
        """Return notes on cards of unknown uncertainty, and on braids whose angle matters."""
        # A beam does not use a card: the project gives the stiffness of its wall.
        cards = dict.fromkeys(
            run.card
            for run in self.runs
            if run.material.certainty is None and not isinstance(run.model, BeamModel)
        )
        notes = []
        if cards:
            names = ", ".join(cards)
            notes.append(f"no spread of loads with {names}: the card does not say how sure it is")
        for i, bent in self.bent.items():
            run = self.runs[i]
            if is_near_neutral(run.model):
                words = angle_sensitivity(run.model, bent.load, run.test.reading.places)
                notes.append(f"{run.test.name}: {words}")
        return notes

    def ended(self, number: int) -> str:
        """Return how a run ended: "finished", how far it came, or why it failed."""
        record = self.runs[number].record
        if record.failure:
            return f"failed: {record.failure}"
        if not record.early:
            return "finished"
        end = self.runs[number].test.deflections[-1]
        reached = self.bent[number].deflection[-1]
        return f"stopped at {reached:g} of {end:g} mm: {record.early}"

    def error(self, number: int) -> float | None:
        """Return the RMS error over the largest measured load; None without measured loads."""
        measures = self.measures.get(number)
        return None if measures is None or measures.error is None else measures.error.relative

    def numbers(self, number: int) -> Mapping[str, Any]:
        """Return the results of a run for result.json."""
        m = self.measures[number]
        around = self.runs[number].around if number in self.spreads else None
        straight = None
        if m.straightness:
            straight = {
                "r_squared": m.straightness[0],
                "largest_deviation": m.straightness[1],
            }
        numbers: dict[str, Any] = {
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
            "straight_before_buckling": straight,
            "pressure_rise_kPa": m.pressure_rise,
            "error": None if m.error is None else _error_numbers(m.error),
        }
        if m.against is not None:
            numbers["against_measured"] = _comparison_numbers(m.against)
        return numbers

    def columns(self, number: int) -> Mapping[str, object]:
        """Return the results of a run for its row of runs.csv."""
        m = self.measures.get(number)
        places = [p.replace(" ", "_") for p in self.runs[number].test.reading.places]
        loads = [f"load_at_{place}_N" for place in places]
        names = [*COLUMNS_BEFORE_LOADS, *loads, *COLUMNS_AFTER_LOADS]
        values = [None] * len(names) if m is None else _column_values(m)
        row: dict[str, object] = dict(zip(names, values, strict=True))
        if m is not None and m.against is not None:
            ratios = m.against.ratios.items()
            row |= {f"{n.replace(' ', '_')}_over_measured": ratio for n, ratio in ratios}
        if number in self.spreads:
            sigmas = zip(places, self.sigma(number).values(), strict=True)
            row |= {f"load_at_{p}_sigma_N": sigma for p, sigma in sigmas}
        return row

    def curve(self, number: int) -> pd.DataFrame:
        """Return a table of load, pressure, volume and wrinkled share of a run over deflection."""
        run = self.bent.get(number)
        values = [np.empty(0)] * len(CURVE_COLUMNS)
        if run is not None:
            share = run.wrinkled if len(run.wrinkled) else np.full(len(run.load), np.nan)
            values = [run.deflection, run.load, 1e3 * run.pressure, run.volume, share]
        curve = pd.DataFrame(dict(zip(CURVE_COLUMNS, values, strict=True)))
        if number in self.spreads:
            curve["load_sigma_N"] = self.spreads[number]
        return curve

    def test_numbers(self, test: CylinderTest) -> Mapping[str, Any]:
        """Return the dimensions and conditions of a test for result.json."""
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
        """Return a table for the terminal, and notes on cards of unknown spread."""
        return [*_terminal_table(self), *self.unsure]


def _column_values(m: BendingMeasures) -> list[float | None]:
    """Return the values of `COLUMNS_BEFORE_LOADS`, of the loads, and of `COLUMNS_AFTER_LOADS`."""
    values = [m.stiffness]
    for point in (m.knee, m.limit, m.wrinkles):
        values += [None, None] if point is None else [*point]
    values += [*m.loads.values(), *m.body_strain, m.pressure_rise]
    error = m.error
    if error is None:
        values += [None] * 4
    else:
        values += [error.rms, error.relative, error.mean, error.compared]
    return [*values, m.reached]


def _error_numbers(error: BendingError) -> dict[str, float]:
    """Return the error against measured loads by the keys of result.json."""
    return {
        "rms": error.rms,
        "mean": error.mean,
        "relative": error.relative,
        "compared": error.compared,
        "beyond": error.beyond_count,
    }


def _comparison_numbers(comparison: MeasuredComparison) -> dict[str, Any]:
    """Return what was compared with measured curves, for result.json."""
    numbers: dict[str, Any] = {"reference_mm": comparison.reference}
    for name, pair in comparison.pairs.items():
        unit = "N_per_mm" if name.endswith("stiffness") else "N"
        key = f"{name.replace(' ', '_')}_{unit}"
        numbers[key] = pair and {"predicted": pair[0], "measured": pair[1]}
    return numbers


def _point(point: CurvePoint | None, reached: float) -> dict[str, float | None]:
    """Return a point for result.json, or up to which deflection (mm) there is none."""
    if point is None:
        return {"deflection_mm": None, "load_N": None, "none_up_to_mm": reached}
    return {"deflection_mm": point[0], "load_N": point[1]}


class CylinderPredicted:
    """Describe how tests of cylinders are predicted: stored arrays, outcome, dependencies."""

    arrays = staticmethod(arrays_of)
    outcome = CylinderOutcome

    def depends_on(self, model: Model) -> Sequence[object]:
        """Return all values of a model on which its result depends."""
        if isinstance(model, BeamModel):
            values = {f.name: getattr(model, f.name) for f in fields(model) if f.name != "mesh"}
            return (sorted(values), *values.values())
        mesh = model.mesh
        return (
            model.thickness,
            model.inflation,
            model.deflections,
            model.increments,
            model.collar,
            model.supports,
            model.gas,
            mesh.points,
            mesh.quads,
            mesh.warp,
            mesh.node_sets,
            *model.cords,
            model.weight,
        )

    def measured(self, test: CylinderTest) -> bool:
        """Return whether a test has measured loads."""
        return bool(test.measured)


def deflection_curve(model: Model, history: History) -> tuple[Array, Array]:
    """Return deflection (mm) and load (N) from the inflated cylinder to where the run ended."""
    return deflections_of(model, history.load), history.load


def loads(model: Model, history: History) -> dict[str, float]:
    """Return the load (N) at the places where the curve is read, up to the end of the run."""
    listed = loads_at(*deflection_curve(model, history), model.reading.places)
    return {f"load at {place}, N": load for place, load in listed.items() if load is not None}


def quantities(model: Model, history: History) -> dict[str, float]:
    """Return the quantities that a mesh study compares.

    For a knee or limit point that is not reached, it is the largest deflection.
    """
    mesh = model.mesh
    over = model.reading.slope_over
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
    limit = limit_point(d, load)
    for name, point in (("knee", knee), ("limit point", limit)):
        if point is None:
            values[f"no {name} up to, mm"] = float(d[-1])
        else:
            values[f"load at the {name}, N"] = point.load
    return values


STUDIED = Studied(
    steps=lambda model: (*model.inflation, *model.increments),
    quantities=quantities,
    responses=loads,
    response="load",
    curve=deflection_curve,
)


def describe_load(load: float | None, sigma: float | None, unit: str = "") -> str:
    """Return a load (N) in words, with one standard deviation (N) where it is known."""
    if load is None:
        return "-"
    return f"{load:.0f}{unit}" if sigma is None else f"{load:.0f} ± {sigma:.2g}{unit}"


def _terminal_table(outcome: CylinderOutcome) -> list[str]:
    """Return the lines of a table: stiffness, knee, limit point, loads and error of each run."""
    measures = outcome.measures
    places = place_names(run.test for run in outcome.runs)
    header, *names = _padded_names(outcome.runs)
    points = {i: (m.describe(m.knee), m.describe(m.limit)) for i, m in measures.items()}
    point_columns = list(zip(("knee", "limit point"), *points.values(), strict=False))
    point_widths = [max(map(len, column)) + 2 for column in point_columns]
    load_widths = [max(len(place), 13 if outcome.spreads else 7) + 2 for place in places]
    has_errors = any(m.error is not None for m in measures.values())

    header += "   N/mm" + _right_aligned((column[0] for column in point_columns), point_widths)
    header += _right_aligned(places, load_widths) + ("   error" if has_errors else "")
    lines = [header]
    for i, run in enumerate(outcome.runs):
        end = outcome.ended(i)
        if i not in measures:
            lines.append(f"{names[i]}  {end}")
            continue
        m = measures[i]
        sigmas = outcome.sigma(i)
        loads = [describe_load(m.loads.get(p), sigmas.get(p), " N") for p in places]
        stiffness = "-" if m.stiffness is None else f"{m.stiffness:.2f}"
        line = f"{names[i]} {stiffness:>6}"
        line += _right_aligned(points[i], point_widths) + _right_aligned(loads, load_widths)
        if has_errors:
            error = "-" if m.error is None else f"{100 * m.error.relative:.1f} %"
            line += f"{error:>8}"
        lines.append("  ".join([line, *_remarks(run, end)]))
    return lines


def _remarks(run: PredictedRun, end: str) -> list[str]:
    """Return how a run ended, where that was early, and the kinds of its marked notes."""
    remarks = [end] if run.record.early else []
    marked = marks_of(run.notes)
    return [*remarks, f"[{', '.join(marked)}]"] if marked else remarks


def _padded_names(runs: Sequence[PredictedRun]) -> list[str]:
    """Return the header, then test, card and wall of each run, in columns."""
    count = 3 if any(run.wall for run in runs) else 2
    rows = [("test", "card", "wall"), *((run.test.name, run.card, run.wall) for run in runs)]
    rows_shown = [row[:count] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows_shown, strict=True)]
    return [
        "  ".join(f"{name:<{width}}" for name, width in zip(row, widths, strict=True))
        for row in rows_shown
    ]


def _right_aligned(cells: Iterable[str], widths: Sequence[int]) -> str:
    """Return cells as one line, each at the right end of its column."""
    return "".join(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
