"""Show a bubble without a camera: measured beside modelled heights, curvatures and strains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...experiments.base import Findings, FittedTest
from ...experiments.bubble.prepared_readings import PreparedReadings
from ...experiments.bubble.reading_objective import ReadingObjective
from ...experiments.bubble.readings import ReadingSeries
from ...experiments.data_files import READING, Output
from ...experiments.measured import compared
from ...lazy_modules import pandas as pd
from ...notes import Note, NoteKind
from ...solvers.base import Array
from ..bubbles import drawn_indices, in_kilopascal
from ..charts import Chart, Charts, dots, line
from ..content import Exhibit, Table
from ..vega import saved

TAKEN_FOR_FLAT = NoteKind("sheet taken for flat and taut", weight=5)
FLAT_WORDS = (
    "the sheet is taken for flat and taut before the test: an initial height of a hundredth of the "
    "radius moves the moduli by tens of percent; [bubble.sheet] modes = 1 and prior allow for it"
)
TITLE = "Measured and modelled readings by pressure"


def objective_of(fitted: FittedTest) -> ReadingObjective:
    """Return the objective of the test's one comparison."""
    (comparison,) = fitted.comparisons
    assert isinstance(comparison.objective, ReadingObjective)
    return comparison.objective


def modelled_series(fitted: FittedTest) -> list[tuple[ReadingSeries, Array]]:
    """Return each series with the model's values (n,), in base units."""
    objective = objective_of(fitted)
    modelled = objective.modelled(fitted.histories[0].displacement, fitted.nuisance)
    series = [reader.series for reader in objective.readers]
    return list(zip(series, modelled, strict=True))


def rms_errors(fitted: FittedTest) -> list[tuple[ReadingSeries, float]]:
    """Return each series with the RMS error of its values, in its unit."""
    errors = []
    for series, modelled in modelled_series(fitted):
        rms = np.sqrt(np.mean((modelled - series.value) ** 2))
        errors.append((series, series.unit.size * rms))
    return errors


def findings(prepared: PreparedReadings, fitted: FittedTest) -> Findings:
    """Return what the best fit means for the test: RMS errors, warnings, words."""
    numbers: dict[str, Any] = {"series": {}, "nuisance": fitted.reported_nuisance}
    words = []
    for series, rms in rms_errors(fitted):
        unit = series.unit
        numbers["series"][series.label] = {
            "quantity": series.quantity,
            "unit": unit.name,
            "rms": rms,
            "readings": len(series.value),
            "specimens": series.specimen_count,
        }
        words.append(f"{series.label} {rms:.3g} {unit.name}")
    summary = f"RMS errors: {', '.join(words)}"
    units = {n.name: n.unit for c in fitted.comparisons for n in c.nuisance}
    nuisance = [f"{name} {numbers['nuisance'][name]:.3f} {unit}" for name, unit in units.items()]
    lines = [summary]
    if nuisance:
        lines.append(f"nuisance: {', '.join(nuisance)}")
    sources = [note for file in prepared.data_files() for note in file.source.notes]
    notes = [Note(READING, note) for note in dict.fromkeys(sources)]
    if not prepared.test.sheet.has_unknowns:
        notes.append(Note(TAKEN_FOR_FLAT, FLAT_WORDS))
    return Findings(numbers, tuple(notes), tuple(lines), summary, summary)


def residuals(prepared: PreparedReadings, fitted: FittedTest) -> pd.DataFrame:
    """Return a table with a row for each reading; modelled values include the gauges' offsets."""
    tables = []
    for series, modelled in modelled_series(fitted):
        unit = series.unit
        columns: dict[str, Any] = {
            "part": "bubble",
            "pressure_kPa": 1e3 * series.pressure,
            "x_mm": series.positions[:, 0],
            "y_mm": series.positions[:, 1],
            "specimen": series.specimens + 1,
        }
        values = unit.size * series.value, unit.size * modelled
        tables.append(compared(series.label, *values, unit.name, **columns))
    return pd.concat(tables, ignore_index=True)


def series_charts(pairs: Sequence[tuple[ReadingSeries, Array | None]], name: str) -> Charts:
    """Return a chart of each series by pressure: measured dots, and the model's line if given."""
    charts = []
    for series, modelled in pairs:
        if np.ptp(series.positions, axis=0).any():
            charts.append(_line_chart(series, modelled))
            continue
        size = series.unit.size
        pressure = 1e3 * series.pressure
        curves = [dots("measured", pressure, size * series.value, colour=7)]
        if modelled is not None:
            order = np.argsort(pressure)
            curves.append(line("model", pressure[order], size * modelled[order]))
        y_label = f"{series.quantity}, {series.unit.name}"
        charts.append(Chart(series.label, "pressure, kPa", y_label, curves, TITLE))
    return Charts(name, charts, TITLE)


def _line_chart(series: ReadingSeries, modelled: Array | None) -> Chart:
    """Return a chart of heights along a line, mm, at several pressures; `modelled` : (n,), mm."""
    # The first right singular vector points along the line; its sign is arbitrary.
    direction = np.linalg.svd(series.positions, full_matrices=False)[2][0]
    place = series.positions @ (direction * np.sign(direction[np.abs(direction).argmax()]))
    pressures = np.unique(series.pressure)
    curves = []
    for pressure in pressures[drawn_indices(len(pressures))]:
        rows = np.flatnonzero(series.pressure == pressure)
        rows = rows[np.argsort(place[rows])]
        words = in_kilopascal(pressure)
        curves.append(dots(f"measured, {words}", place[rows], series.value[rows], colour=7))
        if modelled is not None:
            curves.append(line(f"model, {words}", place[rows], modelled[rows]))
    return Chart(series.label, "place, mm", "height, mm", curves, TITLE)


def fitted_charts(prepared: PreparedReadings, fitted: FittedTest) -> Charts:
    """Return a chart of each series, measured beside modelled."""
    return series_charts(modelled_series(fitted), f"{prepared.test.name} readings")


def show(
    prepared: PreparedReadings, fitted: FittedTest, findings: Findings, out: Output
) -> Exhibit:
    """Write readings.csv and the figure of the readings; return them and a table of the misfit."""
    charts = fitted_charts(prepared, fitted)
    files = [
        out.write("readings.csv", residuals(prepared, fitted), "readings, measured and modelled"),
        saved(out, "readings.png", charts, "picture of the readings"),
    ]
    objective = objective_of(fitted)
    rows = []
    for (series, rms), level in zip(rms_errors(fitted), objective.noises, strict=True):
        unit = series.unit
        counts = [len(series.value), series.specimen_count]
        rows.append([series.label, unit.name, rms, unit.size * level, *counts])
    header = ["readings", "unit", "RMS error", "noise", "matched", "specimens"]
    note = f"noise: {objective.noise_is}"
    table = Table("Misfit of the readings", header, rows, note, text=(0, 1))
    facts = [("misfit", findings.summary)]
    return Exhibit(facts=facts, tables=[table], files=files, parts=[charts])


def examine(prepared: PreparedReadings, out: Output) -> Exhibit:
    """Draw the readings before a fit; return the figure, and a table of what is read."""
    series = prepared.readings.series
    charts = series_charts([(s, None) for s in series], "readings")
    rows = [
        [
            s.label,
            s.unit.name,
            len(s.value),
            s.specimen_count,
            1e3 * s.pressure.min(),
            1e3 * s.pressure.max(),
            s.unit.size * np.abs(s.value).max(),
        ]
        for s in series
    ]
    header = ["readings", "unit", "number", "specimens", "from kPa", "to kPa", "largest"]
    table = Table("Readings", header, rows, text=(0, 1))
    figures = [saved(out, "readings.png", charts, TITLE)]
    return Exhibit(figures=figures, tables=[table], parts=[charts])
