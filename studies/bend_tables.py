"""The tables of a study of bending: load_deflection.csv, runs.csv, measured.csv."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..experiments.bending_scatter import scatter
from ..experiments.tables import write_table
from ..projects.bend import BendProject
from ..writing import replacing
from .bend_measures import PLACES
from .bend_results import BendOutcome

RUN_HEADER = (
    "case", "card", "stiffness_N_per_mm", "knee_mm", "knee_N", "limit_mm", "limit_N",
    "wrinkles_mm", "wrinkles_N", *(f"load_at_{p:g}_mm_N" for p in PLACES),
    "inflation_warp_strain", "inflation_fill_strain", "pressure_rise_kPa", "rms_N", "rms_relative",
    "mean_error_N", "compared", "reached_mm", "ended", "seconds",
)  # fmt: skip


def run_row(outcome: BendOutcome, number: int) -> list[object]:
    """One row of runs.csv (`RUN_HEADER`); what is not known is None."""
    pair, run, found = outcome.pairs[number], outcome.runs[number], outcome.measures.get(number)
    head: list[object] = [pair.case.name, pair.name]
    tail: list[object] = [outcome.ended(number), run.seconds]
    if found is None:
        return [*head, *[None] * (len(RUN_HEADER) - 4), *tail]
    pairs = [found.knee, found.limit, found.wrinkles]
    points = [value for point in pairs for value in (point or (None, None))]
    error = found.error
    errors = [None] * 4
    if error is not None:
        errors = [error.rms, error.relative, error.mean, error.compared]  # type: ignore[list-item]
    return [
        *head, found.stiffness, *points, *found.loads, *found.body_strain, found.pressure_rise,
        *errors, found.reached, *tail,
    ]  # fmt: skip


def write_bend_tables(project: BendProject, outcome: BendOutcome, folder: Path) -> None:
    """load_deflection.csv, runs.csv, and measured.csv where anything was measured."""
    rows: list[list[object]] = []
    for pair, run in zip(outcome.pairs, outcome.runs, strict=True):
        wrinkled = run.wrinkled if len(run.wrinkled) else [""] * len(run.load)
        for d, load, gauge, volume, share in zip(
            run.deflection, run.load, run.pressure, run.volume, wrinkled, strict=True
        ):
            part = share if share == "" else float(share)
            row = [float(d), float(load), 1e3 * float(gauge), float(volume), part]
            rows.append([pair.case.name, pair.name, *row])
    header = ["case", "card", "deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3"]
    with replacing(folder / "load_deflection.csv") as path:
        write_table(path, [*header, "wrinkled_share"], rows)
    with replacing(folder / "runs.csv") as path:
        all_rows = [run_row(outcome, i) for i in range(len(outcome.pairs))]
        write_table(path, RUN_HEADER, [["" if v is None else v for v in r] for r in all_rows])
    rows = []
    for case in project.cases:
        if case.measured:
            s = scatter(case.measured)
            grid = zip(s.deflection, s.mean, s.deviation, s.count, strict=True)
            for d, mean, spread, count in grid:
                known = float(spread) if np.isfinite(spread) else ""
                rows.append([case.name, float(d), float(mean), known, int(count)])
    if rows:
        header = ["case", "deflection_mm", "mean_N", "standard_deviation_N", "repetitions"]
        with replacing(folder / "measured.csv") as path:
            write_table(path, header, rows)
