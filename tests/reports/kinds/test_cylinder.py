"""reports/kinds/cylinder: lines and tables of bent cylinders, stiffness, knee and bands."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.cylinder.measures import CurvePoint
from bubblefit.experiments.data_files import Output
from bubblefit.reports.kinds import cylinder
from bubblefit.reports.kinds.cylinder import assumptions, figures, how_sure

from ...builders.bending_results import BENT, CURVE, MEASURES, WAY, case, outcome_of, run


def outcome(spreads=None, unsure=(), band=("wall",)):
    ends = [SimpleNamespace(name=name, meaning=f"meaning of {name}") for name in band]
    bent = [SimpleNamespace(load=np.array([10.0, 200.0])) for _ in range(2)]
    return SimpleNamespace(spreads=spreads or {}, bent=bent, unsure=unsure, band=ends)


def cylinders(*assumed):
    return [SimpleNamespace(name=f"tube {k}", assumed=words) for k, words in enumerate(assumed, 1)]


def test_spread_of_cards_is_the_largest_share_of_the_load():
    spreads = {0: np.array([1.0, 20.0, np.nan]), 1: np.array([np.nan, np.nan])}
    (line,) = how_sure(outcome(spreads))
    assert "up to 10 % of the largest (one standard deviation)" in line


def test_runs_without_spread_have_no_sentence():
    assert how_sure(outcome({1: np.array([np.nan])})) == []


def test_walls_of_the_band_and_doubts_are_named():
    lines = how_sure(outcome(unsure=["the knee is uncertain"], band=("slack", "rigid")))
    assert lines[0] == "The knee is uncertain."
    assert "slack: meaning of slack; rigid: meaning of rigid" in lines[1]


def test_assumptions_are_one_list_that_names_tests_unless_all_share_it():
    head, listed = assumptions(cylinders(["collar", "seam"], ["collar"]))
    assert head.lines == ["Assumed, as the project does not say:"] and listed.bulleted
    assert listed.lines == ["the usual collar", "the usual seam, for tube 1"]
    assert assumptions(cylinders([])) == []


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        (
            ["high", "soft", 40, "38 to 42", 300, "", 20, "none", "", ""],
            "high, soft: stiffness 40 (38 to 42) N/mm, knee at 300 N and 20 mm, limit point none",
        ),
        (
            ["high", "soft", 40, "", 300, "290 to 310", 20, 500, "", 90],
            "high, soft: stiffness 40 N/mm, knee at 300 (290 to 310) N and 20 mm, "
            "limit point at 500 N and 90 mm",
        ),
    ],
)
def test_row_of_stiffness_and_knee_is_a_sentence(row, sentence):
    assert cylinder._sentence(row) == sentence


# The page
@pytest.fixture
def undrawn(monkeypatch):
    monkeypatch.setattr(cylinder, "draw_figures", lambda *_: [("a.png", "a picture")])
    monkeypatch.setattr(cylinder, "write_beams", lambda *_: [("b.vtu", "a beam")])


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
    shown = cylinder.CylinderPresenter().show_outcome(outcome, Output(tmp_path / "out", "c/"))
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
    shown = cylinder.CylinderPresenter().show_outcome(banded, Output(tmp_path))
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
