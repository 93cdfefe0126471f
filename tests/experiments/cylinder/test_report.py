"""Numbers of made-up runs of cylinders: result.json, tables, the terminal, figures and files."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.cylinder.curve import CurvePoint
from bubblefit.experiments.cylinder.measures import BendingMeasures
from bubblefit.experiments.cylinder.predicted import CylinderOutcome, measured_table
from bubblefit.experiments.cylinder.run import BendingRun
from bubblefit.experiments.output import Output
from bubblefit.notes import SOLVER, Note
from bubblefit.readers.bending import BendingCurve, BendingError
from bubblefit.reports.bending_charts import bending_charts
from bubblefit.reports.kinds import cylinder as report
from bubblefit.reports.kinds.cylinder import figures
from bubblefit.solvers.base import EARLY, SNAP
from bubblefit.solvers.calculix.cylinder import GAS

from ...builders.bent_cylinders import ENDS
from ...support.charts import caught

MEASURES = BendingMeasures(
    stiffness=4.256, loads={"20 mm": 86.4, "a long way": None}, knee=CurvePoint(61.0, 251.0),
    limit=CurvePoint(120.0, 502.6), wrinkles=CurvePoint(33.0, 140.0), straightness=(0.99, 0.02),
    body_strain=(0.011, 0.022), anywhere_strain=(0.033, 0.044), pressure_rise=1.6, reached=150.0,
    error=BendingError(3.1, -1.2, 0.0519, 17, 4),
)  # fmt: skip
WAY, LOAD = np.array([0.0, 40.0, 80.0]), np.array([0.0, 100.0, 90.0])
BENT = BendingRun(
    deflection=WAY, load=LOAD, pressure=np.array([0.1, 0.101, 0.102]),
    volume=np.array([5e7, 4.9e7, 4.8e7]), inflated=np.empty(0), wrinkled=np.array([0.0, 0.1, 0.2]),
    bent=np.empty(0),
)  # fmt: skip
CURVE = BendingCurve("1", WAY, LOAD)


def case(name: str, diameter: float = 150.0, **other: Any) -> SimpleNamespace:
    fields = {
        "name": name, "diameter": diameter, "length": 3000.0, "size": 40.0, "seam_width": 35.0,
        "supports": SimpleNamespace(span=2000.0), "measured": (), "assumed": (),
        "deflections": (80.0, 160.0),
        "reading": SimpleNamespace(places={"20 mm": 20.0, "a long way": 200.0}, slope_over=20.0),
    }  # fmt: skip
    return SimpleNamespace(**(fields | other))


def run(test, card: str, end=None, notes=None, **record: Any) -> SimpleNamespace:
    said = SimpleNamespace(**({"failure": "", "early": "", "seconds": 12.34} | record))
    kinds = (EARLY, SNAP) if said.early else (GAS, SOLVER)
    kinds = kinds if notes is None else notes
    return SimpleNamespace(
        test=test, card=card, notes=tuple(Note(kind, "words") for kind in kinds), record=said,
        end=end, wall=end.name if end else "", predicted=end is None or end.predicted,
        around=None, model=f"model of {test.name}", material=SimpleNamespace(certainty="known"),
    )  # fmt: skip


def outcome_of(*runs, bent=None, measures=None) -> CylinderOutcome:
    found = CylinderOutcome(runs)
    found.__dict__["bent"] = bent or {}
    found.__dict__["measures"] = measures or dict.fromkeys(bent or {}, MEASURES)
    return found


# Numbers


def test_numbers_for_result_json():
    outcome = outcome_of(measures={0: MEASURES, 1: replace(MEASURES, limit=None, error=None)})
    assert outcome.numbers(0) == {
        "reached_mm": 150.0,
        "stiffness_N_per_mm": 4.256,
        "knee": {"deflection_mm": 61.0, "load_N": 251.0},
        "limit_point": {"deflection_mm": 120.0, "load_N": 502.6},
        "wrinkle_onset": {"deflection_mm": 33.0, "load_N": 140.0},
        "load_N": {"20 mm": 86.4, "a long way": None},
        "load_sigma_N": {"20 mm": None, "a long way": None},
        "spread": None,
        "inflation_strain": {
            "body": {"warp": 0.011, "fill": 0.022},
            "with_seam_and_ends": {"warp": 0.033, "fill": 0.044},
        },
        "straight_before_buckling": {"r_squared": 0.99, "largest_deviation": 0.02},
        "pressure_rise_kPa": 1.6,
        "error": {"rms": 3.1, "mean": -1.2, "relative": 0.0519, "compared": 17, "beyond": 4},
    }
    other = outcome.numbers(1)
    none = {"deflection_mm": None, "load_N": None, "none_up_to_mm": 150.0}
    assert other["knee"] == outcome.numbers(0)["knee"] and other["limit_point"] == none
    assert other["error"] is None
    assert outcome.error(0) == 0.0519 and outcome.error(1) is None and outcome.error(2) is None


def test_curves_and_readings():
    """Lists of rows as they go into load_deflection.csv and measured.csv."""
    way = np.array([0.0, 30.0])
    read = [BendingCurve("a", way, np.array([0.0, 58.0])), BendingCurve("b", way, 2.0 * way)]
    x, y, z = case("x", measured=read), case("y"), case("z", measured=read[:1])
    twice = measured_table([x, y, z])
    assert twice.index.tolist() == list(range(2 * 61)) and set(twice["test"]) == {"x", "z"}
    table = measured_table([x, y])
    columns = "test deflection_mm mean_N standard_deviation_N repetitions"
    assert list(table.columns) == columns.split()
    assert len(table) == 61 and set(table["test"]) == {"x"}
    assert table.iloc[30].tolist()[1:] == pytest.approx([15.0, 29.5, np.sqrt(0.5), 2])
    runs = run(x, "soft"), run(x, "soft", failure="killed")
    outcome = outcome_of(*runs, bent={0: replace(BENT, wrinkled=np.empty(0))})
    curve, none = outcome.curve(0), outcome.curve(1)
    columns = "deflection_mm load_N gauge_pressure_kPa volume_mm3 wrinkled_share"
    assert list(curve.columns) == columns.split()
    assert curve.iloc[1].tolist()[:4] == pytest.approx([40.0, 100.0, 101.0, 4.9e7])
    assert curve["wrinkled_share"].isna().all()
    assert list(none.columns) == list(curve.columns) and len(none) == 0


# The page


@pytest.fixture
def undrawn(monkeypatch):
    monkeypatch.setattr(report, "draw_figures", lambda *_: [("a.png", "a picture")])
    monkeypatch.setattr(report, "write_beams", lambda *_: [("b.vtu", "a beam")])


def unbroken(row) -> list[object]:
    return [c.replace("\u00a0", " ") if isinstance(c, str) else c for c in row]


def test_every_cell(tmp_path, undrawn):
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
        ["150/90", "soft card", "4.26", "251 N, 61 mm", "503 N, 120 mm", "33 mm", "86", None,
         "2.2", "+1.60", "finished", None, 2, 12.3],
        ["150/90", "stiff", *[None] * 8, "failed: killed", None, 2, 12.3],
        ["the wide one", "soft card", None, "251 N, 61 mm", "none up to 150 mm", None, "86", None,
         "2.2", "-0.13", stopped, "snap, stopped early", 2, 12.3],
    ]  # fmt: skip
    assert "\u00a0" in str(runs.rows[0][3]) and runs.rows[2][10] == stopped  # which is broken
    assert runs.note.count("20 mm") == 2 and runs.text == (1, 10, 11)
    assert errors.rows == [["150/90", "soft\u00a0card", 3.1, "5.2\u00a0%", "-1.2", 17, 4]]
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


# Figures


def test_names_of_files_differ_whatever_the_tests_are_called():
    found = figures.file_names(["150 mm, 90 kPa", "150 mm; 90 kPa", "150 MM 90 kpa", "???", "-x."])
    assert list(found.values()) == [
        "150-mm-90-kPa", "150-mm-90-kPa-2", "150-MM-90-kpa-3", "4", "x"
    ]  # fmt: skip


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Any]]:
    calls: dict[str, list[Any]] = {"draw_beam": [], "write_beam": []}
    for name, found in calls.items():
        monkeypatch.setattr(figures, name, lambda *what, own=found: own.append(what))
    return {**calls, "saved": caught(monkeypatch, figures, "bending_charts", "gas_charts")}


# A band: both ends with one card, the prediction alone with another, whose other end failed


@pytest.fixture
def banded() -> CylinderOutcome:
    test, (slack, rigid) = case("150/90", measured=(CURVE, CURVE)), ENDS
    return outcome_of(
        run(test, "soft", slack), run(test, "soft", rigid),
        run(test, "hard", slack), run(test, "hard", rigid, failure="killed"),
        bent={0: BENT, 1: replace(BENT, load=1.5 * LOAD), 2: BENT},
    )  # fmt: skip


def test_it_opens_with_stiffness_and_knee_and_their_bands(banded, tmp_path, undrawn):
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
    assert unbroken(first.rows[0][7:]) == ["503", None, "120"]  # the spread ends before it
    assert unbroken(first.rows[1][2:]) == [
        "4.26", None, "none up to 150 mm", None, None, "503", None, "120"
    ]  # fmt: skip
    assert "stiffness 4.26" in shown.summary.split(";")[0]
    assert "251" in shown.summary.split(";")[0] and "61 mm" in shown.summary
    assert "knee none up to 150 mm, limit point at 503 N and 120 mm" in unbroken([shown.summary])[0]


def test_a_line_is_the_prediction_and_its_band_goes_to_the_other_end(
    banded, tmp_path, drawn, monkeypatch
):
    shown = dict(figures.draw_figures(banded, Output(tmp_path)))
    soft, hard = drawn["saved"][0][1][0].lines
    np.testing.assert_array_equal([soft.deflection, soft.load], [WAY, LOAD])
    assert hard.other is None
    np.testing.assert_array_equal(soft.other, [WAY, 1.5 * LOAD])
    assert "figures/150-90-load.png" not in shown  # a chart on the page
    ((*_, path, title),) = drawn["draw_beam"]
    assert (path.name, title) == ("150-90-beam.png", "150/90, soft, 80 mm")
    names = [name for name, _ in figures.write_beams(banded, Output(tmp_path))]
    beams = ("soft", "soft-rigid-wall", "hard")
    assert names == [f"beams/150-90-{name}.vtu" for name in beams]
    monkeypatch.setattr(figures, "bending_charts", bending_charts)
    (charts,) = figures.load_charts(banded)
    assert charts.caption == "Load over deflection; line: slack, dashed: rigid wall"
    (chart,) = charts.charts
    curves = {s.name: s for s in chart.series if s.look == "line"}
    assert list(curves) == ["mean", "soft", "soft, other end", "hard"]
    assert curves["soft, other end"].y == pytest.approx(1.5 * LOAD)
    assert curves["soft, other end"].dashes == 1 and curves["soft"].y == pytest.approx(LOAD)
