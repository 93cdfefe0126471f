"""The spread of predicted loads by what a card leaves open: steps beside draws, and where it shows.

The solver is a formula whose load grows with E1 alone: limit tanh(stiffness d / limit).
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.kinds import Around, laws_around
from bubblefit.materials.card import CardCertainty, MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.reports.charts import Charts
from bubblefit.runs.predictions import Predictions, RunEvent, predict
from bubblefit.solvers import registry

from ..commands import in_process
from ..cylinder_cases import STOPS, Banded, Formula, write_project

#: MPa: E1 of the card, and by how much (1 sigma) two directions move it.
E1, OFF = 500.0, (0.6, -0.8)
#: G12, E2, E1 of each direction.
DIRECTIONS = np.array([[0.1, 2.0, OFF[0]], [0.2, -3.0, OFF[1]]])


@pytest.fixture(autouse=True)
def formula(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.SOLVERS, "formula", Formula)


def card(directions: np.ndarray = DIRECTIONS, e1: float = E1) -> MaterialCard:
    law = HypoelasticLaw.linear(e1, 150.0, 20.0)
    return MaterialCard(law, 0.81, "sure", "", CardCertainty(directions, "made"))


def predictions(folder: Path, own: MaterialCard, **options: object) -> Predictions:
    project = read_project(write_project(folder))
    return predict(project, "high", cards={"sure": own}, jobs=1, **options)  # type: ignore[arg-type]


def slope(folder: Path) -> np.ndarray:
    """N per MPa of E1 at the frames, by the formula."""
    loads = [predictions(folder, replace(card(), certainty=None,
                                         law=HypoelasticLaw.linear(e, 150.0, 20.0))).curves()
             for e in (E1 - 1, E1 + 1)]  # fmt: skip
    return np.asarray((loads[1]["load_N"] - loads[0]["load_N"]) / 2)


def test_steps_give_the_spread_to_first_order(tmp_path: Path) -> None:
    events: list[RunEvent | None] = []
    done = predictions(tmp_path, card(), progress=events.append)
    assert events[-1].total == 3  # the prediction, and a run a direction
    curve, (run,) = done.curves(), done.each
    expected = np.abs(slope(tmp_path)) * np.hypot(*OFF)
    np.testing.assert_allclose(curve["load_sigma_N"], expected, rtol=0.003, atol=1e-9)
    assert run.around.words == "2 of its least certain directions"
    at = float(np.interp(100.0, curve["deflection_mm"], curve["load_sigma_N"]))
    row = done.runs().iloc[0]
    assert row["load_at_100_mm_sigma_N"] == pytest.approx(at)
    assert row["load_at_100_mm_N"] > 0 and list(done.runs()["card"]) == ["sure"]
    said = done.result["runs"][0]
    assert said["load_sigma_N"]["100 mm"] == pytest.approx(at)
    assert said["spread"] == "2 of its least certain directions"


def test_draws_give_the_same_spread(tmp_path: Path) -> None:
    """Of 300 draws, whose standard deviation is known to 4 %."""
    steps = predictions(tmp_path, card()).curves()["load_sigma_N"].to_numpy()
    done = predictions(tmp_path, card(), samples=300)
    np.testing.assert_allclose(done.curves()["load_sigma_N"], steps, rtol=0.1, atol=1e-9)
    assert done.each[0].around.words == "300 laws drawn"
    # The same again: draws are not another every time.
    few = [predictions(tmp_path, card(), samples=5).curves()["load_sigma_N"] for _ in range(2)]
    np.testing.assert_array_equal(*few)


def test_the_spread_stands_wherever_the_load_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drawn: list[Charts]
) -> None:
    """Beside the band of the walls and told from it; nothing is invented for another card."""
    monkeypatch.setitem(registry.SOLVERS, "formula", Banded)
    plain = replace(card(), certainty=None)
    project = read_project(write_project(tmp_path))
    done = predict(project, ["high"], {"sure": card(), "plain": plain}, jobs=1, out=tmp_path / "o")
    assert [(r.card, r.wall, r.around is None) for r in done.each] == [
        ("sure", "slack", False), ("sure", "rigid wall", True),
        ("plain", "slack", True), ("plain", "rigid wall", True),
    ]  # fmt: skip
    done.report(tmp_path / "o")
    table = pd.read_csv(tmp_path / "o" / "load_deflection.csv")
    known = table[table["load_sigma_N"].notna()]
    assert set(zip(known["card"], known["wall"], strict=True)) == {("sure", "slack")}
    load = done.outcomes["cylinder"][0].measures[0].loads["100 mm"]
    sigma = done.result["runs"][0]["load_sigma_N"]["100 mm"]
    told = f"{load:.0f} ± {sigma:.2g}"
    assert any(f"{told} N" in line for line in done.lines())
    assert "no spread of loads with plain: the card does not say how sure it is" in done.lines()
    page = (tmp_path / "o" / "report.html").read_text()
    assert (
        told.replace(" ", "\u00a0") in page and "which is no part of the band of the walls" in page
    )
    assert [run["load_sigma_N"] for run in done.result["runs"][2:]] == [
        dict.fromkeys(("40 mm", "100 mm", "240 mm"))
    ] * 2
    (chart,) = [c for charts in drawn for c in charts.charts if c.y_label == "load, N"]
    (banded,) = [s for s in chart.series if s.y and s.lower]
    ends = [known["load_N"] + sign * 1.96 * known["load_sigma_N"] for sign in (-1, 1)]
    np.testing.assert_allclose([banded.lower, banded.upper], ends, rtol=1e-5)
    assert "95 % by the card" in [s.name for s in chart.series]


def test_another_program_is_not_run_unasked(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(Formula, "external", True)
    assert predictions(tmp_path, card()).each[0].around is None
    assert predictions(tmp_path, card(), samples=2).each[0].around.words == "2 laws drawn"


def test_the_command_asks_for_draws_or_none(tmp_path: Path) -> None:
    write_project(tmp_path)
    card().write(tmp_path / "sure.toml")
    command = ("bend", "project.toml", "--card", "sure.toml", "--test", "high", "--jobs", "1")
    in_process(*command, "--samples", "3", "--out", "some", cwd=tmp_path)
    runs = json.loads((tmp_path / "some" / "result.json").read_text())["runs"]
    assert [run["spread"] for run in runs] == ["3 laws drawn"]
    in_process(*command, "--samples", "0", "--out", "none", cwd=tmp_path)
    runs = json.loads((tmp_path / "none" / "result.json").read_text())["runs"]
    assert [run["spread"] for run in runs] == [None]


def test_what_is_not_known_is_not_said(tmp_path: Path) -> None:
    """A neighbour that ends half-way tells of the way so far; one that failed of nothing."""
    whole = predictions(tmp_path, card(np.array([[0, 0, E1 - STOPS]]), e1=E1))
    assert whole.curves()["load_sigma_N"].notna().all()
    half = predictions(tmp_path, card(np.array([[0, 0, 5.0]]), e1=STOPS - 5.0)).curves()
    known = half["load_sigma_N"].notna().to_numpy()
    assert known[: len(known) // 2 + 1].all() and not known[len(known) // 2 + 1 :].any()
    failed = predictions(tmp_path, card(np.array([[0, 0, 3.0]]), e1=10.0))
    assert failed.curves()["load_sigma_N"].isna().all()
    assert failed.each[0].around.words == "1 of its least certain directions, 1 failed"
    assert failed.result["runs"][0]["load_sigma_N"]["40 mm"] is None


def test_steps_and_draws() -> None:
    own, two = np.array([0.0, 10.0, 20.0]), [np.array([0.0, 11.0, 22.0]), np.array([0.0, 9.0])]
    steps = Around("directions", (1.0, -0.5)).sigma(own, two)
    np.testing.assert_allclose(steps, [0.0, np.hypot(1, 2), np.nan])
    drawn = Around("samples", (1.0, 1.0)).sigma(own, [*two, None])
    np.testing.assert_allclose(drawn, [0.0, np.sqrt(2), np.nan])
    assert np.isnan(Around("directions", (1.0, 1.0)).sigma(own, [two[0], None])).all()
    assert np.isnan(Around("samples", (1.0, 1.0)).sigma(own, [two[0], None])).all()


def test_a_step_keeps_the_moduli_positive(tmp_path: Path) -> None:
    """A G12 of 20 MPa that may be off by 30: the step goes up, half of it stays above zero."""
    around, laws = laws_around(card(np.array([[-30.0, 0, 0], [-15.0, 0, 0]])), None)
    assert around.steps == [-1.0, 1.0]
    assert [float(law.G12(0.0)) for law in laws] == pytest.approx([50.0, 5.0])
    torn = card(np.array([[-300.0, 1000.0, 0], [300.0, 0, 0]]))
    around, laws = laws_around(torn, None)
    assert all(float(law.E2(0.0)) > 0 and float(law.G12(0.0)) > 0 for law in laws)
    hopeless = card(np.array([[-3000.0, 2e5, 0]]))
    with pytest.raises(InputError, match="card 'sure': a modulus is not positive next to"):
        predictions(tmp_path, hopeless)
    assert laws_around(replace(card(), certainty=None), None) == (None, ())
