"""The whole page of predictions, and what result.json says of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from bubblefit.experiments.cylinder import report as cylinders
from bubblefit.notes import Note, NoteKind, rows
from bubblefit.project.project import read_project
from bubblefit.reports import prediction_page
from bubblefit.reports.content import Report, Table, Words
from bubblefit.reports.html import percent
from bubblefit.runs.predictions import Predictions, predict
from bubblefit.runs.record import versions
from bubblefit.solvers import registry

from ..cylinder_cases import FAILS, STOPS, Formula, write_project, write_readings


@pytest.fixture(autouse=True)
def formula(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.SOLVERS, "formula", Formula)
    monkeypatch.setattr(cylinders, "draw_figures", lambda *_: [("loads.png", "loads")])
    monkeypatch.setattr(cylinders, "write_beams", lambda *_: [("a.vtu", "a beam")])


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[Report]:
    reports: list[Report] = []

    def keep(folder: Path, report: Report) -> Path:
        reports.append(report)
        return folder / "report.html"

    monkeypatch.setattr(prediction_page, "write_report", keep)
    return reports


def predictions(folder: Path, soft: float, measured: bool) -> Predictions:
    write_readings(folder / "a.csv", noise=0.02)
    first = 'measured.files = ["a.csv"]' if measured else ""
    done = predict(read_project(write_project(folder, first, soft)), jobs=1)
    # Two notes of one run, and seconds that can be told from others.
    each = [
        replace(run, record=replace(run.record, seconds=2.0 + i)) for i, run in enumerate(done.each)
    ]
    each[1] = replace(each[1], notes=("made up", Note(NoteKind.SNAP, "also")))
    return Predictions(done.project, tuple(each), 30.0)


def test_failures_errors_and_notes(tmp_path: Path, seen: list[Report]) -> None:
    done = predictions(tmp_path, FAILS, measured=True)
    done.report(tmp_path / "out")
    (found,) = seen
    (worst,) = [e for i in range(4) if (e := done.error(i)) is not None]
    assert done.worst == worst and done.failed() == [0, 2] and done.silent() == [0]
    assert found.title == "Tubes"
    assert found.summary == (
        "2 of 4 runs finished. 2 have notes. Marked 'snap': 1. Largest error against measured "
        f"values: {percent(worst)}."
    )
    assert found.facts == [
        ("tests", 2), ("cards", 2), ("solver", "formula"), ("wall time, s", 30.0),
        ("seconds of all runs", 14.0), ("length, mm", 3000.0), ("span, mm", 2000.0),
        ("element size, mm", 40.0), ("seam width, mm", 40.0),
    ]  # fmt: skip
    assert found.warnings == [
        "150 mm, 90 kPa with soft: failed: made to fail",
        "high with soft: failed: made to fail",
    ]
    assert found.figures == [("loads.png", "loads")]
    sure = next(part for part in found.parts if isinstance(part, Words))
    assert sure.lines == [
        "No spread of loads with soft, stiff: the card does not say how sure it is.",
        "Assumed, as the project does not say: the usual span (2000 mm).",
        "Assumed, as the project does not say: the usual seam width (40 mm).",
        "Assumed, as the project does not say: the usual length (3000 mm).",
        "Assumed, as the project does not say: the usual collar.",
        "Assumed, as the project does not say: the usual diameter of the supports (100 mm).",
    ]
    assert [table.title for table in found.tables] == ["Runs", "Against measured loads", "Notes"]
    assert found.tables[-1] == Table(
        "Notes",
        ["test", "card", "kind", "note"],
        [
            ["150 mm, 90 kPa", "stiff", "of the solver", "made up"],
            ["150 mm, 90 kPa", "stiff", "snap", "also"],
            ["high", "stiff", "of the solver", "made up"],
        ],
        "What a reader of the numbers above should know of each run.",
        text=(1, 2, 3),
    )
    assert found.files == [
        ("runs.csv", "the table of runs with all its columns"),
        ("notes.csv", "what a reader of the numbers should know, note by note"),
        ("result.json", "all numbers of this page, for programs"),
        ("load_deflection.csv", "every curve: deflection, load, pressure, volume, wrinkled share"),
        ("measured.csv", "mean and scatter of the repetitions on a grid"),
        ("a.vtu", "a beam"),
    ]
    assert found.versions == versions()


def test_nothing_to_tell(tmp_path: Path, seen: list[Report]) -> None:
    """No table of notes, no error, no warning but that a run stopped."""
    done = predictions(tmp_path, STOPS, measured=False)
    quiet = Predictions(done.project, tuple(replace(run, notes=()) for run in done.each), 30.0)
    quiet.report(tmp_path / "out")
    (found,) = seen
    assert found.summary == "2 of 4 runs finished."
    stopped = "stopped at 120 of 240 mm: the run stopped early: so asked"
    assert found.warnings == [f"{test} with soft: {stopped}" for test in ("150 mm, 90 kPa", "high")]
    assert [table.title for table in found.tables] == ["Runs"]
    assert quiet.worst is None and not quiet.failed() and not quiet.silent()


def test_result_json(tmp_path: Path) -> None:
    done = predictions(tmp_path, FAILS, measured=True)
    result = dict(done.result)
    runs, tests = result.pop("runs"), result.pop("tests")
    assert result.pop("notes") == rows(done.notes)
    assert result == {
        "command": "predict",
        "title": "Tubes",
        "solver": "formula",
        "cards": ["soft", "stiff"],
        "walls": [],
        "worst_relative_error": done.worst,
        "wall_s": 30.0,
        "cached_runs": 0,
        "versions": versions(),
    }
    assert runs[0] == {
        "test": "150 mm, 90 kPa",
        "card": "soft",
        "wall": "",
        "predicted": True,
        "ended": "failed: made to fail",
        "marks": [],
        "seconds": 2.0,
    }
    assert [run["marks"] for run in runs[1:]] == [["snap"], [], []]
    told = ("card", "ended", "seconds", "iterations", "warnings")
    assert {key: runs[1][key] for key in told} == {
        "card": "stiff", "ended": "finished", "seconds": 3.0, "iterations": 0,
        "warnings": ["made up", "also"],
    }  # fmt: skip
    assert runs[1]["error"]["relative"] == done.worst and runs[3]["error"] is None
    assert tests["high"] == {
        "kind": "cylinder",
        "diameter_mm": 150.0,
        "pressure_kPa": pytest.approx(140.0),
        "length_mm": 3000.0,
        "seam_width_mm": 40.0,
        "element_size_mm": 40.0,
        "symmetry": "quarter",
        "supports": {"span": 2000.0, "diameter": 100.0},
        "collar": {"inner_diameter": 240.0, "length": 145.0, "fillet": 10.0},
        "places_mm": {"40 mm": 40.0, "100 mm": 100.0, "240 mm": 240.0},
        "slope_over_mm": 20.0,
        "repetitions": 0,
    }
    assert tests["150 mm, 90 kPa"]["repetitions"] == 2
    table = done.runs()
    assert table["notes"].tolist() == ["", "made up; also", "", "made up"]
    assert table["seconds"].tolist() == [2.0, 3.0, 4.0, 5.0]
    assert done.lines()[-3:] == [
        "note: 150 mm, 90 kPa with stiff: made up",
        "note: high with stiff: made up",
        "note: 150 mm, 90 kPa with stiff: also",
    ]
