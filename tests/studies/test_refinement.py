"""Runs on finer and finer meshes: what is compared, what fails, what is written."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, Note, SolverFailure
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, refined_quads, straight_strip, strip_mesh
from bubblefit.reports.study_pages import panels
from bubblefit.runs.refinement import (
    RMS,
    Level,
    LevelRun,
    Refinement,
    convergence,
    edge_length,
    observed_order,
    refine,
    richardson,
    rms_between,
    rms_changes,
)
from bubblefit.runs.simulation import FAILED, Step
from bubblefit.solvers.base import SNAP
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ..bars import STRETCH, WIDTH, BarTest, project_of
from ..drawings import data
from ..page_charts import charts_of

CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")
EXACT = 600.0 * np.log1p(STRETCH) * np.exp(-0.24 * np.log1p(STRETCH)) * 0.5 * WIDTH
END = "load at the end, N"


def test_curves_are_compared_where_the_coarse_one_has_points():
    coarse = np.array([1.0, 2.0]), np.array([2.0, 4.0])
    fine = np.array([0.5, 1.0, 1.5, 2.0]), np.array([9.0, 2.5, 9.0, 4.5])
    assert rms_between(coarse, fine) == pytest.approx(0.5)
    # The origin is part of a curve.
    assert rms_between((np.array([0.5]), np.array([1.0])), coarse) == pytest.approx(0.0, abs=1e-15)


def test_a_run_that_stops_early_is_compared_up_to_there():
    x = np.array([1.0, 2.0, 3.0])
    assert rms_between((x, 2 * x), (x[:2], 2 * x[:2])) == pytest.approx(0.0, abs=1e-15)


def test_edge_length():
    assert edge_length(strip_mesh(20.0, 40.0, 4, 8)) == pytest.approx(5.0)
    disk = disk_mesh(100.0, 800, "quarter")
    assert edge_length(disk) ** 2 * len(disk.quads) == pytest.approx(0.25e4 * np.pi, rel=2e-3)


def test_strips_and_their_refinements():
    for strip, make in (("straight", lambda **q: straight_strip("warp", 20.0, 22.0, 0.8, **q)),
                        ("bias", lambda **q: bias_strip(20.0, 24.0, 0.8, **q))):  # fmt: skip
        plain, same = make(), make(**refined_quads(strip, 1.0))
        assert len(plain.mesh.quads) == len(same.mesh.quads)
        assert len(make(**refined_quads(strip, 2.0)).mesh.quads) == 4 * len(plain.mesh.quads)
        for factor in (1 / 16, 1 / 4, 1 / 2, 3.0):
            assert len(make(**refined_quads(strip, factor)).mesh.quads)


def test_order_and_limit_of_a_known_error(bars):
    steps: list[Step] = []
    study = refine(project_of(BarTest("a bar")), CARD, progress=steps.append)
    (name,) = study.runs
    quantity = study.result["models"][name]["quantities"][END]
    assert name == "a bar" and quantity["order"] == pytest.approx(2.0, abs=1e-6)
    assert quantity["limit"] == pytest.approx(EXACT, rel=1e-9)
    assert quantity["own_error"] == pytest.approx(0.01 / 4**2, rel=1e-6)
    assert [run.level.elements for run in study.runs[name]] == [8, 32, 128, 512]
    assert [run.level.factor for run in study.runs[name]] == [0.5, 1.0, 2.0, 4.0]
    assert all(0.0 <= run.seconds < 60.0 for run in study.runs[name])
    assert (steps[0].part, steps[0].analysis, steps[0].analyses) == ("a bar", 1, 4)
    assert steps[-1].done == steps[-1].increments == 4 and bars.progress is None
    assert study.result["solver"] == "bars" and study.result["card"] == "soft"
    assert study.warnings == ()


def test_increments_are_refined_where_they_are_asked_for(bars):
    study = refine(project_of(BarTest("a bar")), CARD, what="increments", levels=3)
    assert [r.level.part.increments for r in study.runs["a bar"]] == [4, 8, 16]
    assert [r.level.size for r in study.runs["a bar"]] == [1 / 4, 1 / 8, 1 / 16]
    remark = study.result["models"]["a bar"]["quantities"][END]["remark"]
    assert "accuracy of the solver" in remark  # the closed form knows no increments


def test_parts_and_tests_are_told_apart(bars):
    both = project_of(BarTest("one", ("warp", "fill")), BarTest("two"))
    assert list(refine(both, CARD, levels=2).runs) == ["one: warp", "one: fill", "two"]
    assert list(refine(both, CARD, tests="one", levels=2).runs) == ["warp", "fill"]
    assert list(refine(both, CARD, tests=["bars"], levels=2).runs)[-1] == "two"
    with pytest.raises(InputError, match="there is no test 'three'"):
        refine(both, CARD, tests=["three"])


def test_a_level_that_fails_is_named_and_left_out(bars, tmp_path, drawn):
    bars.fails = 16
    study = refine(project_of(BarTest("a bar")), CARD)
    *_, last = study.runs["a bar"]
    assert last.values is None and last.failure == "the bar breaks"
    assert len(study.result["models"]["a bar"]["rms_N"]["to_next_finer"]) == 2
    assert any("failed: the bar breaks" in line for line in study.lines())
    study.write(tmp_path)
    table = pd.read_csv(tmp_path / "convergence.csv")
    pd.testing.assert_frame_equal(table, study.table(), check_dtype=False)
    assert table.quantity.str.startswith("failed: ").sum() == 1
    assert (table[table.quantity == END].off_finest.iloc[-1]) == 0
    assert json.loads((tmp_path / "result.json").read_text()) == study.result
    assert (tmp_path / "convergence.png").exists()
    # The figure shows the levels of the table that ended, each beside the next finer one.
    rows = table[table.quantity == END]
    change = 100 * np.abs(np.diff(rows.value)) / rows.value.iloc[-1]
    shown = data(drawn[0].charts[0])[0]
    assert shown[0] == pytest.approx(rows["size"].to_numpy()[:-1], rel=1e-5)
    assert shown[1] == pytest.approx(change, rel=1e-5)
    first = charts_of(tmp_path)["convergence"][0]
    (own,) = (series for series in first.series if series.name == END)
    assert own.x == pytest.approx(shown[0], rel=1e-5)
    assert own.y == pytest.approx(change, rel=1e-5)


def test_nothing_to_compare_is_a_failure(bars):
    bars.fails = 2
    with pytest.raises(SolverFailure, match="fewer than two levels ended well: the bar breaks"):
        refine(project_of(BarTest("a bar")), CARD)


def test_a_defect_is_no_failure(bars, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(bars, "run", broken)
    with pytest.raises(ZeroDivisionError):
        refine(project_of(BarTest("a bar")), CARD)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"levels": 3, "coarser": 3}, "--coarser: expected fewer than the 3 levels, got 3"),
        ({"levels": 4, "coarser": 3}, r"bars.toml: refinement by 0.125 .*elements: expected 1"),
        ({"what": "increments", "levels": 2, "factor": 1}, "come out the same"),
    ],
)
def test_levels_that_cannot_be_had(bars, options, words):
    with pytest.raises(InputError, match=words):
        refine(project_of(BarTest("a bar")), CARD, **options)
    assert not bars.seen


def test_the_cards_thickness_counts_and_is_said(bars):
    thick = MaterialCard(CARD.law, 1.0, "thick")
    study = refine(project_of(BarTest("a bar"), cards={"thick": thick}), "thick", levels=2)
    assert {model.thickness for model in bars.seen} == {1.0}
    (note,) = study.result["notes"]
    words = note["note"]
    assert "1 mm" in words and "0.5 mm" in words and f"note: {words}" in study.lines()
    with pytest.raises(InputError, match="no card"):
        refine(project_of(BarTest("a bar"), cards={"thick": thick}), "thin")


X = np.array([1.0, 2.0])
LOAD, LATE = "load, N", "load at 2 mm, N"


def level(factor: float, quads: int) -> Level:
    """Of edge 8 mm where the factor is a half, as the fourth root of quads would have it."""
    part: Any = SimpleNamespace(
        model=SimpleNamespace(mesh=SimpleNamespace(quads=range(quads))), increments=10
    )
    return Level(part, factor, 4.0 / factor)


def run(factor: float, quads: int, load: float, late: float | None, rise: float) -> LevelRun:
    values = {LOAD: load} | ({} if late is None else {LATE: late})
    return LevelRun(level(factor, quads), quads / 100, 7, values, (X, rise * X))


#: 10 + 1, + 1/2, + 1/4 N at halved edges; the curves differ by 0.2 and 0.1 times (1, 2) N.
RUNS = [
    run(0.5, 25, 11.0, None, 5.3), run(1.0, 100, 10.5, 21.0, 5.1), run(2.0, 400, 10.25, 20.5, 5.0),
    LevelRun(level(4.0, 1600), 3.0, failure="no equilibrium", notes=()),
]  # fmt: skip


def study(runs: list[LevelRun], noise: float = 1e-7, what: Any = "elements") -> Refinement:
    notes = (Note(SNAP, "made up"),)
    return Refinement(Path("a.toml"), "soft", "bars", what, {"bar": runs}, noise, notes)


def test_numbers():
    result = study(RUNS).result
    (model,) = (result.pop("models")["bar"],)
    assert result.pop("notes")[-1]["note"] == "made up"
    assert result == {
        "command": "study mesh", "project": "a.toml", "card": "soft", "solver": "bars",
        "refined": "elements",
    }  # fmt: skip
    assert model["levels"][0] == {
        "factor": 0.5, "elements": 25, "increments": 10, "size": 8.0, "seconds": 0.25,
        "iterations": 7, "values": {LOAD: 11.0},
    }  # fmt: skip
    assert model["levels"][3]["values"] is None
    assert model["levels"][3]["failed"] == "no equilibrium"
    text = "\n".join(study(RUNS).lines())
    for words in ("order 1.00", "limit 10", "failed: no equilibrium", "the project's own"):
        assert words in text
    found = model["quantities"]
    assert found[LOAD] == {
        "finest": 10.25, "order": pytest.approx(1.0), "limit": pytest.approx(10.0),
        "order_one_coarser": None, "own_error": pytest.approx(0.05),
        "own_error_against": "limit",
        "remark": "one order only: one more level would tell whether it holds",
    }  # fmt: skip
    # The coarsest level did not come so far.
    assert found[LATE] == {
        "finest": 20.5, "order": None, "limit": None, "order_one_coarser": None,
        "own_error": pytest.approx(21.0 / 20.5 - 1), "own_error_against": "finest",
        "remark": "an order needs three levels",
    }  # fmt: skip
    root = np.sqrt((1 + 4) / 2)
    assert model["rms_N"] == {
        "to_next_finer": pytest.approx([0.2 * root, 0.1 * root]), "largest_load": 10.0,
        "order": pytest.approx(1.0),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("runs", "noise"),
    # The last change, 0.158 N of 10, is the noise; and two levels have but one change.
    [(RUNS, 0.0159), (RUNS[1:], 1e-7)],
)
def test_curves_without_an_order(runs, noise):
    assert study(runs, noise).result["models"]["bar"]["rms_N"]["order"] is None
    assert study(RUNS, 0.0157).result["models"]["bar"]["rms_N"]["order"] == pytest.approx(1.0)


def test_one_level_is_compared_with_nothing():
    said = study([RUNS[0], RUNS[3]]).result["models"]["bar"]
    assert said["quantities"] == {} and "rms_N" not in said and len(said["levels"]) == 2
    without = [LevelRun(r.level, r.seconds, 1, r.values) for r in RUNS[:2]]
    assert "rms_N" not in study(without).result["models"]["bar"] and rms_changes(without) == []


def test_table():
    table = study(RUNS).table()
    assert list(table.columns) == [
        "model", "refined", "factor", "elements", "increments", "size", "seconds", "iterations",
        "quantity", "value", "off_finest", "off_finest_percent",
    ]  # fmt: skip
    root, nan = np.sqrt(2.5), np.nan
    rows = [
        (25, LOAD, 11.0, 0.75, 100 * 0.75 / 10.25), (25, RMS, 0.2 * root, nan, nan),
        (100, LOAD, 10.5, 0.25, 100 * 0.25 / 10.25), (100, LATE, 21.0, 0.5, 100 * 0.5 / 20.5),
        (100, RMS, 0.1 * root, nan, nan), (400, LOAD, 10.25, 0.0, 0.0),
        (400, LATE, 20.5, 0.0, 0.0), (1600, "failed: no equilibrium", nan, nan, nan),
    ]  # fmt: skip
    columns = ["elements", "quantity", "value", "off_finest", "off_finest_percent"]
    for row, wanted in zip(table[columns].itertuples(index=False), rows, strict=True):
        assert tuple(row[:2]) == wanted[:2]
        assert row[2:] == pytest.approx(wanted[2:], nan_ok=True)


def test_panels():
    (panel,) = panels(study(RUNS))
    assert (panel.name, panel.sizes) == ("bar", [8.0, 4.0, 2.0])
    assert (panel.work, panel.seconds) == ([250, 1000, 4000], [0.25, 1.0, 4.0])
    root = np.sqrt(2.5)
    assert panel.changes[LOAD] == pytest.approx([50 / 10.25, 25 / 10.25])
    assert panel.changes[LATE] == pytest.approx([np.nan, 50 / 20.5], nan_ok=True)
    assert panel.changes["RMS along the load curve"] == pytest.approx([2 * root, root])


@pytest.mark.parametrize(
    ("what", "size"), [("elements", "1600 quads"), ("increments", "10 increments")]
)
def test_notes_name_the_level(what, size):
    failed, own = study(RUNS, what=what).notes
    assert failed.line == f"bar, {size}: no equilibrium" and failed.kind is FAILED
    assert own.line == "made up"


def test_the_order_of_a_curve_is_that_of_its_finest_levels():
    more = [run(0.25, 6, 12.0, None, 5.3001), *RUNS[:3]]
    for noise in (1e-7, 1e-3):
        found = study(more, noise).result["models"]["bar"]["rms_N"]
        assert len(found["to_next_finer"]) == 3 and found["to_next_finer"][0] < 2e-4
        assert found["order"] == pytest.approx(1.0)
    early = [run(0.25, 6, 12.0, None, 9.3), *RUNS[:3]]
    assert study(early).result["models"]["bar"]["rms_N"]["order"] == pytest.approx(1.0)


def manufactured(sizes, order: float, limit: float, constant: float) -> np.ndarray:
    return limit + constant * np.asarray(sizes, dtype=float) ** order


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    order=st.floats(0.3, 6.0), limit=st.floats(-50.0, 50.0),
    constant=st.sampled_from([-3.0, -0.2, 0.2, 3.0]), first=st.floats(1.3, 3.0),
    second=st.floats(1.3, 3.0),
)  # fmt: skip
def test_order_and_limit_of_pure_powers(order, limit, constant, first, second):
    sizes = [1.0, 1 / first, 1 / (first * second)]
    values = manufactured(sizes, order, limit, constant)
    found = observed_order(sizes, np.diff(values))
    assert found == pytest.approx(order, rel=1e-4)
    assert richardson(sizes[1:], values[1:], order) == pytest.approx(limit, abs=1e-8)


def test_the_unit_of_size_does_not_matter():
    sizes = np.array([12.75, 7.07, 3.5])
    values = manufactured(sizes, 2.0, 39.8, 1e-3)
    orders = [observed_order(scale * sizes, np.diff(values)) for scale in (1e-6, 1.0, 1e6)]
    assert orders == pytest.approx([2.0] * 3)


@pytest.mark.parametrize(
    "changes",
    [(1.0, -0.25), (-1.0, 0.25), (1.0, 1.0), (1.0, 1.2), (1.0, 0.0), (0.0, 1.0), (1.0, np.nan),
     (1.0, 2.0**-12.5)],
)  # fmt: skip
def test_changes_without_an_order(changes):
    assert observed_order([4.0, 2.0, 1.0], changes) is None


@pytest.mark.parametrize("sizes", [[1.0, 1.0, 0.5], [1.0, 2.0, 3.0], [1.0, 0.5, 0.0], [1.0, 0.5]])
def test_sizes_must_fall(sizes):
    with pytest.raises(ValueError, match="decreasing"):
        observed_order(sizes, [1.0, 0.25])


def test_a_sequence_that_has_settled_needs_no_remark():
    sizes = [8.0, 4.0, 2.0, 1.0]
    found = convergence(sizes, manufactured(sizes, 2.0, 40.0, 0.01).tolist())
    assert (found.order, found.previous, found.limit) == pytest.approx((2.0, 2.0, 40.0))
    assert found.remark == ""


def test_a_second_term_makes_the_order_move_and_is_said():
    h = np.array([8.0, 4.0, 2.0, 1.0])
    values = 40.0 + 0.01 * h**2 + 0.02 * h**4
    found = convergence(h.tolist(), values.tolist())
    assert found.order is not None and found.previous is not None
    assert found.previous > found.order > 2.5
    fine = 0.01 * h
    settled = convergence(fine.tolist(), (40.0 + 0.01 * fine**2 + 0.02 * fine**4).tolist())
    assert settled.order == pytest.approx(2.0, abs=0.01)
    assert settled.remark == ""
    moving = convergence(h.tolist(), (40.0 + 0.3 * h + 0.02 * h**4).tolist())
    assert "still moves" in moving.remark


@pytest.mark.parametrize(
    ("values", "noise", "found"),
    [
        # Order 1 exactly, then twice: the order one level coarser is known.
        ([8.0, 4.0, 2.0, 1.0], 0.0, (1.0, 0.0, 1.0, "")),
        # It moved by less than a half, and by more.
        ([1.0 + 2**1.4 + 2, 3.0, 2.0, 1.5], 0.0, (1.0, 1.0, 1.4, "")),
        ([1.0 + 2**1.6 + 2, 3.0, 2.0, 1.5], 0.0, (1.0, 1.0, 1.6, "still moves (from 1.6)")),
        # What the coarser levels change is the solver's: only one order is known.
        ([3.0, 3.0, 2.0, 1.5], 0.0, (1.0, 1.0, None, "one order only, a level coarser")),
        ([7.0, 3.0, 2.0, 1.5], 0.08, (None, None, None, "accuracy of the solver")),
        ([3.0, 2.0, 1.5], 0.0, (1.0, 1.0, None, "one order only: one more")),
    ],
)  # fmt: skip
def test_everything_of_a_sequence(values, noise, found):
    seen = convergence([2.0**-k for k in range(len(values))], values, noise)
    order, limit, previous, words = found
    for name, wanted in (("order", order), ("limit", limit), ("previous", previous)):
        assert getattr(seen, name) == pytest.approx(wanted, abs=1e-8), name
    assert words in seen.remark and bool(words) == bool(seen.remark)


@pytest.mark.parametrize(("order", "words"), [(0.49, "order 0.49"), (0.51, "one order only")])
def test_below_an_order_of_a_half_there_is_no_limit(order, words):
    found = convergence([4.0, 2.0, 1.0], [0.0, 2**order, 2**order + 1.0])
    assert words in found.remark and (found.limit is None) == (order < 0.5)


@pytest.mark.parametrize("noise, settled", [(0.0125, True), (0.0124, False)])
def test_noise_is_a_share_of_the_largest_value(noise, settled):
    """Of 40 here, at the coarsest level: 0.5 are changed by the last step; in any unit."""
    for unit in (1.0, 1e-3):
        values = (unit * np.array([-40.0, 1.0, 1.5])).tolist()
        found = convergence([4.0, 2.0, 1.0], values, noise * (1 + 1e-9))
        assert ("accuracy of the solver" in found.remark) == settled


def test_without_noise_only_the_same_value_has_settled():
    assert "accuracy of the solver" in convergence([4.0, 2.0, 1.0], [1.0, 2.0, 2.0]).remark


@pytest.mark.parametrize(
    "values, words",
    [
        ([1.0, 0.5], "three levels"), ([1.0], "three levels"),
        ([1.0, 1.0], "accuracy of the solver"), ([1.0, 0.5, 0.375], "one order only"),
        ([9.0, 1.0, 0.5, 0.75], "up and down"), ([9.0, 1.0, 0.5, 0.0], "do not get smaller"),
        ([9.0, 1.0, 0.5, 0.5 + 1e-9], "accuracy of the solver"),
        ([1.0, 1.5, 1.25, 1.125], "one order only"), ([3.0, 2.0, 1.0, 1.0 - 1e-6], "no power"),
        ([0.0, 1.0, 1.9], "no limit: refine further"),
    ],
)  # fmt: skip
def test_limits_of_the_extrapolation_are_said(values, words):
    sizes = [2.0**-k for k in range(len(values))]
    found = convergence(sizes, values, noise=1e-8)
    assert words in found.remark
    assert (found.limit is None) == (found.order is None)
