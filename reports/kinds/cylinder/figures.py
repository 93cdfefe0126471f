"""Figures of bent cylinders: load over deflection, pressure of the gas, and the bent beams."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....experiments.cylinder.predicted import CylinderOutcome
from ....experiments.cylinder.test import CylinderTest
from ....experiments.data_files import CaptionedFile, Output
from ....materials.card import BAND, LEVEL
from ....meshes.beam_model import BeamModel
from ....readers.bending import scatter
from ...bending_charts import COLLAR_DEFLECTION, BendLine, BendPanel, bending_charts, gas_charts
from ...charts import Charts
from ...vega import save
from .beam import draw_beam, write_beam

#: Folders of the output.
FIGURES = "figures"
BEAMS = "beams"


def draw_figures(outcome: CylinderOutcome, out: Output) -> list[CaptionedFile]:
    """Draw loads, gas and beam of every test, and the loads of all tests in one picture.

    Returns
    -------
    list of (str, str)
        Pictures that the page shows, with their captions.
    """
    tests = tests_of(outcome)
    names = file_names([test.name for test in tests])
    panels = {test.name: _panel(test, outcome) for test in tests}
    figures = []
    for test in tests:
        numbers = _predicted_runs(test, outcome)
        if not numbers:
            continue
        stem = f"{FIGURES}/{names[test.name]}"
        panel = panels[test.name]
        save(out.path(f"{stem}-load.png"), bending_charts([panel], misses=True, columns=1))
        save(out.path(f"{stem}-gas.png"), gas_charts(panel))
        first = outcome.runs[numbers[0]]
        run = outcome.bent[numbers[0]]
        title = f"{test.name}, {first.card}, {run.deflection[-1]:g} mm"
        draw_beam(first.model, run, out.path(f"{stem}-beam.png"), title)
        figures += [
            (out.name(f"{stem}-beam.png"), f"{test.name}: the bent beam, card {first.card}"),
            (out.name(f"{stem}-gas.png"), f"{test.name}: the gas while bending"),
        ]
    if sum(bool(panel.lines) for panel in panels.values()) > 1:
        rows = _rows_of_panels(tests)
        columns = max(map(len, rows))
        grid = [
            panels[row[k].name] if k < len(row) else BendPanel("")
            for row in rows
            for k in range(columns)
        ]
        save(out.path(f"{FIGURES}/all-loads.png"), bending_charts(grid, columns=columns))
    return figures


def _rows_of_panels(tests: Sequence[CylinderTest]) -> list[Sequence[CylinderTest]]:
    """Return the tests in rows of charts.

    Where several diameters are tested at several pressures each row has one diameter, else a row
    has three tests.
    """
    by_diameter: dict[float, list[CylinderTest]] = {}
    for test in tests:
        by_diameter.setdefault(round(test.diameter, 6), []).append(test)
    rows = list(by_diameter.values())
    if len(rows) == 1 or max(map(len, rows)) == 1:
        return [tests[i : i + 3] for i in range(0, len(tests), 3)]
    return list(rows)


def load_charts(outcome: CylinderOutcome) -> list[Charts]:
    """Return charts of load over deflection of every test; none where no run ended."""
    panels = [_panel(test, outcome) for test in tests_of(outcome)]
    if not any(panel.lines for panel in panels):
        return []
    caption = "Load over deflection"
    if len(outcome.band) > 1:
        predicted, *ends = (end.name for end in outcome.band)
        caption += f"; line: {predicted}, dashed: {', '.join(ends)}"
    if outcome.spreads:
        caption += f". Shaded: {panels[0].spread}"
    return [bending_charts(panels, caption)]


def write_beams(outcome: CylinderOutcome, out: Output) -> list[CaptionedFile]:
    """Write the last deflection of every run for ParaView; return the files' descriptions."""
    tests = file_names([test.name for test in tests_of(outcome)])
    cards = file_names(list(dict.fromkeys(run.card for run in outcome.runs)))
    files = []
    for i, bent in outcome.bent.items():
        run = outcome.runs[i]
        description = f"the beam at {bent.deflection[-1]:g} mm, for ParaView"
        wall = ""
        if not run.predicted:
            wall = f"-{file_names([run.wall])[run.wall]}"
            description += f" ({run.wall})"
        name = f"{BEAMS}/{tests[run.test.name]}-{cards[run.card]}{wall}.vtu"
        write_beam(run.model, bent, out.path(name))
        files.append((out.name(name), description))
    return files


def tests_of(outcome: CylinderOutcome) -> list[CylinderTest]:
    """Return the tests of the runs, each once."""
    return list({id(run.test): run.test for run in outcome.runs}.values())


def file_names(names: Sequence[str]) -> dict[str, str]:
    """Return a name for files, without suffix, for each name; no two are the same."""
    files: dict[str, str] = {}
    for number, name in enumerate(names, start=1):
        plain = re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or str(number)
        is_used = plain.casefold() in (file.casefold() for file in files.values())
        files[name] = f"{plain}-{number}" if is_used else plain
    return files


def _predicted_runs(test: CylinderTest, outcome: CylinderOutcome) -> list[int]:
    """Return the indices of a test's runs that are the prediction itself and did not fail."""
    runs = outcome.runs
    return [i for i in outcome.bent if runs[i].test is test and runs[i].predicted]


def _panel(test: CylinderTest, outcome: CylinderOutcome) -> BendPanel:
    """Return the content of a test's chart: curves of all cards, and what was measured."""
    cards = list(dict.fromkeys(run.card for run in outcome.runs))
    lines = []
    for i in _predicted_runs(test, outcome):
        run = outcome.bent[i]
        m = outcome.measures[i]
        card = outcome.runs[i].card
        other_number = outcome.other_end(i)
        other_end = None if other_number is None else outcome.bent[other_number]
        sigma = outcome.spreads.get(i)
        bend_line = BendLine(
            name=card,
            rank=cards.index(card),
            deflection=run.deflection,
            load=run.load,
            pressure=run.pressure,
            volume=run.volume,
            knee=m.knee,
            limit=m.limit,
            rms=None if m.error is None else m.error.rms,
            other_limit=None if other_end is None else (other_end.deflection, other_end.load),
            half_band=None if sigma is None or np.isnan(sigma).all() else BAND * sigma,
        )
        lines.append(bend_line)
    measured = None
    if test.measured:
        spread = scatter(test.measured)
        # The mean is drawn only where all repetitions have readings: elsewhere it would jump.
        is_complete = spread.count == len(test.measured)
        measured = replace(
            spread,
            mean=np.where(is_complete, spread.mean, np.nan),
            deviation=np.where(is_complete, spread.deviation, np.nan),
        )
    is_beam = any(isinstance(run.model, BeamModel) for run in outcome.runs if run.test is test)
    return BendPanel(
        title=test.name,
        lines=lines,
        readings=test.measured,
        measured=measured,
        spread=f"{100 * LEVEL:g} % by the card",
        along="deflection of mid-span, mm" if is_beam else COLLAR_DEFLECTION,
    )
