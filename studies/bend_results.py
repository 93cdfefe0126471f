"""What a study of bending found: result.json, load_deflection.csv, runs.csv, lines and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..experiments.bending_scatter import scatter
from ..experiments.tables import write_table
from ..projects.bend import BendProject
from ..runs.bend_run import BendRun
from ..writing import replacing
from .bend_measures import PLACES, BendMeasures, Point, bend_measures
from .bend_setup import Pair
from .bend_statements import Statement, statements
from .results import STRAINS, beyond_card, versions

RUN_HEADER = (
    "case", "card", "stiffness_N_per_mm", "knee_mm", "knee_N", "limit_mm", "limit_N",
    "wrinkles_mm", "wrinkles_N", *(f"load_at_{p:g}_mm_N" for p in PLACES),
    "inflation_warp_strain", "inflation_fill_strain", "pressure_rise_kPa", "rms_N", "rms_relative",
    "mean_error_N", "compared", "reached_mm", "ended", "seconds",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class BendOutcome:
    """All pairs with how they ended; measures of those that ended well; the statements."""

    pairs: Sequence[Pair]
    runs: Sequence[BendRun]
    measures: Mapping[int, BendMeasures]
    statements: Sequence[Statement]

    def ended(self, number: int) -> str:
        """ "finished", or how far a run came or why not."""
        pair, run = self.pairs[number], self.runs[number]
        if run.failed:
            return f"failed: {run.failed}"
        whole = pair.case.deflections[-1]
        if run.deflection[-1] >= whole * (1 - 1e-9):
            return "finished"
        return f"stopped at {run.deflection[-1]:g} of {whole:g} mm"

    def notes(self, number: int) -> list[str]:
        """What a reader of a run's numbers should know."""
        run, card = self.runs[number], self.pairs[number].card
        if run.failed:
            return []
        shear = max(abs(run.strain_min[2]), abs(run.strain_max[2]))
        reached = np.array([run.strain_max[0], run.strain_max[1], shear])
        return [*run.remarks, *beyond_card(reached, card)]

    @property
    def worst(self) -> float | None:
        """Largest RMS error over the largest load measured; None where nothing is compared."""
        errors = [m.error.relative for m in self.measures.values() if m.error is not None]
        return max(errors, default=None)


def outcome_of(project: BendProject, pairs: Sequence[Pair], runs: Sequence[BendRun]) -> BendOutcome:
    """Measure every run that ended well, and check the thesis' statements on them."""
    measures = {
        i: bend_measures(pair.model().mesh, run, pair.case.measured)
        for i, (pair, run) in enumerate(zip(pairs, runs, strict=True))
        if not run.failed
    }
    found = {(pairs[i].case.name, pairs[i].name): m for i, m in measures.items()}
    return BendOutcome(pairs, runs, measures, statements(project, found))


def bend_result(
    command: str, project: BendProject, outcome: BendOutcome, wall_s: float
) -> dict[str, Any]:
    """result.json."""
    return {
        "command": command,
        "title": project.title,
        "solver": project.solver,
        "cases": [
            {
                "case": case.name,
                "diameter_mm": case.diameter,
                "pressure_kPa": 1e3 * case.pressure,
                "length_mm": case.length,
                "seam_width_mm": case.seam_width,
                "element_size_mm": case.size,
                "symmetry": case.symmetry,
                "supports": asdict(case.supports),
                "collar": asdict(case.collar),
                "repetitions": len(case.measured),
            }
            for case in project.cases
        ],
        "runs": [_run(outcome, i) for i in range(len(outcome.pairs))],
        "worst_relative_error": outcome.worst,
        "statements": [
            {"thesis": s.thesis, "found": s.found, "verdict": s.verdict} for s in outcome.statements
        ],
        "wall_s": wall_s,
        "versions": versions(),
    }


def _run(outcome: BendOutcome, number: int) -> dict[str, Any]:
    pair, run, found = outcome.pairs[number], outcome.runs[number], outcome.measures.get(number)
    said: dict[str, Any] = {
        "case": pair.case.name,
        "card": pair.name,
        "ended": outcome.ended(number),
        "seconds": run.seconds,
    }
    if found is None:
        return said
    error = found.error
    return {
        **said,
        "reached_mm": found.reached,
        "stiffness_N_per_mm": found.stiffness,
        "buckling": {"is": found.buckling_is, **_point(found.buckling)},
        "knee": _point(found.knee),
        "limit_point": _point(found.limit),
        "wrinkle_onset": _point(found.wrinkles),
        "load_N": {f"{p:g} mm": load for p, load in zip(PLACES, found.loads, strict=True)},
        "inflation_strain": {
            "body": dict(zip(STRAINS, found.body_strain, strict=False)),
            "with_seam_and_ends": dict(zip(STRAINS, found.anywhere_strain, strict=False)),
        },
        "straight_before_buckling": None
        if found.straightness is None
        else {"r_squared": found.straightness[0], "largest_deviation": found.straightness[1]},
        "pressure_rise_kPa": found.pressure_rise,
        "error": None if error is None else asdict(error),
        "iterations": run.iterations,
        "warnings": outcome.notes(number),
    }


def _point(point: Point | None) -> dict[str, float | None]:
    return {"deflection_mm": point[0] if point else None, "load_N": point[1] if point else None}


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


def bend_lines(result: Mapping[str, Any]) -> list[str]:
    """The table for the terminal, then statements that do not hold, then what to know."""
    runs = result["runs"]
    compared = any(r.get("error") for r in runs)
    wide = max(len(r["case"]) for r in runs), max(len(r["card"]) for r in runs)
    head = f"{'case':<{wide[0]}}  {'card':<{wide[1]}}   N/mm   buckles at"
    head += "".join(f"{f'{p:g} mm':>9}" for p in PLACES) + ("   error" if compared else "")
    lines = [head]
    for run in runs:
        start = f"{run['case']:<{wide[0]}}  {run['card']:<{wide[1]}}"
        if "stiffness_N_per_mm" not in run:
            lines.append(f"{start}  {run['ended']}")
            continue
        point = run["buckling"]
        place = "-"
        if point["load_N"] is not None:
            place = f"{point['load_N']:.0f} N {point['deflection_mm']:.0f} mm"
        stiff = run["stiffness_N_per_mm"]
        text = f"{start} {'-' if stiff is None else f'{stiff:.2f}':>6} {place:>13}"
        for load in run["load_N"].values():
            text += "        -" if load is None else f"{load:>7.0f} N"
        if compared:
            error = run["error"]
            text += "       -" if error is None else f"{100 * error['relative']:>6.1f} %"
        if run["ended"] != "finished":
            text += f"  {run['ended']}"
        lines.append(text)
    checked = [s for s in result["statements"] if s["verdict"] != "not checked"]
    if checked:
        holds = sum(s["verdict"] == "holds" for s in checked)
        lines.append(f"statements of the thesis: {holds} of {len(checked)} checked hold")
        lines += [
            f"  does not hold: {s['thesis']}: {s['found']}"
            for s in checked
            if s["verdict"] == "does not hold"
        ]
    return lines
