"""What bent cylinders put on a page: facts, every cell of the tables, files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.cylinder import report as figures
from bubblefit.experiments.cylinder import report as page
from bubblefit.experiments.cylinder.predicted import BendingRun, CylinderOutcome
from bubblefit.experiments.kinds import Output
from bubblefit.notes import Note, NoteKind
from bubblefit.readers.bending import BendingCurve
from bubblefit.reports.content import Table
from bubblefit.solvers.base import BandEnd

from .test_tables import MEASURES

WAY, LOAD = np.array([0.0, 40.0, 80.0]), np.array([0.0, 100.0, 90.0])
BENT = BendingRun(
    deflection=WAY, load=LOAD, pressure=np.array([0.1, 0.101, 0.102]),
    volume=np.array([5e7, 4.9e7, 4.8e7]), inflated=np.empty(0), wrinkled=np.array([0.0, 0.1, 0.2]),
    bent=np.empty(0),
)  # fmt: skip
CURVE = BendingCurve("1", WAY, LOAD)


def case(name: str, diameter: float = 150.0, **other: Any) -> SimpleNamespace:
    fields = {
        "name": name, "diameter": diameter, "length": 3000.0, "size": 40.0, "seam_width": 35.0,
        "supports": SimpleNamespace(span=2000.0), "measured": (), "assumed": (),
        "deflections": (80.0, 160.0),
        "reading": SimpleNamespace(places={"20 mm": 20.0, "a long way": 200.0}, slope_over=20.0),
    }  # fmt: skip
    return SimpleNamespace(**(fields | other))


def run(
    test: SimpleNamespace,
    card: str,
    seconds: float = 12.34,
    end: BandEnd | None = None,
    **record: Any,
) -> SimpleNamespace:
    said = SimpleNamespace(**({"failure": "", "early": "", "seconds": seconds} | record))
    kinds = (NoteKind.EARLY, NoteKind.SNAP) if said.early else (NoteKind.GAS, NoteKind.SOLVER)
    notes = tuple(Note(kind, "words") for kind in kinds)
    return SimpleNamespace(
        test=test, card=card, notes=notes, record=said, end=end, wall=end.name if end else "",
        predicted=end is None or end.predicted, around=None,
        material=SimpleNamespace(certainty="known"),
    )  # fmt: skip


@pytest.fixture
def outcome() -> CylinderOutcome:
    first, second = case("150/90", measured=(CURVE, CURVE)), case("the wide one", 200.0)
    found = CylinderOutcome(
        [
            run(first, "soft card"),
            run(first, "stiff", failure="killed"),
            run(second, "soft card", early="no equilibrium within the smallest step"),
        ]
    )
    knee = replace(
        MEASURES, limit=None, wrinkles=None, stiffness=None, error=None, pressure_rise=-0.126
    )
    found.__dict__["measures"] = {0: MEASURES, 2: knee}
    found.__dict__["bent"] = {0: BENT, 2: BENT}
    return found


def test_every_cell(outcome: CylinderOutcome, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(page, "draw_figures", lambda *_: [("a.png", "a picture")])
    monkeypatch.setattr(page, "write_beams", lambda *_: [("b.vtu", "a beam")])
    shown = page.show_outcome(outcome, Output(tmp_path / "out", "c/"))
    assert shown.facts == [
        ("length, mm", 3000.0), ("span, mm", 2000.0), ("element size, mm", 40.0),
        ("seam width, mm", 35.0),
    ]  # fmt: skip
    assert shown.figures == [("a.png", "a picture")]
    assert shown.files == [
        (
            "c/load_deflection.csv",
            "every curve: deflection, load, pressure, volume, wrinkled share",
        ),
        ("c/measured.csv", "mean and scatter of the repetitions on a grid"),
        ("b.vtu", "a beam"),
    ]
    runs, errors = shown.tables
    stopped = "stopped at 80 of 160 mm: no equilibrium within the smallest step"
    rows = [
        ["150/90", "soft card", "4.26", "503 N, 120 mm", "33 mm", "86", None, "0.022", "+1.60",
         "finished", None, 2, 12.3],
        ["150/90", "stiff", None, None, None, None, None, None, None, "failed: killed", None, 2,
         12.3],
        ["the wide one", "soft card", None, "251 N, 61 mm (knee)", None, "86", None, "0.022",
         "-0.13", stopped, "snap, stopped early", 2, 12.3],
    ]  # fmt: skip
    assert [unbroken(row) for row in runs.rows] == rows
    assert "\u00a0" in str(runs.rows[0][3]) and runs.rows[2][9] == stopped  # which is broken
    assert runs == Table(
        "Runs",
        ["test", "card", "stiffness, N/mm", "buckles", "wrinkles from", "load at 20 mm, N",
         "load at a long way, N", "inflation strain", "pressure, kPa", "ended", "marked",
         "notes", "s"],
        runs.rows,
        "Stiffness: to 20 mm of deflection. Buckles: the limit point where the load falls "
        "afterwards, else the knee, where the slope over 20 mm has fallen to half. Wrinkles: more "
        "of the surface than when inflated. Inflation strain: the largest along warp or fill in "
        "the body, without the quads beside seam and caps. Pressure: its rise to the last frame. "
        "Marked: the kinds of notes that speak against a run's numbers; the notes stand below.",
        text=(1, 9, 10),
    )  # fmt: skip
    assert errors == Table(
        "Against measured loads",
        ["test", "card", "RMS, N", "of the largest load", "mean, N", "readings", "beyond"],
        [["150/90", "soft\u00a0card", 3.1, "5.2\u00a0%", "-1.2", 17, 4]],
        "Model less reading at every reading that the model reaches; beyond: those it does not.",
        text=(1,),
    )
    curves = pd.read_csv(tmp_path / "out" / "c" / "load_deflection.csv")
    assert list(curves.columns) == [
        "test", "card", "wall", "deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3",
        "wrinkled_share",
    ]  # fmt: skip
    assert curves["test"].tolist() == ["150/90"] * 3 + ["the wide one"] * 3
    assert curves["gauge_pressure_kPa"].tolist() == pytest.approx([100.0, 101.0, 102.0] * 2)
    assert curves["wrinkled_share"].tolist() == [0.0, 0.1, 0.2] * 2
    measured = pd.read_csv(tmp_path / "out" / "c" / "measured.csv")
    assert set(measured["test"]) == {"150/90"} and set(measured["repetitions"]) == {2}
    assert measured["mean_N"].max() == pytest.approx(100.0, rel=0.02)
    assert measured["standard_deviation_N"].abs().max() < 1e-9


def unbroken(row: list[object]) -> list[object]:
    return [c.replace("\u00a0", " ") if isinstance(c, str) else c for c in row]


def test_without_readings_there_is_nothing_to_compare(
    outcome: CylinderOutcome, tmp_path, monkeypatch
):
    monkeypatch.setattr(page, "draw_figures", lambda *_: [])
    monkeypatch.setattr(page, "write_beams", lambda *_: [])
    plain = CylinderOutcome([run(case("a"), "soft"), run(case("b", size=20.0, length=1e3), "soft")])
    plain.__dict__["measures"] = {i: replace(MEASURES, error=None) for i in (0, 1)}
    plain.__dict__["bent"] = {0: BENT, 1: BENT}
    shown = page.show_outcome(plain, Output(tmp_path))
    assert [name for name, _ in shown.files] == ["load_deflection.csv"]
    assert [table.title for table in shown.tables] == ["Runs"]
    assert shown.facts == [("span, mm", 2000.0), ("seam width, mm", 35.0)]  # what all share
    assert plain.error(0) is None and plain.ended(1) == "finished"


@pytest.mark.parametrize(
    ("cases", "words"),
    [
        (((150.0, 20.0), (200.0, 20.0)), "20 mm"),
        (((150.0, 15.0), (200.0, 20.0)), "0.1 diameters (15 to 20 mm)"),
        (((150.0, 20.0), (200.0, 15.0)), "15 to 20 mm"),
        (((150.0, 20.0), (200.0, 20.0000004)), "20 mm"),
        (((150.0, 20.0), (200.0, 20.00001)), "20 to 20 mm"),
    ],
)
def test_over_what_a_slope_is_taken(cases, words: str) -> None:
    tests = [
        case("a", diameter, reading=SimpleNamespace(places={}, slope_over=over))
        for diameter, over in cases
    ]
    assert page._slopes(tests) == words


def test_names_of_files_differ_whatever_the_tests_are_called() -> None:
    found = figures.file_names(["150 mm, 90 kPa", "150 mm; 90 kPa", "150 MM 90 kpa", "???", "-x."])
    assert list(found.values()) == [
        "150-mm-90-kPa", "150-mm-90-kPa-2", "150-MM-90-kpa-3", "4", "x"
    ]  # fmt: skip


def test_every_test_once(outcome: CylinderOutcome) -> None:
    assert [test.name for test in figures.tests_of(outcome)] == ["150/90", "the wide one"]
