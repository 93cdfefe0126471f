"""What studies share: which tests they can run, what parts are called, which card runs."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import Note, NoteKind
from bubblefit.reports.content import read_page_data
from bubblefit.runs.series import (
    Series,
    card_of,
    card_words,
    part_name,
    parts_of,
    studied_tests,
    thickness_notes,
    write_study,
)

from ..bars import BarKind, BarSolver, BarTest, project_of
from ..complaints import complaint

CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")


def test_parts_are_called_by_what_tells_them_apart(bars: BarSolver) -> None:
    one, two = BarTest("one"), BarTest("two", ("warp", "fill"), elements=6, increments=3)
    project = project_of(one, two)
    assert list(parts_of(project, [one], 0.5)) == ["one"]
    assert list(parts_of(project, [two], 0.5)) == ["warp", "fill"]
    parts = parts_of(project, [one, two], 0.7, "increments", 2.0)
    assert list(parts) == ["one", "two: warp", "two: fill"]
    assert [part.name for part in parts.values()] == list(parts)
    assert [part.increments for part in parts.values()] == [8, 6, 6]
    assert {part.model.thickness for part in parts.values()} == {0.7}
    assert len(parts["one"].model.mesh.quads) == 32
    finer = parts_of(project, [one], 0.5, factor=2.0)["one"]
    assert len(finer.model.mesh.quads) == 128 and finer.increments == 4
    assert part_name(two, "warp", 2, 1) == "warp" and part_name(two, "warp", 1, 2) == "two"


def test_a_refinement_that_cannot_be_had(bars: BarSolver) -> None:
    test = BarTest("one")
    said = complaint(parts_of, project_of(test), [test], 0.5, "elements", 0.05)
    assert said == (
        "bars.toml: refinement by 0.05 (--levels, --coarser, --factor), elements: expected 1 or "
        "more, got 0"
    )

    class Filed(BarTest):
        def models(self, *_: Any, **__: Any) -> Any:
            raise InputError("mesh.inp", "line 3", "odd")

    assert complaint(parts_of, project_of(test), [Filed("x")], 0.5) == "mesh.inp: line 3: odd"


def test_tests_that_no_study_can_run(bars: BarSolver, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = BarTest("one"), BarTest("two")
    project = project_of(one, two)
    assert studied_tests(project) == studied_tests(project, []) == [one, two]
    assert studied_tests(project, ["two"]) == [two]
    monkeypatch.setattr(BarKind, "studied", None)
    said = complaint(studied_tests, project)
    assert said == "bars.toml: no study can run the tests of this project"


def test_the_card_that_is_given(tmp_path: Path) -> None:
    write_card(MaterialCard(CARD.law, 0.6, "filed"), tmp_path / "c.toml")
    project = project_of(BarTest("one"), cards={"own": CARD})
    assert card_of(project, CARD) is CARD and card_of(project, "own") is CARD
    assert card_of(project, tmp_path / "c.toml").name == "filed"
    assert (card_words(CARD), card_words("own"), card_words(Path("c"))) == ("soft", "own", "c")
    assert thickness_notes(project, CARD) == []
    (note,) = thickness_notes(project, MaterialCard(CARD.law, 0.6))
    assert note.kind is NoteKind.THICKNESS and "0.6 mm" in note and "0.5 mm" in note


def test_analyses_are_told_one_after_the_other(bars: BarSolver) -> None:
    steps: list[Any] = []
    test = BarTest("one", ("warp", "fill"))
    series = Series(project_of(test), CARD, steps.append)
    assert series.total == 0 and series.solver is bars
    series.total = 2
    for part in parts_of(project_of(test), [test], 0.5).values():
        history = series.run(part, CARD.law)
    assert [(s.part, s.analysis, s.analyses, s.done, s.increments) for s in steps] == [
        ("warp", 1, 2, 0.0, 4), ("warp", 1, 2, 4.0, 4),
        ("fill", 2, 2, 0.0, 4), ("fill", 2, 2, 4.0, 4),
    ]  # fmt: skip
    assert series.notes(history) == []
    short = SimpleNamespace(law=SimpleNamespace(strain_range=[0.09, 1.0, 1.0]))
    series.card = short  # type: ignore[assignment]
    assert [note.kind for note in series.notes(history)] == [NoteKind.BEYOND_CARD]


def test_what_a_study_writes(tmp_path: Path) -> None:
    table, drawn = pd.DataFrame({"a": [1, 2], "b": ["x", "y"]}), []
    out, notes = tmp_path / "new", [Note(NoteKind.SNAP, "snaps", "one")]
    write_study(out, "mesh", table, drawn.append, {"a": [1]}, notes, "Finer", ["it settles"])
    page = read_page_data(out)
    assert page.title == "Finer" and page.warnings == [note.line for note in notes]
    assert page.tables[0].header == list(table.columns)
    assert (page.sections[0].parts[0].text, page.figures[0][0]) == ("it settles", "mesh.png")
    assert "it settles" in (out / "report.html").read_text()
    assert (out / "mesh.csv").read_bytes() == b"a,b\n1,x\n2,y\n" and drawn == [out / "mesh.png"]
    assert (out / "result.json").read_text() == '{\n "a": [\n  1\n ]\n}\n'
    assert (out / "notes.csv").read_text() == "of,kind,note\none,snap,snaps\n"
