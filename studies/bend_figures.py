"""Figures and VTU files of a study of bending."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..experiments.bending_scatter import scatter
from ..projects.bend import BendCase, BendProject
from ..reports import (
    BendLine,
    BendPanel,
    BendReadings,
    plot_bending,
    plot_bending_cases,
    plot_gas,
)
from .bend_beam import draw_beam, write_beam
from .bend_results import BendOutcome

FIGURES, BEAMS = "figures", "beams"


def bend_figures(project: BendProject, outcome: BendOutcome, folder: Path) -> list[tuple[str, str]]:
    """Loads, gas and beam of every case, and all loads together; each with its caption."""
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
    if sum(bool(panel.lines) for panel in panels.values()) > 1:
        rows = _rows(project.cases)
        columns = max(map(len, rows))
        laid = [p for row in rows for p in [panels[c.name] for c in row] + _free(columns, row)]
        plot_bending_cases(folder / FIGURES / "all-loads.png", laid, columns)
        figures.insert(0, (f"{FIGURES}/all-loads.png", "Load over deflection, all cases"))
    return figures


def write_beams(project: BendProject, outcome: BendOutcome, folder: Path) -> list[tuple[str, str]]:
    """The last frame of every run for ParaView; files and what they are."""
    cases = file_names([case.name for case in project.cases])
    cards = file_names(list(project.cards))
    files = []
    for i, found in outcome.measures.items():
        pair = outcome.pairs[i]
        name = f"{BEAMS}/{cases[pair.case.name]}-{cards[pair.name]}.vtu"
        write_beam(pair.model(), outcome.runs[i], folder / name)
        files.append((name, f"the beam at {found.reached:g} mm, for ParaView"))
    return files


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
