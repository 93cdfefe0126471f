"""Predictions with a solver whose answer is a band: both ends run, told apart everywhere."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.cylinder.predicted import CylinderOutcome
from bubblefit.experiments.kinds import Exhibit
from bubblefit.project.project import read_project
from bubblefit.reports import prediction_page
from bubblefit.reports.content import Report
from bubblefit.runs.predictions import Predictions, RunEvent, predict
from bubblefit.solvers import registry

from ..cylinder_cases import FAILS, Banded, write_project, write_readings


@pytest.fixture(autouse=True)
def formula(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.SOLVERS, "formula", Banded)


def banded(folder: Path, soft: float = 500.0, **options: object) -> Predictions:
    """Predictions of two cylinders, the first of them measured, with two cards."""
    write_readings(folder / "made-up.csv")
    path = write_project(folder, 'measured.files = ["made-up.csv"]', soft)
    return predict(read_project(path), jobs=1, **options)  # type: ignore[arg-type]


def test_both_ends_are_run_and_named(tmp_path: Path) -> None:
    done = banded(tmp_path)
    runs = done.runs()
    assert list(runs.columns[:3]) == ["test", "card", "wall"]
    assert runs["wall"].tolist() == ["slack", "rigid wall"] * 4
    assert runs["card"].tolist() == ["soft", "soft", "stiff", "stiff"] * 2
    loads = runs["load_at_100_mm_N"].to_numpy()
    np.testing.assert_allclose(loads[1::2], 1.5 * loads[::2])
    curves = done.curves()
    largest = curves.groupby(["test", "card", "wall"])["load_N"].max()
    for (test, card, wall), load in largest.items():
        slack = largest[test, card, "slack"]
        assert load == pytest.approx({"slack": 1.0, "rigid wall": 1.5}[wall] * slack)
    result = json.loads(json.dumps(done.result))
    assert result["walls"] == [
        {"name": "slack", "meaning": "it wrinkles", "predicted": True},
        {"name": "rigid wall", "meaning": "it does not", "predicted": False},
    ]
    assert [(r["wall"], r["predicted"]) for r in result["runs"][:2]] == [
        ("slack", True), ("rigid wall", False)
    ]  # fmt: skip
    of = {note.of for note in done.notes}
    assert "high with soft" in of and "high with soft, rigid wall" in of and len(of) == 8


def test_only_what_is_predicted_is_judged(tmp_path: Path) -> None:
    done = banded(tmp_path)
    errors = [done.error(i) for i in range(4)]
    assert errors[1] is not None and errors[1] > max(errors[0], errors[2])  # type: ignore[type-var]
    assert done.worst == max(errors[0], errors[2])  # type: ignore[type-var]
    assert done.silent() == []
    # Where every run of a card fails, it is the prediction that says nothing.
    failed = banded(tmp_path, FAILS)
    assert failed.failed() == [0, 1, 4, 5] and failed.silent() == [0]


def test_both_ends_are_taken_up_again(tmp_path: Path) -> None:
    banded(tmp_path, out=tmp_path / "out")
    assert len(list((tmp_path / "out" / "runs").glob("*.npz"))) == 8
    events: list[RunEvent | None] = []
    again = banded(tmp_path, out=tmp_path / "out", resume=True, progress=events.append)
    told = [event for event in events if event is not None and event.run is not None]
    assert len(told) == 8 and all(event.again for event in told)
    assert again.runs()["wall"].tolist() == ["slack", "rigid wall"] * 4


def test_an_end_that_is_asked_for_is_run_alone(tmp_path: Path) -> None:
    path = write_project(tmp_path)
    path.write_text(path.read_text() + "[solver.formula]\nfactor = 1.5\n")
    done = predict(read_project(path), jobs=1)
    assert done.runs()["wall"].tolist() == [""] * 4 and done.result["walls"] == []


def test_the_page_says_which_wall_a_note_is_of(tmp_path: Path, monkeypatch) -> None:
    pages: list[Report] = []
    monkeypatch.setattr(CylinderOutcome, "show", lambda *_: Exhibit())
    monkeypatch.setattr(prediction_page, "write_report", lambda folder, page: pages.append(page))
    banded(tmp_path, FAILS, out=tmp_path / "out").report(tmp_path / "out")
    (page,) = pages
    (notes,) = [table for table in page.tables if table.title == "Notes"]
    assert notes.header == ["test", "card", "wall", "kind", "note"]
    assert all(len(row) == 5 for row in notes.rows) and notes.text == (1, 2, 3, 4)
    assert {row[2] for row in notes.rows} == {"slack", "rigid wall"}
    assert page.warnings[:2] == [
        "150 mm, 90 kPa with soft: failed: made to fail",
        "150 mm, 90 kPa with soft, rigid wall: failed: made to fail",
    ]
