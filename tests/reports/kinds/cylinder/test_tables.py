"""Tables of bent cylinders: every cell, stiffness, knee and bands on the terminal."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.cylinder.curve import CurvePoint
from bubblefit.experiments.data_files import Output
from bubblefit.reports.kinds import cylinder as report
from bubblefit.reports.kinds.cylinder import figures

from ....builders.bending_results import BENT, CURVE, MEASURES, WAY, case, outcome_of, run


# The page
@pytest.fixture
def undrawn(monkeypatch):
    monkeypatch.setattr(report, "draw_figures", lambda *_: [("a.png", "a picture")])
    monkeypatch.setattr(report, "write_beams", lambda *_: [("b.vtu", "a beam")])


def unbroken(row) -> list[object]:
    return [c.replace("\u00a0", " ") if isinstance(c, str) else c for c in row]


def test_every_cell_of_the_tables_is_its_number(tmp_path, undrawn):
    first, second = case("150/90", measured=(CURVE, CURVE)), case("the wide one", 200.0)
    stopped = "no equilibrium within the smallest step"
    knee = replace(
        MEASURES, limit=None, wrinkles=None, stiffness=None, error=None, pressure_rise=-0.126
    )
    outcome = outcome_of(
        run(first, "soft card"), run(first, "stiff", failure="killed"),
        run(second, "soft card", early=stopped),
        bent={0: BENT, 2: BENT}, measures={0: MEASURES, 2: knee},
    )  # fmt: skip
    shown = report.CylinderPresenter().show_outcome(outcome, Output(tmp_path / "out", "c/"))
    assert shown.figures == [("a.png", "a picture")]
    names = [name for name, _ in shown.files]
    assert names == ["c/load_deflection.csv", "c/measured.csv", "b.vtu"]
    runs, errors = shown.tables
    stopped = f"stopped at 80 of 160 mm: {stopped}"
    assert [unbroken(row) for row in runs.rows] == [
        ["150/90", "soft card", "4.26", "251 N, 61 mm", "503 N, 120 mm", "33 mm", "86",
         "2.2", "+1.60", "finished", None, 2, 12.3],
        ["150/90", "stiff", *[None] * 7, "failed: killed", None, 2, 12.3],
        ["the wide one", "soft card", None, "251 N, 61 mm", "none up to 150 mm", None, "86",
         "2.2", "-0.13", stopped, "snap, stopped early", 2, 12.3],
    ]  # fmt: skip
    assert runs.rows[2][9] == stopped
    assert runs.note.count("20 mm") == 2 and runs.text == [1, 9, 10]
    assert errors.rows == [["150/90", "soft card", 3.1, "5.2 %", "-1.2", 17, 4]]
    curves = pd.read_csv(tmp_path / "out" / "c" / "load_deflection.csv")
    assert list(curves.columns) == ["test", "card", "wall", *outcome.curve(0).columns]
    assert curves["test"].tolist() == ["150/90"] * 3 + ["the wide one"] * 3
    assert curves["gauge_pressure_kPa"].tolist() == pytest.approx([100.0, 101.0, 102.0] * 2)
    assert curves["wrinkled_share"].tolist() == [0.0, 0.1, 0.2] * 2
    measured = pd.read_csv(tmp_path / "out" / "c" / "measured.csv")
    assert set(measured["test"]) == {"150/90"} and set(measured["repetitions"]) == {2}
    assert measured["mean_N"].max() == pytest.approx(100.0, rel=0.02)
    assert measured["standard_deviation_N"].abs().max() < 1e-9
    assert [test.name for test in figures.tests_of(outcome)] == ["150/90", "the wide one"]


def test_page_opens_with_stiffness_and_knee_and_their_bands(banded, tmp_path, undrawn):
    """1 sigma of 8 N at 20 mm and 4 N at the knee; the rigid wall is 5 N/mm and 300 N."""
    sigma = np.interp(WAY, [0.0, 40.0, 61.0, 80.0], [0.0, 16.0, 4.0, 4.0])
    rigid = replace(MEASURES, stiffness=5.0, knee=CurvePoint(50.0, 300.0))
    banded.__dict__["measures"] = {0: MEASURES, 1: rigid, 2: replace(MEASURES, knee=None)}
    banded.__dict__["spreads"] = {0: sigma}
    off = 1.96 * np.array([8.0 / 20.0, np.interp(61.0, WAY, sigma)])
    found = banded.with_band(0, "stiffness"), banded.with_band(0, "knee")
    assert found[0] == pytest.approx((4.256, 4.256 - off[0], 5.0 + off[0]))
    assert found[1] == pytest.approx((251.0, 251.0 - off[1], 300.0 + off[1]))
    assert banded.with_band(2, "knee") is None and banded.with_band(3, "stiffness") is None
    shown = report.CylinderPresenter().show_outcome(banded, Output(tmp_path))
    first = shown.parts[0]
    assert first.title == "Stiffness, knee and limit point" and len(first.rows) == 2
    low, high = 4.256 - off[0], 5.0 + off[0]
    assert unbroken(first.rows[0][2:4]) == ["4.26", f"{low:.3g} to {high:.3g}"]
    assert unbroken(first.rows[0][7:]) == ["503", "120"]  # the spread ends before it
    assert unbroken(first.rows[1][2:]) == [
        "4.26", None, "none up to 150 mm", None, None, "503", "120"
    ]  # fmt: skip
    assert "stiffness 4.26" in shown.summary.split(";")[0]
    assert "251" in shown.summary.split(";")[0] and "61 mm" in shown.summary
    assert "knee none up to 150 mm, limit point at 503 N and 120 mm" in unbroken([shown.summary])[0]
