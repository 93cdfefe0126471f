"""Figures, VTU files and the page of a study of bending."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..experiments.bending_scatter import scatter
from ..projects.bend import BendCase, BendProject
from ..reports import (
    BendLine,
    BendPanel,
    BendReadings,
    Report,
    Table,
    percent,
    plot_bending,
    plot_bending_cases,
    plot_gas,
    write_report,
)
from .bend_beam import draw_beam, write_beam
from .bend_measures import PLACES
from .bend_results import BendOutcome

FIGURES, BEAMS = "figures", "beams"
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
    beams = [(f"{BEAMS}/{p.name}", "bent beam, for ParaView") for p in _beams(folder)]
    page = Report(
        title=project.title,
        summary=summary,
        facts=[
            ("cases", len(project.cases)),
            ("cards", len(project.cards)),
            ("solver", project.solver),
            ("wall time, s", float(result["wall_s"])),
            *_common(project.cases),
        ],
        warnings=_warnings(outcome),
        figures=figures,
        tables=[*_statements(outcome), *_runs(outcome), *_errors(outcome)],
        files=[f for f in FILES if f[0] == "result.json" or (folder / f[0]).exists()] + beams,
        versions=result["versions"],
    )
    write_report(folder, page)


def bend_figures(project: BendProject, outcome: BendOutcome, folder: Path) -> list[tuple[str, str]]:
    """Loads, gas and beam of every case, and all loads together."""
    ranks = {name: rank for rank, name in enumerate(project.cards)}
    names = file_names([case.name for case in project.cases])
    panels, figures = {}, []
    for case in project.cases:
        ended = [i for i in outcome.measures if outcome.pairs[i].case is case]
        panels[case.name] = _panel(case, outcome, ended, ranks)
        if not ended:
            continue
        stem = f"{FIGURES}/{names[case.name]}"
        plot_bending(folder / f"{stem}-load.png", panels[case.name])
        plot_gas(folder / f"{stem}-gas.png", panels[case.name])
        first = outcome.pairs[ended[0]]
        drawn = f"{case.name}, {first.name}, {outcome.measures[ended[0]].reached:g} mm"
        draw_beam(first.model(), outcome.runs[ended[0]], folder / f"{stem}-beam.png", drawn)
        figures += [
            (f"{stem}-load.png", f"{case.name}: load over deflection (as Figs 6.12 to 6.20)"),
            (f"{stem}-beam.png", f"{case.name}: the bent beam, card {first.name} (as Fig. 6.10)"),
            (f"{stem}-gas.png", f"{case.name}: the gas while bending (as Fig. 6.11)"),
        ]
        for i, card in zip(ended, file_names([outcome.pairs[i].name for i in ended]).values(),
                           strict=True):  # fmt: skip
            path = folder / BEAMS / f"{names[case.name]}-{card}.vtu"
            write_beam(outcome.pairs[i].model(), outcome.runs[i], path)
    if len([p for p in panels.values() if p.lines]) > 1:
        rows = _rows(project.cases)
        columns = max(map(len, rows))
        laid = [p for row in rows for p in [panels[c.name] for c in row] + _free(columns, row)]
        plot_bending_cases(folder / FIGURES / "all-loads.png", laid, columns)
        figures.insert(0, (f"{FIGURES}/all-loads.png", "Load over deflection, all cases"))
    return figures


def file_names(names: Sequence[str]) -> dict[str, str]:
    """A name for files for each, all different."""
    found: dict[str, str] = {}
    for number, name in enumerate(names, start=1):
        plain = re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or str(number)
        taken = plain.casefold() in (other.casefold() for other in found.values())
        found[name] = f"{plain}-{number}" if taken else plain
    return found


def _free(columns: int, row: Sequence[BendCase]) -> list[BendPanel]:
    return [BendPanel("")] * (columns - len(row))


def _rows(cases: Sequence[BendCase]) -> list[list[BendCase]]:
    """A row a diameter where there are several of them with several pressures."""
    rows: dict[float, list[BendCase]] = {}
    for case in cases:
        rows.setdefault(round(case.diameter, 6), []).append(case)
    if len(rows) > 1 and max(map(len, rows.values())) > 1:
        return list(rows.values())
    flat = list(cases)
    return [flat[i : i + 3] for i in range(0, len(flat), 3)]


def _panel(
    case: BendCase, outcome: BendOutcome, ended: Sequence[int], ranks: Mapping[str, int]
) -> BendPanel:
    lines = []
    for i in ended:
        run, found, name = outcome.runs[i], outcome.measures[i], outcome.pairs[i].name
        rms = None if found.error is None else found.error.rms
        curves = run.deflection, run.load, run.pressure, run.volume
        lines.append(BendLine(name, ranks[name], *curves, found.knee, found.limit, rms))
    measured = None
    if case.measured:
        s = scatter(case.measured)
        # Where a repetition has ended the mean of the others jumps.
        whole = s.count == len(case.measured)
        readings = [(c.deflection, c.load) for c in case.measured]
        measured = BendReadings(
            readings,
            s.deflection,
            np.where(whole, s.mean, np.nan),
            np.where(whole, s.deviation, np.nan),
        )
    return BendPanel(case.name, lines, measured)


def _beams(folder: Path) -> list[Path]:
    return sorted((folder / BEAMS).glob("*.vtu"))


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
    return [Table("What the thesis saw", header, rows)]


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
        buckles = f"{where[1]:.0f} N, {where[0]:.0f} mm ({found.buckling_is})" if where else None
        wrinkles = f"{found.wrinkles[0]:.0f} mm" if found.wrinkles else None
        loads = [None if load is None else f"{load:.0f}" for load in found.loads]
        strain, rise = f"{max(found.body_strain):.3f}", f"{found.pressure_rise:+.2f}"
        stiffness = None if found.stiffness is None else f"{found.stiffness:.2f}"
        rows.append(
            [*head, stiffness, buckles, wrinkles, *loads, strain, rise, outcome.ended(i), seconds]
        )
    at = [f"load at {p:g} mm, N" for p in PLACES]
    header = [
        "case", "card", "stiffness, N/mm", "buckles", "wrinkles from", *at, "inflation strain",
        "pressure, kPa", "ended", "s",
    ]  # fmt: skip
    note = (
        "Stiffness: to 20 mm. Buckles: the limit point where the load falls afterwards, else the "
        "knee, where the slope has fallen to half. Wrinkles: more of the surface than when "
        "inflated. Inflation strain: the largest along warp or fill in the body, without the "
        "quads beside seam and caps. Pressure: its rise to the last frame."
    )
    return [Table("Runs", header, rows, note)]


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
    return [Table("Against measured loads", header, rows, note)]
