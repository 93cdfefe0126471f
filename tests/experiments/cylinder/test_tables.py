"""Numbers of made-up runs of cylinders: in result.json, the table of runs and on the terminal."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.cylinder.predicted import (
    BendingMeasures,
    BendingRun,
    CylinderOutcome,
    columns_of,
    curve_of,
    measured_table,
    terminal_table,
)
from bubblefit.notes import Note, NoteKind
from bubblefit.readers.bending import BendingCurve, BendingError

MEASURES = BendingMeasures(
    stiffness=4.256,
    loads={"20 mm": 86.4, "a long way": None},
    knee=(61.0, 251.0),
    limit=(120.0, 502.6),
    wrinkles=(33.0, 140.0),
    straightness=(0.99, 0.02),
    body_strain=(0.011, 0.022),
    anywhere_strain=(0.033, 0.044),
    pressure_rise=1.6,
    reached=150.0,
    error=BendingError(3.1, -1.2, 0.0519, 17, 4),
)


def run(name: str, card: str, early: str = "", *kinds: NoteKind):
    test = SimpleNamespace(
        name=name, reading=SimpleNamespace(places={"20 mm": 20.0, "a long way": 200.0})
    )
    notes = tuple(Note(kind, "words") for kind in kinds)
    said = SimpleNamespace(early=early)
    return SimpleNamespace(test=test, card=card, notes=notes, record=said, wall="")


def test_numbers_for_result_json() -> None:
    outcome = CylinderOutcome(())
    outcome.__dict__["measures"] = {0: MEASURES, 1: replace(MEASURES, limit=None, error=None)}
    found = outcome.numbers(0)
    assert found == {
        "reached_mm": 150.0,
        "stiffness_N_per_mm": 4.256,
        "buckling": {"is": "limit point", "deflection_mm": 120.0, "load_N": 502.6},
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
    assert other["buckling"] == {"is": "knee", "deflection_mm": 61.0, "load_N": 251.0}
    assert other["limit_point"] == {"deflection_mm": None, "load_N": None}
    assert other["error"] is None
    assert outcome.error(0) == 0.0519 and outcome.error(1) is None and outcome.error(2) is None


def test_a_row_of_the_table_of_runs() -> None:
    row = columns_of(MEASURES, ["20 mm", "a long way"])
    assert row == {
        "stiffness_N_per_mm": 4.256,
        "knee_mm": 61.0, "knee_N": 251.0, "limit_mm": 120.0, "limit_N": 502.6,
        "wrinkles_mm": 33.0, "wrinkles_N": 140.0,
        "load_at_20_mm_N": 86.4, "load_at_a_long_way_N": None,
        "inflation_warp_strain": 0.011, "inflation_fill_strain": 0.022,
        "pressure_rise_kPa": 1.6,
        "rms_N": 3.1, "rms_relative": 0.0519, "mean_error_N": -1.2, "compared": 17,
        "reached_mm": 150.0,
    }  # fmt: skip
    empty = columns_of(None, ["20 mm", "a long way"])
    assert list(empty) == list(row) and set(empty.values()) == {None}


def test_curves_and_readings() -> None:
    """Lists of rows as they go into load_deflection.csv and measured.csv."""
    way = np.array([0.0, 30.0])
    read = [BendingCurve("a", way, np.array([0.0, 58.0])), BendingCurve("b", way, 2.0 * way)]
    tests = [SimpleNamespace(name="x", measured=read), SimpleNamespace(name="y", measured=())]
    twice = measured_table([*tests, SimpleNamespace(name="z", measured=read[:1])])
    assert twice.index.tolist() == list(range(2 * 61)) and set(twice["test"]) == {"x", "z"}
    table = measured_table(tests)
    assert list(table.columns) == [
        "test", "deflection_mm", "mean_N", "standard_deviation_N", "repetitions"
    ]  # fmt: skip
    assert len(table) == 61 and set(table["test"]) == {"x"}
    assert table.iloc[30].tolist()[1:] == pytest.approx([15.0, 29.5, np.sqrt(0.5), 2])
    assert list(measured_table(tests[1:]).columns) == list(table.columns)
    bent = BendingRun(
        way, np.array([0.0, 60.0]), np.array([0.1, 0.102]), np.array([5e7, 4e7]),
        np.empty(0), np.empty(0), np.empty(0),
    )  # fmt: skip
    curve = curve_of(bent)
    assert list(curve.columns) == [
        "deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3", "wrinkled_share"
    ]  # fmt: skip
    assert curve.iloc[1].tolist()[:4] == pytest.approx([30.0, 60.0, 102.0, 4e7])
    assert curve["wrinkled_share"].isna().all()
    assert list(curve_of(None).columns) == list(curve.columns) and len(curve_of(None)) == 0


def test_the_terminals_table() -> None:
    runs = [
        run("150/140", "soft", "", NoteKind.SNAP, NoteKind.GAS),
        run("200", "a stiff card"),
        run("250", "soft", "no equilibrium"),
    ]
    dull = replace(MEASURES, limit=None, knee=None, stiffness=None, error=None)
    ended = ["finished", "failed: killed", "stopped at 90 of 150 mm: no equilibrium"]
    lines = terminal_table(runs, {0: MEASURES, 2: dull}, ended)
    assert lines == [
        "test     card           N/mm   buckles at    20 mm  a long way   error",
        "150/140  soft           4.26  503 N 120 mm     86 N           -   5.2 %  [snap]",
        "200      a stiff card  failed: killed",
        "250      soft              -             -     86 N           -       -"
        "  stopped at 90 of 150 mm: no equilibrium",
    ]
    lines = terminal_table(runs[2:], {0: dull}, ended[2:])
    assert "error" not in lines[0] and lines[0].endswith("a long way")


@pytest.mark.parametrize(("limit", "knee", "word"), [(1, 1, "limit point"), (0, 1, "knee")])
def test_what_buckling_is(limit: int, knee: int, word: str) -> None:
    found = replace(
        MEASURES, limit=(9.0, 1.0) if limit else None, knee=(8.0, 2.0) if knee else None
    )
    assert found.buckling_is == word
    assert found.buckling == ((9.0, 1.0) if limit else (8.0, 2.0))
    assert replace(found, limit=None, knee=None).buckling_is == "none"
