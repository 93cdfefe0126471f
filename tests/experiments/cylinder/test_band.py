"""A band of two walls: in the tables of a page, on the terminal, in figures, in names of files."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.cylinder import report as figures
from bubblefit.experiments.cylinder import report as page
from bubblefit.experiments.cylinder.predicted import CylinderOutcome
from bubblefit.experiments.kinds import Output
from bubblefit.reports.bending import BendPanel

from ...cylinder_cases import ENDS
from .test_page import BENT, CURVE, LOAD, WAY, case, run, unbroken
from .test_tables import MEASURES


@pytest.fixture
def outcome() -> CylinderOutcome:
    """Both ends with one card, the prediction alone with another: its other end failed."""
    test, (slack, rigid) = case("150/90", measured=(CURVE, CURVE)), ENDS
    found = CylinderOutcome(
        [
            run(test, "soft", end=slack), run(test, "soft", end=rigid),
            run(test, "hard", end=slack), run(test, "hard", end=rigid, failure="killed"),
        ]
    )  # fmt: skip
    stiff = SimpleNamespace(**(vars(BENT) | {"load": 1.5 * LOAD}))
    found.__dict__["measures"] = dict.fromkeys((0, 1, 2), MEASURES)
    found.__dict__["bent"] = {0: BENT, 1: stiff, 2: BENT}
    return found


def test_every_row_says_which_wall(outcome: CylinderOutcome, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(page, "draw_figures", lambda *_: [])
    monkeypatch.setattr(page, "write_beams", lambda *_: [])
    shown = page.show_outcome(outcome, Output(tmp_path))
    runs, errors = shown.tables
    assert runs.header[:4] == ["test", "card", "wall", "stiffness, N/mm"]
    assert [unbroken(row[1:3]) for row in runs.rows] == [
        ["soft", "slack"], ["soft", "rigid wall"], ["hard", "slack"], ["hard", "rigid wall"]
    ]  # fmt: skip
    assert all(len(row) == len(runs.header) for row in runs.rows)
    assert runs.rows[3][runs.header.index("ended")] == "failed:\u00a0killed"
    assert runs.text == (1, 2, runs.header.index("ended"), runs.header.index("marked"))
    assert runs.note.endswith("stand below. Slack: it wrinkles. Rigid wall: it does not.")
    assert errors.header[:4] == ["test", "card", "wall", "RMS, N"] and errors.text == (1, 2)
    assert [unbroken(row[2:4]) for row in errors.rows] == [
        ["slack", 3.1], ["rigid wall", 3.1], ["slack", 3.1]
    ]  # fmt: skip
    curves = pd.read_csv(tmp_path / "load_deflection.csv")
    assert list(curves.columns[:4]) == ["test", "card", "wall", "deflection_mm"]
    assert curves["wall"].tolist() == ["slack"] * 3 + ["rigid wall"] * 3 + ["slack"] * 3
    assert curves["load_N"].tolist() == [*LOAD, *1.5 * LOAD, *LOAD]


def test_the_terminal_says_which_wall(outcome: CylinderOutcome) -> None:
    head, *rows = outcome.lines()
    assert head.startswith("test    card  wall         N/mm   buckles at")
    assert [row[: head.index("N/mm") - 2].rstrip() for row in rows] == [
        "150/90  soft  slack", "150/90  soft  rigid wall", "150/90  hard  slack",
        "150/90  hard  rigid wall",
    ]  # fmt: skip
    assert rows[3].endswith("failed: killed")


def test_a_line_is_the_prediction_and_its_band_goes_to_the_other_end(
    outcome: CylinderOutcome, tmp_path: Path, monkeypatch
) -> None:
    panels: list[BendPanel] = []
    monkeypatch.setattr(figures, "plot_bending", lambda path, panel: panels.append(panel))
    monkeypatch.setattr(figures, "plot_gas", lambda *_: None)
    beams: list[tuple[str, str]] = []
    monkeypatch.setattr(
        figures, "draw_beam", lambda m, r, path, title: beams.append((path.name, title))
    )
    monkeypatch.setattr(figures, "write_beam", lambda m, r, path: None)
    for one in outcome.runs:
        one.model = None
    shown = dict(figures.draw_figures(outcome, Output(tmp_path)))
    (panel,) = panels
    assert panel.band == "from slack to rigid wall"
    soft, hard = panel.lines
    np.testing.assert_array_equal([soft.deflection, soft.load], [WAY, LOAD])
    assert soft.other is not None and hard.other is None
    np.testing.assert_array_equal(soft.other, [WAY, 1.5 * LOAD])
    assert "figures/150-90-load.png" not in shown  # a chart on the page
    (charts,) = figures.load_charts(outcome)
    assert charts.caption == "Load over deflection; line: slack, dashed: rigid wall"
    (chart,) = charts.charts
    curves = {s.name: s for s in chart.series if s.look == "line"}
    assert list(curves) == ["soft", "soft, other end", "hard"]
    assert curves["soft, other end"].y == pytest.approx(1.5 * LOAD)
    assert curves["soft, other end"].dashes == 1 and curves["soft"].y == pytest.approx(LOAD)
    assert beams == [("150-90-beam.png", "150/90, soft, 80 mm")]
    assert figures.write_beams(outcome, Output(tmp_path)) == [
        ("beams/150-90-soft.vtu", "the beam at 80 mm, for ParaView"),
        ("beams/150-90-soft-rigid-wall.vtu", "the beam at 80 mm, for ParaView (rigid wall)"),
        ("beams/150-90-hard.vtu", "the beam at 80 mm, for ParaView"),
    ]
