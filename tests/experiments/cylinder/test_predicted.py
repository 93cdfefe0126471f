"""experiments/cylinder/predicted.py: numbers, curves and finer models of predicted bending."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.cylinder.measures import CurvePoint
from bubblefit.experiments.cylinder.predicted import STUDIED, measured_table, quantities
from bubblefit.project.project import read_project
from bubblefit.readers.bending import BendingCurve
from bubblefit.runs.refinement import edge_length
from bubblefit.solvers.base import History

from ...builders.bending_results import BENT, MEASURES, case, outcome_of, run
from ...builders.bent_cylinders import STUDIED_PROJECT
from ...support.refusals import complaint


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


def test_band_of_measures_holds_both_ends_and_the_spread_of_loads_by_the_card():
    """The spread grows from nothing to 4 N at 40 mm, and is 8 N from 80 mm on."""
    x = case("x")
    predicted, other = (
        run(x, "soft"),
        run(x, "soft", SimpleNamespace(name="slack", predicted=False)),
    )
    lower = replace(MEASURES, stiffness=4.0, knee=CurvePoint(70.0, 230.0), limit=None)
    bent = {0: BENT, 1: BENT}
    outcome = outcome_of(predicted, other, bent=bent, measures={0: MEASURES, 1: lower})
    outcome.__dict__["spreads"] = {0: np.array([0.0, 4.0, 8.0])}
    at_knee = 1.96 * 4.0 * 61.0 / 40.0
    assert outcome.with_band(0, "knee") == pytest.approx((251.0, 230 - at_knee, 251 + at_knee))
    slope = 1.96 * 2.0 / 20.0
    assert outcome.with_band(0, "stiffness") == pytest.approx((4.256, 4.0 - slope, 4.256 + slope))
    alone = outcome_of(predicted, bent={0: BENT})
    alone.__dict__["spreads"] = {}
    assert alone.with_band(0, "limit") == (502.6,) * 3
    assert outcome.with_band(1, "limit") is None


# Models and quantities of a study
@pytest.fixture
def cylinders(tmp_path):
    path = tmp_path / "project.toml"
    path.write_text(STUDIED_PROJECT)
    return list(read_project(path).tests.values())


def test_refined_cylinders_have_finer_models(cylinders):
    narrow, wide = cylinders
    own, finer = (narrow.models(0.5, "elements", f)["cylinder"] for f in (3.0, 6.0))
    # What lies between seam, collar and supports is a whole number of rows: nearly a half.
    assert edge_length(finer.mesh) == pytest.approx(edge_length(own.mesh) / 2, rel=0.05)
    assert set(np.unique(wide.models(0.5, "elements", 6.0)["cylinder"].thickness)) == {0.5, 1.5}
    # Finer increments keep what is reported.
    own, finer = (narrow.models(0.81, "increments", f)["cylinder"] for f in (1.0, 3.0))
    assert finer.deflections == own.deflections and len(finer.increments) == 12
    assert finer.increments[:3] == pytest.approx([10 / 3, 20 / 3, 10.0])
    assert len(finer.inflation) == 3 * len(own.inflation) and finer.pressure == own.pressure
    np.testing.assert_array_equal(finer.reported, [2, 5, 8, 11])
    assert len(STUDIED.steps(finer)) == 42
    assert "increments" in complaint(narrow.models, 0.81, "increments", 0.5)


def test_quantities_of_a_known_history(cylinders):
    """A cylinder that swells by a tenth, then a load that is straight up to a limit and falls."""
    model = replace(cylinders[0].model(), deflections=np.arange(4.0, 241, 4.0), increments=())
    d = np.array([0.0, *model.deflections])
    moves = np.repeat((0.1 * model.mesh.points * [1, 1, 0])[None], len(d), axis=0)
    load = np.where(d < 120, 3.0 * d, 360.0 - 0.5 * (d - 120))
    history = History(load, moves, np.zeros(3), np.zeros(3), cavity_volume=np.full(len(d), 6.0e7))
    found = quantities(model, history)
    knee = found.pop("load at the knee, N")
    assert found == pytest.approx({
        "radius at mid-span, inflated, mm": 82.5, "volume, inflated, l": 60.0,
        "initial stiffness, N/mm": 3.0, "load at 40 mm, N": 120.0, "load at 100 mm, N": 300.0,
        "load at 240 mm, N": 300.0, "load at the limit point, N": 360.0,
    })  # fmt: skip
    assert 110 < knee / 3.0 < 120
    early = quantities(model, replace(history, load=load[:26], displacement=moves[:26]))
    assert "load at 240 mm, N" in found and "load at 240 mm, N" not in early
    assert "load at the limit point, N" not in early and early["no limit point up to, mm"] == 100.0
    assert "no knee up to, mm" in early and len(early) == len(found)
