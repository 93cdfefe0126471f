"""The page of a study of bending."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..projects.bend import BendCase, BendProject
from ..reports import Report, Table, percent, write_report
from .bend_figures import bend_figures, write_beams
from .bend_measures import PLACES
from .bend_results import BendOutcome
from .bend_statements import TOLERANCES

#: Letters of a cell that is not broken.
SHORT = 30
FILES = (
    ("load_deflection.csv", "every curve: deflection, load, pressure, volume, wrinkled share"),
    ("runs.csv", "the table of runs with all its columns"),
    ("measured.csv", "mean and scatter of the repetitions on a grid"),
    ("result.json", "all numbers of this page, for programs"),
)


def report_bend(
    project: BendProject, outcome: BendOutcome, result: Mapping[str, Any], folder: Path
) -> None:
    """Draw everything and write the beams and report.html."""
    figures = bend_figures(project, outcome, folder)
    ended = sum(outcome.ended(i) == "finished" for i in range(len(outcome.pairs)))
    thesis = [s for s in outcome.statements if s.holds is not None]
    summary = f"{ended} of {len(outcome.pairs)} runs finished."
    if thesis:
        holds = sum(bool(s.holds) for s in thesis)
        summary += f" {holds} of {len(thesis)} statements of the thesis that could be checked hold."
    if outcome.worst is not None:
        summary += f" Largest error against measured loads: {percent(outcome.worst)}."
    beams = write_beams(project, outcome, folder)
    page = Report(
        title=project.title,
        summary=summary,
        facts=[
            ("cases", len(project.cases)),
            ("cards", len(project.cards)),
            ("solver", project.solver),
            ("wall time, s", float(result["wall_s"])),
            ("seconds of all runs", float(sum(run.seconds for run in outcome.runs))),
            *_common(project.cases),
        ],
        warnings=_warnings(outcome),
        figures=figures,
        tables=[*_statements(outcome), *_runs(outcome), *_errors(outcome)],
        files=[f for f in FILES if f[0] == "result.json" or (folder / f[0]).exists()] + beams,
        versions=result["versions"],
    )
    write_report(folder, page)


def _common(cases: Sequence[BendCase]) -> list[tuple[str, object]]:
    """What all cases share, for the head of the page."""
    facts: list[tuple[str, object]] = []
    for label, values in (
        ("length, mm", {c.length for c in cases}),
        ("span, mm", {c.supports.span for c in cases}),
        ("element size, mm", {c.size for c in cases}),
        ("seam width, mm", {c.seam_width for c in cases}),
    ):
        if len(values) == 1:
            facts.append((label, float(values.pop())))
    return facts


def _warnings(outcome: BendOutcome) -> list[str]:
    """Runs that did not finish; the rest is said in runs.csv and result.json."""
    return [
        f"{pair.case.name} with {pair.name}: {outcome.ended(i)}"
        for i, pair in enumerate(outcome.pairs)
        if outcome.ended(i) != "finished"
    ]


def _statements(outcome: BendOutcome) -> list[Table]:
    rows: list[list[object]] = [[s.thesis, s.found, s.verdict] for s in outcome.statements]
    header = ["the thesis", "these runs", "verdict"]
    if all(s.holds is None for s in outcome.statements):
        return []
    return [Table("What the thesis saw", header, rows, TOLERANCES, text=(1, 2))]


def _runs(outcome: BendOutcome) -> list[Table]:
    rows: list[list[object]] = []
    for i, pair in enumerate(outcome.pairs):
        found = outcome.measures.get(i)
        head: list[object] = [pair.case.name, pair.name]
        seconds = round(outcome.runs[i].seconds, 1)
        if found is None:
            rows.append([*head, *[None] * 8, outcome.ended(i), seconds])
            continue
        where = found.buckling
        knee = " (knee)" if found.buckling_is == "knee" else ""
        buckles = f"{where[1]:.0f} N, {where[0]:.0f} mm{knee}" if where else None
        wrinkles = f"{found.wrinkles[0]:.0f} mm" if found.wrinkles else None
        loads = [None if load is None else f"{load:.0f}" for load in found.loads]
        strain, rise = f"{max(found.body_strain):.3f}", f"{found.pressure_rise:+.2f}"
        stiffness = None if found.stiffness is None else f"{found.stiffness:.2f}"
        rows.append(
            [*head, stiffness, buckles, wrinkles, *loads, strain, rise,
             outcome.ended(i), seconds]
        )  # fmt: skip
    at = [f"load at {p:g} mm, N" for p in PLACES]
    header = [
        "case", "card", "stiffness, N/mm", "buckles", "wrinkles from", *at,
        "inflation strain", "pressure, kPa", "ended", "s",
    ]  # fmt: skip
    note = (
        "Stiffness: to 20 mm. Buckles: the limit point where the load falls afterwards, else the "
        "knee, where the slope has fallen to half. Wrinkles: more of the surface than when "
        "inflated. Inflation strain: the largest along warp or fill in the body, without the "
        "quads beside seam and caps. Pressure: its rise to the last frame."
    )
    return [Table("Runs", header, [_unbroken(row) for row in rows], note, text=(1, 10))]


def _errors(outcome: BendOutcome) -> list[Table]:
    rows: list[list[object]] = [
        [
            outcome.pairs[i].case.name, outcome.pairs[i].name, m.error.rms,
            percent(m.error.relative), f"{m.error.mean:+.1f}", m.error.compared, m.error.beyond,
        ]
        for i, m in outcome.measures.items()
        if m.error is not None
    ]  # fmt: skip
    if not rows:
        return []
    header = ["case", "card", "RMS, N", "of the largest load", "mean, N", "readings", "beyond"]
    note = "Model less reading at every reading that the model reaches; beyond: those it does not."
    text = [_unbroken(row) for row in rows]
    return [Table("Against measured loads", header, text, note, text=(1,))]


def _unbroken(row: Sequence[object]) -> list[object]:
    """The row with names and numbers that stay on one line."""
    return [c.replace(" ", "\u00a0") if isinstance(c, str) and len(c) < SHORT else c for c in row]
