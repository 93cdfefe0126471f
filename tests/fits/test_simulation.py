"""Cards in tests: every kind in one way, failures, thicknesses, files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.simulation import simulate, simulate_cards

from ..bars import BarSolver, BarTest, project_of

CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")
THICK = MaterialCard(CARD.law, 1.0, "thick")


def test_one_card_in_one_test(bars: BarSolver) -> None:
    histories = simulate(BarTest("a bar", ("warp", "fill")), THICK, solver="bars")
    assert list(histories) == ["warp", "fill"]
    half = simulate(BarTest("a bar"), CARD, solver="bars")["warp"]
    np.testing.assert_allclose(histories["warp"].load, 2 * half.load)
    assert {model.thickness for model in bars.seen} == {0.5, 1.0}


def test_cards_in_tests(bars: BarSolver, tmp_path: Path) -> None:
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
        "one-bars.txt", "two-bars.txt", "notes.csv", "result.json"
    }  # fmt: skip
    assert steps[0].analyses == 6 and steps[-1].analysis == 6
    (note,) = done.numbers["notes"]
    assert note["of"] == "thick" and "1 mm" in note["note"] and "0.5 mm" in note["note"]
    assert done.lines[-1] == f"note: thick: {note['note']}" and "one: soft: pulled" in done.lines


def test_numbers_of_a_single_test_stand_at_the_top(bars: BarSolver, tmp_path: Path) -> None:
    tests = [BarTest("a bar")]
    done = simulate_cards(project_of(*tests), tests, {"soft": CARD}, tmp_path, command="mine")
    assert done.numbers["cards"] == done.numbers["tests"]["a bar"]["cards"]
    assert done.numbers["command"] == "mine" and done.numbers["solver"] == "bars"
    assert (tmp_path / "bars.txt").exists() and list(done.lines) == ["soft: pulled"]


def test_a_card_that_fails_is_left_out(bars: BarSolver, tmp_path: Path) -> None:
    bars.law_fails = lambda law: law.nu12 > 0.3
    stiff = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=0.4), 0.5, "stiff")
    tests = [BarTest("a bar")]
    done = simulate_cards(project_of(*tests), tests, {"soft": CARD, "stiff": stiff}, tmp_path)
    assert done.numbers["cards"]["stiff"] == {"warp": "the bar breaks"}
    with pytest.raises(SolverFailure, match="the bar breaks"):
        simulate_cards(project_of(*tests), tests, {"stiff": stiff}, tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_notes_of_failures_name_test_card_and_part(bars: BarSolver, tmp_path: Path) -> None:
    bars.law_fails = lambda law: law.nu12 > 0.3
    stiff = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=0.4), 0.5, "stiff")
    cards = {"soft": CARD, "stiff": stiff}

    def said(*tests: BarTest) -> list[str]:
        done = simulate_cards(project_of(*tests), list(tests), cards, tmp_path)
        assert {note["kind"] for note in done.numbers["notes"]} == {"failed"}
        written = (tmp_path / "notes.csv").read_text()
        lines = [f"{note['of']}: {note['note']}" for note in done.numbers["notes"]]
        assert all(note["of"] in written for note in done.numbers["notes"])
        assert done.lines[-len(lines) :] == [f"note: {line}" for line in lines]
        return lines

    assert said(BarTest("a bar")) == ["stiff: the bar breaks"]
    assert said(BarTest("a bar", ("warp", "fill"))) == [
        "stiff, warp: the bar breaks", "stiff, fill: the bar breaks"
    ]  # fmt: skip
    assert said(BarTest("one"), BarTest("two", ("warp", "fill"))) == [
        "one, stiff: the bar breaks", "two, stiff, warp: the bar breaks",
        "two, stiff, fill: the bar breaks",
    ]  # fmt: skip


def test_progress_names_card_and_part(bars: BarSolver, tmp_path: Path) -> None:
    tests, steps = [BarTest("a bar", ("warp", "fill"))], []
    simulate_cards(project_of(*tests), tests, {"soft": CARD}, tmp_path, progress=steps.append)
    assert [(s.part, s.analysis, s.analyses, s.done, s.increments) for s in steps] == [
        ("soft, warp", 1, 2, 0.0, 0), ("soft, warp", 1, 2, 4.0, 0),
        ("soft, fill", 2, 2, 0.0, 0), ("soft, fill", 2, 2, 4.0, 0),
    ]  # fmt: skip


def test_a_solver_that_there_is_not() -> None:
    with pytest.raises(InputError, match="nowhere"):
        simulate(BarTest("a bar"), CARD, solver="nowhere")
