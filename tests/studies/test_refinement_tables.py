"""A study of refinement as numbers, table and panels, all of it reckoned by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.notes import Note, NoteKind
from bubblefit.runs.refinement import RMS, Level, LevelRun, Refinement, rms_changes

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
    run(0.5, 25, 11.0, None, 5.3),
    run(1.0, 100, 10.5, 21.0, 5.1),
    run(2.0, 400, 10.25, 20.5, 5.0),
    LevelRun(level(4.0, 1600), 3.0, failure="no equilibrium", notes=()),
]


def study(runs: list[LevelRun], noise: float = 1e-7, what: Any = "elements") -> Refinement:
    notes = (Note(NoteKind.SNAP, "made up"),)
    return Refinement(Path("a.toml"), "soft", "bars", what, {"bar": runs}, noise, notes)


def test_numbers() -> None:
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
def test_curves_without_an_order(runs: list[LevelRun], noise: float) -> None:
    assert study(runs, noise).result["models"]["bar"]["rms_N"]["order"] is None
    assert study(RUNS, 0.0157).result["models"]["bar"]["rms_N"]["order"] == pytest.approx(1.0)


def test_one_level_is_compared_with_nothing() -> None:
    said = study([RUNS[0], RUNS[3]]).result["models"]["bar"]
    assert said["quantities"] == {} and "rms_N" not in said and len(said["levels"]) == 2
    without = [LevelRun(r.level, r.seconds, 1, r.values) for r in RUNS[:2]]
    assert "rms_N" not in study(without).result["models"]["bar"] and rms_changes(without) == []


def test_table() -> None:
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


def test_panels() -> None:
    from bubblefit.runs.refinement import panels

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
def test_notes_name_the_level(what: str, size: str) -> None:
    failed, own = study(RUNS, what=what).notes
    assert failed.line == f"bar, {size}: no equilibrium" and failed.kind is NoteKind.FAILED
    assert own.line == "made up"


def test_the_order_of_a_curve_is_that_of_its_finest_levels() -> None:
    """A first change that is nothing, or of another order, is neither noise nor in the order."""
    more = [run(0.25, 6, 12.0, None, 5.3001), *RUNS[:3]]
    for noise in (1e-7, 1e-3):
        found = study(more, noise).result["models"]["bar"]["rms_N"]
        assert len(found["to_next_finer"]) == 3 and found["to_next_finer"][0] < 2e-4
        assert found["order"] == pytest.approx(1.0)
    early = [run(0.25, 6, 12.0, None, 9.3), *RUNS[:3]]
    assert study(early).result["models"]["bar"]["rms_N"]["order"] == pytest.approx(1.0)
