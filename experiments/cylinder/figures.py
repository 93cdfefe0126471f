"""Figures and VTU files of bent cylinders."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...data.bending_scatter import scatter
from ...materials.certainty import BAND, LEVEL
from ...reports import (
    BendLine,
    BendPanel,
    BendReadings,
    Charts,
    plot_bending,
    plot_bending_cases,
    plot_gas,
)
from ...reports.bending_charts import bending_charts
from ..exhibit import Output, Shown
from .beam import draw_beam, write_beam
from .test import CylinderTest

if TYPE_CHECKING:
    from .outcome import CylinderOutcome

FIGURES, BEAMS = "figures", "beams"


def draw_figures(outcome: CylinderOutcome, out: Output) -> list[Shown]:
    """Loads, gas and beam of every test, and all loads together, as pictures.

    Returns
    -------
    Those that the page shows, each with its caption: the loads are charts there.
    """
    tests = tests_of(outcome)
    cards = list(dict.fromkeys(run.card for run in outcome.runs))
    ranks = {card: rank for rank, card in enumerate(cards)}
    names = file_names([test.name for test in tests])
    panels, figures = {}, []
    for test in tests:
        ended = _ended(test, outcome)
        panels[test.name] = _panel(test, outcome, ended, ranks)
        if not ended:
            continue
        stem = f"{FIGURES}/{names[test.name]}"
        plot_bending(out.path(f"{stem}-load.png"), panels[test.name])
        plot_gas(out.path(f"{stem}-gas.png"), panels[test.name])
        first, run = outcome.runs[ended[0]], outcome.bent[ended[0]]
        drawn = f"{test.name}, {first.card}, {run.deflection[-1]:g} mm"
        draw_beam(first.model, run, out.path(f"{stem}-beam.png"), drawn)
        figures += [
            (out.name(f"{stem}-beam.png"), f"{test.name}: the bent beam, card {first.card}"),
            (out.name(f"{stem}-gas.png"), f"{test.name}: the gas while bending"),
        ]
    if sum(bool(panel.lines) for panel in panels.values()) > 1:
        rows = _rows(tests)
        columns = max(map(len, rows))
        laid = [p for row in rows for p in [panels[t.name] for t in row] + _free(columns, row)]
        plot_bending_cases(out.path(f"{FIGURES}/all-loads.png"), laid, columns)
    return figures


def load_charts(outcome: CylinderOutcome) -> list[Charts]:
    """Load over deflection of every test; nothing where no run came to an end."""
    cards = list(dict.fromkeys(run.card for run in outcome.runs))
    ranks = {card: rank for rank, card in enumerate(cards)}
    tests = tests_of(outcome)
    panels = [_panel(test, outcome, _ended(test, outcome), ranks) for test in tests]
    if not any(panel.lines for panel in panels):
        return []
    caption = f"Load over deflection{_walls(outcome)}"
    if outcome.spreads:
        caption += f". Shaded: {panels[0].spread}"
    return [bending_charts(panels, caption)]


def write_beams(outcome: CylinderOutcome, out: Output) -> list[Shown]:
    """The last frame of every run for ParaView; files and what they are."""
    tests = file_names([test.name for test in tests_of(outcome)])
    cards = file_names(list(dict.fromkeys(run.card for run in outcome.runs)))
    files = []
    for i, bent in outcome.bent.items():
        run = outcome.runs[i]
        wall = "" if run.predicted else f"-{file_names([run.wall])[run.wall]}"
        name = f"{BEAMS}/{tests[run.test.name]}-{cards[run.card]}{wall}.vtu"
        write_beam(run.model, bent, out.path(name))
        what = f"the beam at {bent.deflection[-1]:g} mm, for ParaView"
        files.append((out.name(name), what if run.predicted else f"{what} ({run.wall})"))
    return files


def tests_of(outcome: CylinderOutcome) -> list[CylinderTest]:
    """The tests of the runs, each once."""
    return list({id(run.test): run.test for run in outcome.runs}.values())


def file_names(names: Sequence[str]) -> dict[str, str]:
    """A name for files for each, all different."""
    files: dict[str, str] = {}
    for number, name in enumerate(names, start=1):
        plain = re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or str(number)
        taken = plain.casefold() in (other.casefold() for other in files.values())
        files[name] = f"{plain}-{number}" if taken else plain
    return files


def _walls(outcome: CylinderOutcome) -> str:
    """For a caption: what lines and bands are."""
    if len(outcome.band) < 2:
        return ""
    predicted, *others = (end.name for end in outcome.band)
    return f"; line: {predicted}, dashed: {', '.join(others)}"


def _free(columns: int, row: Sequence[CylinderTest]) -> list[BendPanel]:
    return [BendPanel("")] * (columns - len(row))


def _rows(tests: Sequence[CylinderTest]) -> list[list[CylinderTest]]:
    """A row a diameter where there are several of them with several pressures."""
    rows: dict[float, list[CylinderTest]] = {}
    for test in tests:
        rows.setdefault(round(test.diameter, 6), []).append(test)
    if len(rows) > 1 and max(map(len, rows.values())) > 1:
        return list(rows.values())
    flat = list(tests)
    return [flat[i : i + 3] for i in range(0, len(flat), 3)]


def _ended(test: CylinderTest, outcome: CylinderOutcome) -> list[int]:
    """The runs of a test that did not fail, of what the solver predicts."""
    own = [i for i in outcome.bent if outcome.runs[i].test is test]
    return [i for i in own if outcome.runs[i].predicted]


def _panel(
    test: CylinderTest, outcome: CylinderOutcome, ended: Sequence[int], ranks: Mapping[str, int]
) -> BendPanel:
    lines = []
    for i in ended:
        run, m, card = outcome.bent[i], outcome.measures[i], outcome.runs[i].card
        rms = None if m.error is None else m.error.rms
        curves = run.deflection, run.load, run.pressure, run.volume
        other = outcome.other_end(i)
        band = None if other is None else (other.deflection, other.load)
        sure = outcome.spreads.get(i)
        off = None if sure is None or np.isnan(sure).all() else BAND * sure
        lines.append(BendLine(card, ranks[card], *curves, m.knee, m.limit, rms, band, off))
    measured = None
    if test.measured:
        s = scatter(test.measured)
        # Where a repetition has ended the mean of the others jumps.
        whole = s.count == len(test.measured)
        readings = [(c.deflection, c.load) for c in test.measured]
        measured = BendReadings(
            readings,
            s.deflection,
            np.where(whole, s.mean, np.nan),
            np.where(whole, s.deviation, np.nan),
        )
    names = [end.name for end in outcome.band]
    walls = f"from {' to '.join(names)}" if names else ""
    return BendPanel(test.name, lines, measured, walls, f"{100 * LEVEL:g} % by the card")
