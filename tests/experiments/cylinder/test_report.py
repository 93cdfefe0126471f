"""Numbers of made-up runs of cylinders: result.json, tables, the terminal, figures and files."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.cylinder.predicted import measured_table
from bubblefit.readers.bending import BendingCurve

from ...builders.bending_results import BENT, MEASURES, case, outcome_of, run


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
