"""Tests with cards from Python: which cards, tables, notes, what is in the folder."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, OutputError, SolverFailure
from bubblefit.experiments.cylinder.predicted import CylinderOutcome
from bubblefit.experiments.kinds import Exhibit, RunRecord, notes_of_record
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import FEW
from bubblefit.project.cards import chosen_cards
from bubblefit.project.project import Project, read_project
from bubblefit.reports.charts import Charts
from bubblefit.runs import executor, processes
from bubblefit.runs.predictions import Predictions, RunEvent, predict
from bubblefit.solvers import registry

from ..complaints import complaint
from ..cylinder_cases import FAILS, STOPS, Formula, write_project, write_readings
from ..drawings import data, lines

CARDS = ("soft", "stiff")
TESTS = ("150 mm, 90 kPa", "high")


@pytest.fixture(autouse=True)
def formula(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.SOLVERS, "formula", Formula)


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return read_project(write_project(tmp_path))


def without_cards(folder: Path) -> Project:
    """The project without [[card]]."""
    path = write_project(folder)
    text = path.read_text()
    path.write_text(text[: text.index("[[card]]")] + text[text.index("[fit]") :])
    return read_project(path)


def test_every_test_with_every_card(project: Project, tmp_path: Path) -> None:
    events: list[RunEvent | None] = []
    done = predict(project, jobs=1, progress=events.append)
    runs, curves = done.runs(), done.curves()
    keys = [(test, card) for test in TESTS for card in CARDS]
    assert list(zip(runs["test"], runs["card"], strict=True)) == keys
    assert list(runs.columns[-4:]) == ["ended", "marks", "notes", "seconds"]
    assert set(runs["ended"]) == {"finished"} and set(runs["notes"]) == {"made up"}
    names = ["test", "card", "wall", "deflection_mm"]
    assert len(curves) == 4 * 25 and list(curves.columns[:4]) == names
    assert set(runs["wall"]) == {""} and done.result["walls"] == []
    stiff = curves[(curves["test"] == "high") & (curves["card"] == "stiff")]
    own = runs[(runs["test"] == "high") & (runs["card"] == "stiff")].iloc[0]
    at = np.interp(100.0, stiff["deflection_mm"], stiff["load_N"])
    assert own["load_at_100_mm_N"] == pytest.approx(at)
    told = [event for event in events if event is not None]
    assert [e.done for e in told] == [0, 1, 2, 3, 4] and {e.total for e in told} == {4}
    assert told[0].run is None and not any(e.again for e in told)
    # Nothing was written, nothing was measured.
    assert [p.name for p in tmp_path.iterdir()] == ["project.toml"]
    assert done.worst is None and done.silent() == []


def test_figures_show_the_curves_of_the_table(
    project: Project, tmp_path: Path, drawn: list[Charts]
) -> None:
    done = predict(project, ["high"], jobs=1)
    done.report(tmp_path / "out")
    curves = done.curves()
    panels = {c.y_label: c for charts in drawn for c in charts.charts}
    (volumes,) = (charts.charts[0] for charts in drawn if charts.name == "gas")
    for rank, card in enumerate(CARDS):
        own = curves[curves["card"] == card]
        load = lines(panels["load, N"], card)[0]
        assert load == pytest.approx(own[["deflection_mm", "load_N"]].to_numpy().T, rel=1e-5)
        gas = data(volumes)[rank]
        assert gas[1] == pytest.approx(own["gauge_pressure_kPa"].to_numpy(), rel=1e-5)
        volume = own["volume_mm3"].to_numpy()
        assert gas[0] == pytest.approx((volume - volume[0]) / 1e6, rel=1e-5)


def test_tests_and_cards_by_name(project: Project) -> None:
    done = predict(project, ["high"], ["stiff"], jobs=1)
    assert [(run.test.name, run.card) for run in done.each] == [("high", "stiff")]
    mine = MaterialCard(HypoelasticLaw.linear(700.0, 150.0, 20.0), 0.81)
    done = predict(project, "cylinder", {"mine": mine}, jobs=1)
    assert [(run.test.name, run.card) for run in done.each] == [(name, "mine") for name in TESTS]
    assert "there is no test 'low'" in complaint(predict, project, ["low"])


def test_the_card_just_fitted_where_there_is_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fabric").mkdir()
    project = without_cards(tmp_path / "fabric")
    said = complaint(chosen_cards, project)
    assert "bubblefit fit" in said and "out/fabric/material.toml" in said and "--card" in said
    law = HypoelasticLaw.linear(700.0, 150.0, 20.0)
    (tmp_path / "out" / "fabric").mkdir(parents=True)
    fitted = tmp_path / "out" / "fabric" / "material.toml"
    write_card(MaterialCard(law, 0.81, "just fitted"), fitted)
    assert list(chosen_cards(project)) == ["just fitted"]
    shutil.copy(fitted, tmp_path / "other.toml")
    assert list(chosen_cards(project, [tmp_path / "other.toml"])) == ["just fitted"]
    assert list(chosen_cards(read_project(write_project(tmp_path)))) == list(CARDS)


def test_what_is_there_is_not_run_again(project: Project, tmp_path: Path) -> None:
    first = predict(project, ["high"], jobs=1, out=tmp_path / "out")
    events: list[RunEvent | None] = []
    again = predict(project, jobs=1, out=tmp_path / "out", resume=True, progress=events.append)
    told = [event for event in events if event is not None and event.run is not None]
    assert [e.again for e in told] == [True, True, False, False]
    one, other = first.curves(), again.curves()
    pd.testing.assert_frame_equal(one, other[other["test"] == "high"].reset_index(drop=True))
    with pytest.raises(InputError, match="nothing to go on with"):
        predict(project, jobs=1, out=tmp_path / "none", resume=True)


def test_nothing_is_written_over_unless_it_is_asked_for(project: Project, tmp_path: Path) -> None:
    predict(project, ["high"], jobs=1, out=tmp_path / "out")
    with pytest.raises(OutputError, match="--resume"):
        predict(project, ["high"], jobs=1, out=tmp_path / "out")
    events: list[RunEvent | None] = []
    predict(project, ["high"], jobs=1, out=tmp_path / "out", overwrite=True, progress=events.append)
    assert [event.again for event in events if event is not None] == [False] * 3
    # Gone on with, the record has both times.
    again = predict(project, ["high"], jobs=1, out=tmp_path / "out", resume=True)
    assert again.record is not None and len(again.record.runs) == 2


def test_seconds_are_those_that_it_took(project: Project) -> None:
    begun = time.perf_counter()
    done = predict(project, ["high"], jobs=1)
    took = time.perf_counter() - begun
    assert 0 < done.result["runs"][0]["seconds"] <= done.wall_s <= took
    assert 0 < done.runs()["seconds"].sum() <= took


@pytest.mark.parametrize(("asked", "said", "some"), [(3, 5, 3), (None, 5, 5), (None, None, 7)])
def test_processes(project: Project, monkeypatch, asked, said, some: int) -> None:
    """As asked for, else as the project says, else as many as there are cores; time is told."""
    told: list[tuple[int, str]] = []
    events: list[RunEvent | None] = []

    def side_by_side(prepare, numbers, jobs: int, what: str):
        told.append((jobs, what))
        run = prepare()
        yield None
        yield from (run(number, lambda _: None) for number in numbers)

    monkeypatch.setattr(processes, "run_tasks", side_by_side)
    monkeypatch.setattr(executor, "cores", lambda: 7)
    predict(project.with_fit(jobs=said), ["high"], jobs=asked, progress=events.append)
    assert told == [(some, "runs")]
    assert [event is None for event in events] == [False, True, False, False]


def test_a_thickness_that_makes_no_model_names_test_and_card(project: Project) -> None:
    card = MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.0)
    said = complaint(predict, project, ["high"], {"of nothing": card}, jobs=1)
    assert said.startswith(f"{project.path}: 'high' with card 'of nothing', ")


def test_an_interrupt_leaves_what_ended(project: Project, tmp_path: Path) -> None:
    def interrupt(event: RunEvent | None) -> None:
        if event is not None and event.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        predict(project, jobs=1, out=tmp_path / "out", progress=interrupt)
    assert len(list((tmp_path / "out" / "runs").glob("*.npz"))) == 2
    assert not (tmp_path / "out" / "result.json").exists()
    assert len(predict(project, jobs=1, out=tmp_path / "out", resume=True).each) == 4


def test_measured_tests_that_say_nothing(tmp_path: Path) -> None:
    write_readings(tmp_path / "a.csv", noise=0.02)
    path = write_project(tmp_path, 'measured.files = ["a.csv"]', soft=FAILS)
    done = predict(read_project(path), jobs=1)
    assert done.silent() == [0] and done.worst == done.error(1)
    assert done.ended(0) == "failed: made to fail"
    assert np.isnan(done.runs()["rms_relative"].tolist()[2])
    with pytest.raises(SolverFailure, match="no run ended well: made to fail"):
        predict(read_project(path), cards=["soft"], jobs=1)


def test_a_card_runs_with_its_own_thickness(project: Project) -> None:
    """Not with the fabric's of 0.81 mm: the card's moduli are those of the card's thickness."""
    law = HypoelasticLaw.linear(500.0, 150.0, 20.0)
    cards = {f"{t} mm": MaterialCard(law, t) for t in (0.81, 0.9)}
    done = predict(project, ["high"], cards, jobs=1)
    for run, thickness in zip(done.each, (0.81, 0.9), strict=True):
        # The seam is three layers.
        assert set(np.unique(run.model.thickness)) == {thickness, 3 * thickness}
    thin, thick = done.curves()["load_N"].to_numpy().reshape(2, -1)[:, 1]
    assert thick > 1.05 * thin


def test_notes_stand_wherever_a_run_does(project: Project, tmp_path: Path, monkeypatch) -> None:
    """On the terminal, on the page, in the table and in result.json."""
    monkeypatch.setattr(CylinderOutcome, "show", lambda *arguments: Exhibit())
    law = HypoelasticLaw.linear(500.0, 150.0, 20.0)
    short = replace(law, strain_range=np.array([0.3, 0.01, 0.3]))
    done = predict(project, cards={"short": MaterialCard(short, 0.9)}, jobs=1)
    done.report(tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text().replace("&#39;", "'")
    table = pd.read_csv(tmp_path / "out" / "runs.csv")
    lines = "\n".join(done.lines())
    for run, said, row in zip(done.each, done.result["runs"], table["notes"], strict=True):
        beyond = [note for note in run.notes if "beyond the card's valid range 0.010" in note]
        thick = [note for note in run.notes if "thickness of 0.9 mm" in note]
        assert len(beyond) == len(thick) == 1 and "fill strain" in beyond[0]
        assert said["warnings"] == list(run.notes) and row == "; ".join(run.notes)
        for note in run.notes:
            assert note in page and note in lines


def test_notes_that_many_share_are_one_line(project: Project) -> None:
    done = predict(project, jobs=1)
    many = [
        replace(run, notes=(f"snaps between {i} and {i + 1.5} kPa", "the same"))
        for i, run in enumerate([*done.each, *done.each])
    ]
    lines = [line for line in Predictions(project, tuple(many), 0.0).lines() if "note" in line]
    assert len(many) > FEW and len(lines) == 2
    assert "8 times" in lines[0] and "snaps between 0 and 1.5 kPa" in lines[0]


def test_every_kind_of_note() -> None:
    card = MaterialCard(
        HypoelasticLaw([0] * 3 + [20] + [0] * 3 + [150] + [0] * 3 + [500], 0.24, [0.1, 0.2, 0.3]),
        0.81,
    )
    record = RunRecord(
        1.0, strain=np.array([0.1, 0.21, 0.31]), unstable=("132 kPa",), remarks=("a remark",)
    )
    notes = notes_of_record(record, card)
    assert notes[0] == "a remark" and len(notes) == 4
    assert notes[1].startswith("fill strain 0.210") and notes[2].startswith("shear strain 0.310")
    assert notes[3] == "unstable equilibrium at 132 kPa: the model would not stay there"
    assert notes_of_record(RunRecord(1.0, "failed"), card) == []


def test_an_early_end_is_a_result_with_its_reason(tmp_path: Path) -> None:
    done = predict(read_project(write_project(tmp_path, soft=STOPS)), jobs=1, out=tmp_path / "out")
    assert done.ended(0) == "stopped at 120 of 240 mm: the run stopped early: so asked"
    assert len(list((tmp_path / "out" / "runs").glob("*.npz"))) == 4
    done.report(tmp_path / "out")
    reason = "stopped at 120 of 240 mm: the run stopped early: so asked"
    assert reason in (tmp_path / "out" / "report.html").read_text().replace("\u00a0", " ")
    assert reason in "\n".join(done.lines())
    assert pd.read_csv(tmp_path / "out" / "runs.csv")["ended"][0] == reason
