"""Pages of predictions whose models have two ends: both are run, one is judged."""

import numpy as np
import pandas as pd
import pytest
from bubblefit import cycles
from bubblefit.project.project import read_project
from bubblefit.reports import run_pages
from bubblefit.reports.content import Exhibit
from bubblefit.reports.kinds.cylinder import CylinderPresenter
from bubblefit.runs.predictions import predict
from bubblefit.solvers import registry

from ..builders.bent_cylinders import (
    FAILS,
    CylinderWithBand,
    write_cylinder_project,
    write_cylinder_readings,
)
from ..builders.load_histories import load_history, write_history


@pytest.fixture(autouse=True)
def formula(monkeypatch):
    monkeypatch.setitem(registry.SOLVERS, "formula", CylinderWithBand)


def banded(folder, soft=500.0, **options):
    write_cylinder_readings(folder / "made-up.csv")
    path = write_cylinder_project(folder, 'measured.files = ["made-up.csv"]', soft)
    return predict(read_project(path), jobs=1, **options)


def test_both_ends_of_band_are_run_and_named(tmp_path):
    done = banded(tmp_path, out=tmp_path / "out")
    runs = done.runs()
    assert list(runs.columns[:3]) == ["test", "card", "wall"]
    assert runs["wall"].tolist() == ["slack", "rigid wall"] * 4
    assert runs["card"].tolist() == ["soft", "soft", "stiff", "stiff"] * 2
    loads = runs["load_at_100_mm_N"].to_numpy()
    np.testing.assert_allclose(loads[1::2], 1.5 * loads[::2])
    largest = done.curves().groupby(["test", "card", "wall"])["load_N"].max()
    for (test, card, wall), load in largest.items():
        times = {"slack": 1.0, "rigid wall": 1.5}[wall]
        assert load == pytest.approx(times * largest[test, card, "slack"])
    assert done.result["walls"] == [
        {"name": "slack", "meaning": "it wrinkles", "predicted": True},
        {"name": "rigid wall", "meaning": "it does not", "predicted": False},
    ]
    assert [(r["wall"], r["predicted"]) for r in done.result["runs"][:2]] == [
        ("slack", True), ("rigid wall", False)
    ]  # fmt: skip
    of = {note.of for note in done.notes}
    assert "high with soft" in of and "high with soft, rigid wall" in of and len(of) == 8
    assert len(list((tmp_path / "out" / "runs").glob("*.npz"))) == 8
    events = []
    again = banded(tmp_path, out=tmp_path / "out", resume=True, progress=events.append)
    told = [event for event in events if event is not None and event.run is not None]
    assert len(told) == 8 and all(event.from_folder for event in told)
    assert again.runs()["wall"].tolist() == runs["wall"].tolist()


def test_only_predicted_end_of_band_is_judged(tmp_path, monkeypatch):
    done = banded(tmp_path)
    errors = [done.error(i) for i in range(4)]
    assert errors[1] is not None and errors[1] > max(errors[0], errors[2])
    assert done.worst == max(errors[0], errors[2])
    assert done.silent() == []
    path = write_cylinder_project(tmp_path)  # an end that is asked for is run alone
    path.write_text(path.read_text() + "[solver.formula]\nfactor = 1.5\n")
    alone = predict(read_project(path), jobs=1)
    assert alone.runs()["wall"].tolist() == [""] * 4 and alone.result["walls"] == []
    # Where every run of a card fails, it is the prediction that says nothing.
    failed = banded(tmp_path, FAILS)
    assert failed.failed() == [0, 1, 4, 5] and failed.silent() == [0]
    pages = []
    monkeypatch.setattr(CylinderPresenter, "show_outcome", lambda *_: Exhibit())
    monkeypatch.setattr(run_pages, "write_report", lambda folder, page: pages.append(page))
    failed.report(tmp_path / "out")
    (page,) = pages
    (notes,) = [p for p in page.parts if p.part == "table" and p.title == "Notes"]
    assert notes.header == ["test", "card", "wall", "kind", "note"]
    assert all(len(row) == 5 for row in notes.rows) and notes.text == (1, 2, 3, 4)
    assert {row[2] for row in notes.rows} == {"slack", "rigid wall"}
    assert ["rigid wall" in line for line in page.warnings[:2]] == [False, True]


def test_cycles_are_written_with_their_tables_and_loops(tmp_path):
    columns = load_history()
    evaluation = cycles(write_history(tmp_path / "a.csv", ["time_s,load_N,strain"], columns))
    run_pages.write_cycles(evaluation, tmp_path, is_fitted=False)
    names = {path.name for path in tmp_path.glob("*.csv")} - {"a.csv"}
    assert names == {"cycles.csv", "holds.csv", "notes.csv", "loops.csv"}
    written = pd.read_csv(tmp_path / "cycles.csv")
    np.testing.assert_allclose(written["cycle"], evaluation.table["cycle"])
