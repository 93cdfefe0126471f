"""Forward analyses of tests with cards, and the cards that fail."""

import json

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.simulation import parts_of, simulate, simulate_cards, studied_tests

from ..builders.bars import BarKind, BarTest, project_of
from ..support.refusals import complaint, raised


def test_parts_are_named_by_what_distinguishes_them(bars, monkeypatch):
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
    assert studied_tests(project) == [one, two]
    with pytest.raises(InputError, match="names no test"):
        studied_tests(project, [])
    assert studied_tests(project, ["two"]) == [two]
    monkeypatch.setattr(BarKind, "studied", None)
    said = complaint(studied_tests, project)
    assert said == "bars.toml: no study can run the tests of this project"


CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")


THICK = MaterialCard(CARD.law, 1.0, "thick")


def test_test_is_simulated_with_one_card(bars):
    histories = simulate(BarTest("a bar", ("warp", "fill")), THICK, solver="bars")
    assert list(histories) == ["warp", "fill"]
    half = simulate(BarTest("a bar"), CARD, solver="bars")["warp"]
    np.testing.assert_allclose(histories["warp"].load, 2 * half.load)
    assert {model.thickness for model in bars.seen} == {0.5, 1.0}
    raised(InputError, "nowhere", simulate, BarTest("a bar"), CARD, solver="nowhere")


def test_tests_are_simulated_with_cards_of_project(bars, tmp_path):
    tests, steps = [BarTest("one", ("warp", "fill")), BarTest("two")], []
    cards = {"soft": CARD, "thick": THICK}
    done = simulate_cards(project_of(*tests), tests, cards, tmp_path, progress=steps.append)
    text = (tmp_path / "result.json").read_text()
    assert text == json.dumps(done.numbers, indent=1) + "\n"
    assert list(done.numbers["tests"]) == ["one", "two"] and "cards" not in done.numbers
    soft, thick = done.numbers["tests"]["two"]["cards"].values()
    assert thick["warp"] == pytest.approx(2 * soft["warp"])
    # Each test has files of its own.
    assert {path.name for path in tmp_path.iterdir()} == {
        "one-bars.txt", "two-bars.txt", "notes.csv", "result.json", "page.json", "report.html"
    }  # fmt: skip
    assert [(s.part, s.analysis, s.analyses, s.done, s.increments) for s in steps[:4]] == [
        ("soft, warp", 1, 6, 0.0, 0), ("soft, warp", 1, 6, 4.0, 0),
        ("soft, fill", 2, 6, 0.0, 0), ("soft, fill", 2, 6, 4.0, 0),
    ]  # fmt: skip
    (note,) = done.numbers["notes"]
    assert note["of"] == "thick" and "1 mm" in note["note"] and "0.5 mm" in note["note"]
    assert done.lines[-2] == f"note: thick: {note['note']}" and "one: soft: pulled" in done.lines
    assert done.lines[-1] == "Usable: 6 of 6 analyses ended." == f"{done.verdict.lines[-1]}"


STIFF = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=0.4), 0.5, "stiff")


def test_failing_card_is_left_out_of_simulation(bars, tmp_path):
    tests = [BarTest("a bar")]
    done = simulate_cards(project_of(*tests), tests, {"soft": CARD}, tmp_path, command="mine")
    # Numbers of a single test stand at the top.
    assert done.numbers["cards"] == done.numbers["tests"]["a bar"]["cards"]
    assert done.numbers["command"] == "mine" and done.numbers["solver"] == "bars"
    assert (tmp_path / "bars.txt").exists() and done.lines[0] == "soft: pulled"
    bars.law_fails = lambda law: law.nu12 > 0.3
    done = simulate_cards(project_of(*tests), tests, {"soft": CARD, "stiff": STIFF}, tmp_path)
    assert done.numbers["cards"]["stiff"] == {"warp": "the bar breaks"}
    assert [note["of"] for note in done.numbers["notes"]] == ["stiff"]
    several = [BarTest("one", ("warp", "fill")), BarTest("two")]
    cards = {"soft": CARD, "stiff": STIFF}
    notes = simulate_cards(project_of(*several), several, cards, tmp_path / "several").notes
    assert [note.of for note in notes] == ["one, stiff, warp", "one, stiff, fill", "two, stiff"]
    with pytest.raises(SolverFailure, match="the bar breaks"):
        simulate_cards(project_of(*tests), tests, {"stiff": STIFF}, tmp_path / "none")
    assert not (tmp_path / "none").exists()
