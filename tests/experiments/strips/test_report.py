"""What is told of strips whose numbers are known: findings, tables, cards side by side, noise."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.kinds import READING, UNMATCHED, CardRun, Output
from bubblefit.experiments.strips import report
from bubblefit.experiments.strips.data import BELOW, BEYOND, Strip
from bubblefit.experiments.strips.prepared import FittedStrip, LoadObjective
from bubblefit.experiments.strips.report import LEFT_OUT, examine, load_table, misfit_table
from bubblefit.experiments.strips.test import StripsTest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...drawings import caught
from ...projects import project_file
from ...published_laws import TABLE_3_2
from .sections import CURVES as EXAMPLE
from .sections import LENGTHS, PUBLISHED, SMALL, read

WAY = np.array([2.0, -0.5, 1.0, 4.0, 4.5, 0.0])
CURVES = (
    LoadCurve("warp", "1", WAY, 100 * WAY, Path("w.csv"), notes=("a note", "another")),
    LoadCurve("warp", "2", WAY[:3], 120 * WAY[:3], None, notes=("a note",)),
)
LINE = fit_load_polynomial(np.linspace(0, 4, 9), 110 * np.linspace(0, 4, 9), 1)
WARP = Strip("warp", 20.0, 24.0, LINE, CURVES, scatter=7.5)
#: Two increments, to 2 and 4 mm.
MODEL = straight_strip("warp", 20.0, 24.0, 0.8, increments=2)


def history(*load: float, shear: float = 0.0) -> History:
    strain = np.array([0.1, 0.02, shear])
    return History(np.array(load), np.zeros((2, 4, 3)), -strain / 2, strain)


def fitted(strip: Strip = WARP, loads=(203.0, 396.0)) -> FittedStrip:
    """2 and 4 mm matched at 200 and 400 N: off by 3 and -4 N, 3.54 N RMS."""
    objective = LoadObjective([2.0, 4.0], [2.0, 4.0], [200.0, 400.0])
    return FittedStrip(strip, MODEL, objective, history(*loads))


def prepared(test: Any, strips: list[FittedStrip]) -> Any:
    return SimpleNamespace(test=test, fitted_strips=lambda _: strips)


def findings(test: Any, strips: list[FittedStrip]) -> Any:
    return report.findings(prepared(test, strips), cast(Any, None))


BIAS = replace(WARP, direction="bias", scatter=None, curves=(), polynomial=None)


def test_findings():
    test: Any = SimpleNamespace(name="s", match_by="points", weights={"warp": 1.0, "bias": 2.5})
    found = findings(test, [fitted(), fitted(BIAS, (200.0, 410.0))])
    rms = np.sqrt(12.5), np.sqrt(50.0)
    warp = {
        "rms_N": pytest.approx(rms[0]), "scatter_N": 7.5, "weight": 1.0, "matched": 2,
        "gauge_length_mm": 20.0, "final_length_mm": 24.0, "end_load_N": 396.0,
    }  # fmt: skip
    bias = warp | {
        "rms_N": pytest.approx(rms[1]), "scatter_N": None, "weight": 2.5, "end_load_N": 410.0
    }  # fmt: skip
    assert found.numbers == {
        "directions": {"warp": warp, "bias": bias},
        "e_uniaxial_N": pytest.approx(sum(rms)),
        "matched_by": "points",
    }
    assert found.lines == (
        "RMS error, N: warp 3.54 (specimens scatter by 7.5), bias 7.07; sum 10.61",
    )
    assert found.quality == "RMS errors in N: warp 3.536, bias 7.071"
    assert found.summary == "RMS errors in N: warp 3.54, bias 7.07, together 10.61"
    left_out = "3 points beyond the final length (or before zero) were left out"
    assert [(n.kind, str(n), n.of) for n in found.warnings] == [
        (UNMATCHED, "no fill strip of s is matched: E2 rests on the other directions", ""),
        (READING, "a note", ""),
        (READING, "another", ""),
        (LEFT_OUT, left_out, "warp"),
    ]
    test.match_by = "polynomial"
    assert [n.kind for n in findings(test, [fitted()]).warnings].count(LEFT_OUT) == 0


def test_tables():
    both = [fitted(), fitted(BIAS, (200.0, 410.0))]
    table = misfit_table(both)
    assert table.header == [
        "strip", "RMS error, N", "scatter of specimens, N", "R² of polynomial", "its RMSE, N",
        "points matched", "load at the end, N",
    ]  # fmt: skip
    assert [row[0] for row in table.rows] == ["warp", "bias"]
    assert table.rows[0][1:] == pytest.approx([np.sqrt(12.5), 7.5, 1.0, 0.0, 2, 396.0], abs=1e-9)
    assert table.rows[1][1:] == [pytest.approx(np.sqrt(50.0)), None, None, None, 2, 410.0]
    loads = load_table(both)
    assert list(loads.columns) == [
        "direction", "elongation_mm", "engineering_strain", "model_N", "polynomial_N"
    ]  # fmt: skip
    assert loads["direction"].tolist() == ["warp"] * 2 + ["bias"] * 2
    assert loads.iloc[1].tolist()[1:] == pytest.approx([4.0, 0.2, 396.0, 440.0])
    assert loads["polynomial_N"].isna().tolist() == [False, False, True, True]
    rest = report.residuals(prepared(None, both), cast(Any, None))
    assert loads.index.tolist() == rest.index.tolist() == [0, 1, 2, 3]
    assert list(rest.columns) == [
        "part", "elongation_mm", "quantity", "measured", "modelled", "difference", "unit"
    ]  # fmt: skip
    assert rest.iloc[1].tolist() == ["warp", 4.0, "load", 400.0, pytest.approx(396.0),
                                     pytest.approx(-4.0), "N"]  # fmt: skip


def test_points_of_a_strip_and_those_left_out():
    elongation, load = WARP.points
    assert elongation.tolist() == [0.0, 1.0, 1.0, 2.0, 2.0, 4.0]
    assert load.tolist() == [0.0, 100.0, 120.0, 200.0, 240.0, 400.0]
    assert WARP.specimen_of.tolist() == [0, 0, 1, 0, 1, 0] and WARP.beyond == 3
    (file,) = WARP.data_files(points=True)
    assert (file.path, file.used, file.dropped) == (Path("w.csv"), 4, {BELOW: 1, BEYOND: 1})
    (file,) = WARP.data_files(points=False)
    assert (file.used, file.dropped) == (6, {})
    # The last point may lie at the end by rounding.
    just = replace(WARP, final_length=20.0 + 4.0 * (1 - 1e-10))
    assert just.beyond == 3 and just.data_files(True)[0].dropped[BEYOND] == 1
    short = replace(WARP, final_length=20.0 + 4.0 * (1 - 1e-8))
    assert short.beyond == 4 and short.data_files(True)[0].dropped[BEYOND] == 2
    assert BIAS.points[0].size == BIAS.specimen_of.size == BIAS.beyond == 0


def test_lengths_and_noise_of_a_strip():
    assert WARP.elongation == 4.0 and WARP.strain == pytest.approx(np.log(1.2))
    some = np.array([True, True, True, True, True, False])
    assert WARP.strain_by(some) == WARP.strain
    opened = replace(WARP, open_end=True)
    assert opened.strain_by(some) == pytest.approx(np.log(1.1))
    assert opened.strain_by(None) == pytest.approx(np.log(1.2))
    assert replace(BIAS, open_end=True).strain_by(some) == pytest.approx(np.log(1.2))
    assert WARP.noise(1000.0) == (7.5, "specimens' scatter")
    assert WARP.noise(1000.0, 0.0) == (0.0, "given")
    assert BIAS.noise(1000.0) == (5.0, "assumed")
    assert BIAS.break_shares() is None


def test_breaks_of_a_strip_are_shares_of_its_strain():
    """A load that bends at a quarter and at two thirds of the strain, and one that is cut there."""
    strain = np.log1p(np.linspace(0, 4, 400) / 20.0)
    end = strain[-1]
    load = 900 * strain - 800 * np.maximum(strain - end / 4, 0) + 500 * np.maximum(
        strain - end * 2 / 3, 0)  # fmt: skip
    polynomial = fit_load_polynomial(np.linspace(0, 4, 400), load, 12)
    shares = replace(WARP, polynomial=polynomial).break_shares()
    assert shares == pytest.approx((0.25, 0.667), abs=0.05)


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Any]]:
    biases: list[Any] = []
    monkeypatch.setattr(report, "draw_bias", lambda *what: biases.append(what))
    return {"loads": caught(monkeypatch, report, "load_charts"), "draw_bias": biases}


def told(folder: Path, outcomes: dict[tuple[str, str], Any], within: bool = False) -> Any:
    strips = {"warp": WARP, "bias": BIAS}
    test: Any = SimpleNamespace(strips={d: strips[d] for _, d in outcomes})
    law = SimpleNamespace(strain_range=np.array([0.1, 0.1, 0.1]))
    cards: Any = {name: SimpleNamespace(law=law) for name, _ in outcomes}
    runs = {key: CardRun(MODEL, outcome) for key, outcome in outcomes.items()}
    return report.simulate(test, cards, runs, Output(folder), within)


def test_cards_side_by_side(tmp_path, drawn):
    """The polynomial says 220 and 440 N at 2 and 4 mm."""
    broken = SolverFailure("no equilibrium", "membrane")
    said = told(tmp_path, {
        ("soft", "warp"): history(223.0, 436.0), ("soft", "bias"): history(10.0, 20.0, shear=0.3),
        ("hard", "warp"): broken, ("hard", "bias"): history(11.0, 21.5),
    })  # fmt: skip
    rms = float(np.sqrt(12.5))
    warp = {
        "rms_N": pytest.approx(rms), "end_load_N": 436.0, "shown_to_mm": 4.0,
        "strain_reached": {"warp": 0.1, "fill": 0.02, "shear": 0.0},
    }  # fmt: skip
    bias = {
        "rms_N": None, "end_load_N": 20.0, "shown_to_mm": 4.0,
        "strain_reached": {"warp": 0.1, "fill": 0.02, "shear": 0.3},
    }  # fmt: skip
    cards = said.numbers["cards"]
    assert cards["soft"] == {"e_uniaxial_N": None, "directions": {"warp": warp, "bias": bias}}
    assert cards["hard"]["directions"]["warp"] == {"failed": "no equilibrium"}
    assert said.lines == [
        "soft: RMS warp 3.536 N to 4 mm, bias 20 N at the end",
        "hard: RMS warp failed, bias 21.5 N at the end",
    ]
    assert said.figures == [("loads.png", "Load over gauge elongation")]
    table = pd.read_csv(tmp_path / "loads.csv")
    assert list(table.columns) == ["card", "direction", "elongation_mm", "load_N"]
    assert table.to_numpy().tolist() == [
        ["soft", "warp", 2.0, 223.0], ["soft", "warp", 4.0, 436.0],
        ["soft", "bias", 2.0, 10.0], ["soft", "bias", 4.0, 20.0],
        ["hard", "bias", 2.0, 11.0], ["hard", "bias", 4.0, 21.5],
    ]  # fmt: skip
    ((path, _, (first, second)),) = drawn["loads"]
    assert path == tmp_path / "loads.png"
    assert [(name, load.tolist()) for name, _, load in first.models] == [("soft", [223.0, 436.0])]
    assert list(first.rms) == pytest.approx([rms]) and list(second.rms) == []
    assert [name for name, *_ in second.models] == ["soft", "hard"]
    assert [call[2].name for call in drawn["draw_bias"]] == ["bias-1.png", "bias-2.png"]
    assert [call[3].name for call in drawn["draw_bias"]] == ["bias-1.vtu", "bias-2.vtu"]


def test_one_card_has_a_sum_and_files_without_a_number(tmp_path, drawn):
    said = told(tmp_path, {("soft", "warp"): history(223.0, 436.0)})
    assert said.numbers["cards"]["soft"]["e_uniaxial_N"] == pytest.approx(np.sqrt(12.5))
    assert said.lines == ["soft: RMS warp 3.536 N to 4 mm; sum 3.536 N"]
    told(tmp_path, {("soft", "bias"): history(10.0, 20.0)})
    assert drawn["draw_bias"][0][2].name == "bias.png"


@pytest.mark.parametrize(
    ("strains", "shown"),
    [
        ((0.1, 0.1, 0.1), 2), ((0.101, 0.0, 0.0), 1), ((0.0, 0.101, 0.0), 1),
        ((0.0, 0.0, -0.101), 1), ((-0.5, -0.5, 0.0), 2), ((0.1 * (1 + 1e-7), 0.0, 0.0), 2),
    ],
)  # fmt: skip
def test_curves_end_where_the_range_of_the_card_does(
    tmp_path, drawn, monkeypatch, strains, shown: int
):
    """At the first increment nothing is strained, at the second so much."""
    strain = iter([np.zeros((1, 3)), np.array([strains])])
    monkeypatch.setattr(report, "middle_strain", lambda *_: next(strain))
    said = told(tmp_path, {("soft", "warp"): history(223.0, 436.0)}, within=True)
    (card,) = said.numbers["cards"].values()
    warp = card["directions"]["warp"]
    assert warp["shown_to_mm"] == 2.0 * shown and warp["end_load_N"] == 436.0
    assert warp["rms_N"] == pytest.approx(3.0 if shown == 1 else np.sqrt(12.5))
    assert (card["e_uniaxial_N"] is None) == (shown == 1)
    ((_, _, (panel,)),) = drawn["loads"]
    assert len(panel.models[0][1]) == shown
    assert len(pd.read_csv(tmp_path / "loads.csv")) == 2


def test_a_card_whose_range_ends_at_once(tmp_path, drawn, monkeypatch):
    monkeypatch.setattr(report, "middle_strain", lambda *_: np.ones((1, 3)))
    said = told(tmp_path, {("soft", "warp"): history(223.0, 436.0)}, within=True)
    warp = said.numbers["cards"]["soft"]["directions"]["warp"]
    assert (warp["shown_to_mm"], warp["rms_N"]) == (0.0, None)
    ((_, _, (panel,)),) = drawn["loads"]
    assert not panel.models


WAY_EXAMINED = np.array([0.1, 1.0, 2.0, 4.0, 3.9])
LOAD = np.array([2.0, 50.0, 90.0, 160.0, 120.0])


def test_every_cell(tmp_path):
    curve = LoadCurve("warp", "W1", WAY_EXAMINED, LOAD, None)
    line = fit_load_polynomial(np.linspace(0, 6, 9), 30 * np.linspace(0, 6, 9), 1)
    test = SimpleNamespace(
        strips={
            "warp": Strip("warp", 20.0, 24.0, None, (curve,)),
            "fill": Strip("fill", 25.0, 30.0, line),
            "bias": Strip("bias", 20.0, 30.0),  # without data
        }
    )
    shown = examine(SimpleNamespace(test=test), Output(tmp_path, "s/"))
    assert shown.figures == [("s/curves.png", "load curves as they were read")]
    assert (tmp_path / "s" / "curves.png").is_file()
    (table,) = shown.tables
    assert table.header == [
        "direction", "specimen", "points", "first elongation, mm", "last, mm", "last strain",
        "first load, N", "largest load, N",
    ]  # fmt: skip
    first, second = table.rows
    assert first[:2] == ["warp", "W1"] and second[:2] == ["fill", "polynomial"]
    assert first[2:] == pytest.approx([5, 0.1, 3.9, np.log(23.9 / 20), 2.0, 160.0])
    assert second[2:] == pytest.approx([50, 0.0, 5.0, np.log(1.2), 0.0, 150.0])
    assert (table.title, table.text) == ("Load curves as read", (1,))


SHORT = HypoelasticLaw(1e3 * np.array(TABLE_3_2), 0.24, [0.08, 0.1, 0.2])
LINEAR = HypoelasticLaw.linear(500.0, 200.0, 20.0)


@pytest.fixture
def test(tmp_path) -> StripsTest:
    (tmp_path / "curves.csv").write_bytes((EXAMPLE / "curves.csv").read_bytes())
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
