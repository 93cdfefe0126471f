"""Cards on strips: RMS errors, curves to the end of a card's range, analyses that fail."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.kinds import CardRun, Output
from bubblefit.experiments.strips import report
from bubblefit.experiments.strips.test import StripsTest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...projects import project_file
from ...published_laws import TABLE_3_2
from .sections import CURVES, LENGTHS, PUBLISHED, SMALL, read

SHORT = HypoelasticLaw(1e3 * np.array(TABLE_3_2), 0.24, [0.08, 0.1, 0.2])
LINEAR = HypoelasticLaw.linear(500.0, 200.0, 20.0)


@pytest.fixture
def test(tmp_path: Path) -> StripsTest:
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())
    return read(project_file(tmp_path, PUBLISHED, ("increments = 100", "increments = 10")))


def card(name: str, law: HypoelasticLaw) -> MaterialCard:
    return MaterialCard(law, 0.81, name, "a test")


def run(test: StripsTest, cards: Mapping[str, MaterialCard]) -> dict[tuple[str, str], CardRun]:
    runs = {}
    for name, own in cards.items():
        for direction, model in test.models(own.thickness).items():
            try:
                outcome = MembraneSolver().run(model, own.law)
            except SolverFailure as failure:
                outcome = failure
            runs[name, direction] = CardRun(model, outcome)
    return runs


def test_two_cards_side_by_side(test, tmp_path):
    cards = {"table": card("table", replace(SHORT, strain_range=[0.153, 0.232, 0.883])),
             "linear": card("linear", LINEAR)}  # fmt: skip
    runs = run(test, cards)
    told = report.simulate(test, cards, runs, Output(tmp_path / "sim"))
    assert list(told.numbers["cards"]) == ["table", "linear"]
    assert [name for name, _ in told.figures] == ["loads.png"]
    table = told.numbers["cards"]["table"]
    assert told.lines[0].startswith("table: RMS warp ") and "; sum " in told.lines[0]
    loads = pd.read_csv(tmp_path / "sim/loads.csv")
    for direction, strip in test.strips.items():
        history = runs["table", direction].outcome
        own = loads[(loads["card"] == "table") & (loads["direction"] == direction)]
        np.testing.assert_allclose(own["load_N"], history.load)
        off = history.load - strip.polynomial(own["elongation_mm"].to_numpy())
        numbers = table["directions"][direction]
        assert numbers["rms_N"] == pytest.approx(np.sqrt(np.mean(off**2)))
        assert numbers["end_load_N"] == history.load[-1]
        assert numbers["shown_to_mm"] == pytest.approx(strip.elongation)
    total = sum(n["rms_N"] for n in table["directions"].values())
    assert table["e_uniaxial_N"] == pytest.approx(total)
    assert {p.name for p in (tmp_path / "sim").iterdir()} == {
        "loads.csv", "loads.png", "bias-1.png", "bias-1.vtu", "bias-2.png", "bias-2.vtu"
    }  # fmt: skip


def test_within_the_range_of_the_card(test, tmp_path):
    """A card of small strains: its curves end early, and no sum of errors is made of them."""
    cards = {"short": card("short", SHORT)}
    told = report.simulate(test, cards, run(test, cards), Output(tmp_path / "sim"), True)
    (numbers,) = told.numbers["cards"].values()
    assert numbers["e_uniaxial_N"] is None
    for direction, end in (("warp", 0.08), ("fill", 0.1)):
        shown, start = numbers["directions"][direction]["shown_to_mm"], LENGTHS[direction][0]
        step = (LENGTHS[direction][1] - start) / 10
        assert shown <= start * np.expm1(end) < shown + step
    assert 0 < numbers["directions"]["bias"]["shown_to_mm"] < 5


def test_a_card_that_fails_on_a_strip_is_told_as_such(test, tmp_path):
    beta = np.zeros(12)
    beta[[3, 7, 10, 11]] = 20.0, 220.0, -5000.0, 300.0  # E1 negative beyond a strain of 0.06
    cards = {"brittle": card("brittle", HypoelasticLaw(beta)), "good": card("good", LINEAR)}
    told = report.simulate(test, cards, run(test, cards), Output(tmp_path / "sim", "one-"))
    brittle, fine = told.numbers["cards"].values()
    assert "failed" in brittle["directions"]["warp"] and brittle["e_uniaxial_N"] is None
    assert brittle["directions"]["fill"]["rms_N"] > 0 and fine["e_uniaxial_N"] > 0
    text = "\n".join(told.lines)
    assert "warp failed" in text
    loads = pd.read_csv(tmp_path / "sim/one-loads.csv")
    assert set(loads[loads["card"] == "good"]["direction"]) == set(LENGTHS)
    assert "warp" not in set(loads[loads["card"] == "brittle"]["direction"])


def test_without_data_the_loads_at_the_end_are_told(tmp_path):
    ends = [(f"gauge_length = {a}.0", f"gauge_length = {a}.0\nfinal_length = {a + 1}.0")
            for a in (20, 22, 19)]  # fmt: skip
    steps = ("[warp]", "increments = 3\n[warp]")
    test = read(project_file(tmp_path, SMALL, steps, *ends), need_data=False)
    cards = {"some": card("some", LINEAR)}
    told = report.simulate(test, cards, run(test, cards), Output(tmp_path / "sim"))
    assert "N at the end" in told.lines[0]
    (numbers,) = told.numbers["cards"].values()
    assert numbers["e_uniaxial_N"] is None
    directions = numbers["directions"].values()
    assert all(n["rms_N"] is None and n["end_load_N"] > 0 for n in directions)
