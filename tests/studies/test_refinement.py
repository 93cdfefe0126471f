"""Runs on finer and finer meshes: what is compared, what fails, what is written."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, refined_quads, straight_strip, strip_mesh
from bubblefit.reports.charts import Charts
from bubblefit.runs.refinement import edge_length, refine, rms_between
from bubblefit.runs.simulation import Step

from ..bars import STRETCH, WIDTH, BarSolver, BarTest, project_of
from ..drawings import data
from ..page_charts import charts_of

CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")
EXACT = 600.0 * np.log1p(STRETCH) * np.exp(-0.24 * np.log1p(STRETCH)) * 0.5 * WIDTH
END = "load at the end, N"


def test_curves_are_compared_where_the_coarse_one_has_points() -> None:
    coarse = np.array([1.0, 2.0]), np.array([2.0, 4.0])
    fine = np.array([0.5, 1.0, 1.5, 2.0]), np.array([9.0, 2.5, 9.0, 4.5])
    assert rms_between(coarse, fine) == pytest.approx(0.5)
    # The origin is part of a curve.
    assert rms_between((np.array([0.5]), np.array([1.0])), coarse) == pytest.approx(0.0, abs=1e-15)


def test_a_run_that_stops_early_is_compared_up_to_there() -> None:
    x = np.array([1.0, 2.0, 3.0])
    assert rms_between((x, 2 * x), (x[:2], 2 * x[:2])) == pytest.approx(0.0, abs=1e-15)


def test_edge_length() -> None:
    assert edge_length(strip_mesh(20.0, 40.0, 4, 8)) == pytest.approx(5.0)
    disk = disk_mesh(100.0, 800, "quarter")
    assert edge_length(disk) ** 2 * len(disk.quads) == pytest.approx(0.25e4 * np.pi, rel=2e-3)


def test_strips_and_their_refinements() -> None:
    for strip, make in (("straight", lambda **q: straight_strip("warp", 20.0, 22.0, 0.8, **q)),
                        ("bias", lambda **q: bias_strip(20.0, 24.0, 0.8, **q))):  # fmt: skip
        plain, same = make(), make(**refined_quads(strip, 1.0))
        assert len(plain.mesh.quads) == len(same.mesh.quads)
        assert len(make(**refined_quads(strip, 2.0)).mesh.quads) == 4 * len(plain.mesh.quads)
        for factor in (1 / 16, 1 / 4, 1 / 2, 3.0):
            assert len(make(**refined_quads(strip, factor)).mesh.quads)


def test_order_and_limit_of_a_known_error(bars: BarSolver) -> None:
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


def test_increments_are_refined_where_they_are_asked_for(bars: BarSolver) -> None:
    study = refine(project_of(BarTest("a bar")), CARD, what="increments", levels=3)
    assert [r.level.part.increments for r in study.runs["a bar"]] == [4, 8, 16]
    assert [r.level.size for r in study.runs["a bar"]] == [1 / 4, 1 / 8, 1 / 16]
    remark = study.result["models"]["a bar"]["quantities"][END]["remark"]
    assert "accuracy of the solver" in remark  # the closed form knows no increments


def test_parts_and_tests_are_told_apart(bars: BarSolver) -> None:
    both = project_of(BarTest("one", ("warp", "fill")), BarTest("two"))
    assert list(refine(both, CARD, levels=2).runs) == ["one: warp", "one: fill", "two"]
    assert list(refine(both, CARD, tests="one", levels=2).runs) == ["warp", "fill"]
    assert list(refine(both, CARD, tests=["bars"], levels=2).runs)[-1] == "two"
    with pytest.raises(InputError, match="there is no test 'three'"):
        refine(both, CARD, tests=["three"])


def test_a_level_that_fails_is_named_and_left_out(
    bars: BarSolver, tmp_path: Path, drawn: list[Charts]
) -> None:
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


def test_nothing_to_compare_is_a_failure(bars: BarSolver) -> None:
    bars.fails = 2
    with pytest.raises(SolverFailure, match="fewer than two levels ended well: the bar breaks"):
        refine(project_of(BarTest("a bar")), CARD)


def test_a_defect_is_no_failure(bars: BarSolver, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
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
def test_levels_that_cannot_be_had(bars: BarSolver, options: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        refine(project_of(BarTest("a bar")), CARD, **options)
    assert not bars.seen


def test_the_cards_thickness_counts_and_is_said(bars: BarSolver) -> None:
    thick = MaterialCard(CARD.law, 1.0, "thick")
    study = refine(project_of(BarTest("a bar"), cards={"thick": thick}), "thick", levels=2)
    assert {model.thickness for model in bars.seen} == {1.0}
    (note,) = study.result["notes"]
    words = note["note"]
    assert "1 mm" in words and "0.5 mm" in words and f"note: {words}" in study.lines()
    with pytest.raises(InputError, match="no card"):
        refine(project_of(BarTest("a bar"), cards={"thick": thick}), "thin")
