"""experiments/states.py: states and rates of tests that are fitted together."""

import math
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.states import notes_of_states, state_from_conditioning, state_of

from ..builders.load_histories import THREE_CYCLES, load_history, write_history


def test_state_of_a_card_is_that_of_its_strips():
    def state(*tests):
        return state_of([SimpleNamespace(**test) for test in tests])

    bubble = {"state": "first loading", "conditioning": None}
    silent = {"state": "", "conditioning": None}
    first, third = (
        {"state": state_from_conditioning(words), "conditioning": words}
        for words in ("none", "3 cycles")
    )
    assert [state(bubble), state(silent), state(bubble, silent)] == ["", "", ""]
    assert state(bubble, first) == state(first, silent) == "first loading"
    assert (state(third), state(bubble, third)) == ("conditioned", "")


@pytest.mark.parametrize(
    ("words", "state"),
    [
        ("none", "first loading"), ("No conditioning", "first loading"), ("nein", "first loading"),
        ("not conditioned", "first loading"), ("virgin", "first loading"), ("", "conditioned"),
        ("new fabric, 3 cycles", "conditioned"), ("northern room", "conditioned"),
    ],
)  # fmt: skip
def test_words_of_conditioning_are_understood(words, state):
    assert state_from_conditioning(words) == state


PACED = """
[fabric]
name = "made"
thickness = 0.8
[law]
form = "constant"
memory = { warp = { permanent_set = 0.3, unloading = 1.5, reloading = 1.0, saturation = 0.0 } }
bounds = { E1 = [0.1, 50], E2 = [0.1, 50], G12 = [0.01, 5] }
[[strips]]
name = "timed"
width = 50
grip_distance = 200
warp = { gauge_length = 100 }
data.files = { warp = ["strip.csv"] }
[[strips]]
name = "by key"
width = 50
grip_distance = 200
rate = 100
warp = { gauge_length = 100 }
data.files = { warp = ["untimed.csv"] }
[[biaxial]]
data.files = ["biaxial.csv"]
[[cycles]]
files = { warp = ["cycles.csv"] }
reference_load = 100.0
"""


def test_joined_tests_at_other_rates_or_holds_are_noted(tmp_path):
    time, load, strain = load_history(cycles=THREE_CYCLES[:1])
    pull = time[:40], 100 * strain[:40], load[:40]
    write_history(tmp_path / "strip.csv", ["Zeit (s),Dehnung (mm),Kraft (N)"], pull)
    write_history(tmp_path / "untimed.csv", ["Dehnung (mm),Kraft (N)"], pull[1:])
    # Ten times slower, and held at the top for ten minutes, in which it creeps.
    hold = np.linspace(0.0, 600.0, 41)[1:]
    time = np.r_[10 * time[:40], 10 * time[39] + hold, 10 * time[40:] + 600]
    load = np.r_[load[:40], np.full(40, load[39]), load[40:]]
    strain = np.r_[strain[:40], strain[39] + 1e-4 * np.log10(1 + hold), strain[40:]]
    write_history(tmp_path / "cycles.csv", ["time_s,load_N,strain"], (time, load, strain))
    head = ['time_s,"n_w, kN/m","n_f, kN/m","eps_w, %","eps_f, %"']
    both = time, load / 50, load / 50, 100 * strain, 100 * strain
    write_history(tmp_path / "biaxial.csv", head, both)
    (tmp_path / "project.toml").write_text(PACED)
    project = bf.read_project(tmp_path / "project.toml")
    rate = 0.010 / 19.5
    rates = {"timed": rate, "by key": 100 / 60 / 200, "biaxial": rate / 10, "cycles": rate / 10}
    assert {n: t.pace.rate for n, t in project.tests.items()} == pytest.approx(rates, rel=0.01)
    holds = {"timed": 0, "by key": math.nan, "biaxial": 600, "cycles": 600}
    found = {n: t.pace.hold for n, t in project.tests.items()}
    assert found == pytest.approx(holds, rel=0.05, nan_ok=True)

    def doubted(*names):
        return bf.check(project, names, out=tmp_path / "-".join(names)).result["joined"]

    assert doubted("biaxial", "cycles") == []
    first, second = doubted("timed", "cycles")
    assert "timed: 3.08 %/min" in first and "cycles: 0.308 %/min" in first
    assert "timed: 0 s" in second and "cycles: 6" in second
    page = (tmp_path / "timed-cycles" / "report.html").read_text()
    assert first in page and second in page


@pytest.mark.parametrize(
    ("states", "words"),
    [
        (["first loading", "conditioned", ""], ["(a: first loading, b: conditioned)"]),
        (["conditioned", "conditioned"], []),
        (["", ""], []),
    ],
)
def test_joined_tests_in_several_states_are_noted(states, words):
    tests = [
        SimpleNamespace(name=name, state=state, pace=None)
        for name, state in zip("abc", states, strict=False)
    ]
    notes = [str(note) for note in notes_of_states(tests)]
    assert len(notes) == len(words)
    assert all(word in note for word, note in zip(words, notes, strict=True))
