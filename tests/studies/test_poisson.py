"""Responses over nu12: ratios, values that fail, closed forms."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.notes import Note, NoteKind
from bubblefit.reports.charts import Charts
from bubblefit.runs.poisson import Nu12Study, PartRatios, by_response, ratios, vary_nu12
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..bars import STRETCH, BarSolver, BarTest, project_of
from ..drawings import data
from ..page_charts import charts_of

CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")
END = "load at the end, N"


def test_ratios_leave_out_what_failed() -> None:
    found = ratios([0.1, 0.2, 0.3], [2.0, np.nan, 4.0], 2.5)
    assert found.to_base == pytest.approx([0.8, np.nan, 1.6], nan_ok=True)
    assert found.to_mean == pytest.approx([2 / 3, np.nan, 4 / 3], nan_ok=True)
    assert found.spread == pytest.approx((-0.2, 0.6))
    assert np.isnan(ratios([0.1], [np.nan], 1.0).spread).all()
    named = by_response([0.1, 0.2], [{"a": 1.0}, None], {"a": 2.0})
    assert named["a"].to_base == pytest.approx([0.5, np.nan], nan_ok=True)
    early = by_response([0.1, 0.2], [{"a": 1.0}, {"a": 2.0, "b": 1.0}], {"a": 2.0, "b": 4.0})
    assert early["b"].to_base == pytest.approx([np.nan, 0.25], nan_ok=True)


def test_a_bar_in_closed_form(bars: BarSolver, tmp_path: Path, drawn: list[Charts]) -> None:
    study = vary_nu12(project_of(BarTest("a bar")), CARD, [0.4, 0.0, 0.4])
    found = study.parts["a bar"].responses[END]
    assert found.nu12.tolist() == [0.0, 0.4] and study.base == 0.24
    eps = np.log1p(STRETCH)
    assert found.to_base == pytest.approx(np.exp(-(found.nu12 - 0.24) * eps), rel=1e-9)
    study.write(tmp_path)
    table = pd.read_csv(tmp_path / "nu12.csv")
    pd.testing.assert_frame_equal(table, study.table())
    text = (tmp_path / "result.json").read_text()
    assert text == json.dumps(study.result, indent=1) + "\n"
    assert (tmp_path / "nu12.png").exists()
    shown, base = data(drawn[0].charts[0])
    np.testing.assert_allclose(shown, [found.nu12, found.to_base], rtol=1e-5)
    assert base.ravel().tolist() == [0.24, 1.0]
    (chart,) = charts_of(tmp_path)["nu12"]
    assert chart.series[0].x == found.nu12.tolist() and chart.series[0].name == END
    assert chart.series[0].y == pytest.approx(found.to_base, rel=1e-5)
    assert any(line.startswith(f"a bar, {END}") for line in study.lines())


def test_a_value_that_fails_is_named(bars: BarSolver) -> None:
    bars.law_fails = lambda law: law.nu12 > 0.4
    study = vary_nu12(project_of(BarTest("a bar")), CARD)
    assert study.parts["a bar"].failed == {"0.45": "the bar breaks"}
    assert study.result["models"]["a bar"]["responses"][END]["to_base"][-1] is None
    assert "note: a bar, nu12 = 0.45: the bar breaks" in study.lines()
    with pytest.raises(SolverFailure):
        vary_nu12(project_of(BarTest("a bar")), CARD, [0.45])
    with pytest.raises(SolverFailure):  # the card as it is
        vary_nu12(project_of(BarTest("a bar")), replace(CARD, law=replace(CARD.law, nu12=0.41)))


def test_values_out_of_range() -> None:
    with pytest.raises(InputError, match="--nu12: expected 0 <= nu12 < 1, got 1"):
        vary_nu12(project_of(BarTest("a bar")), CARD, [1.5])


def test_a_straight_strip_in_closed_form() -> None:
    """Constant thickness: the width follows nu12, so the load falls with exp(-nu12 eps)."""
    model = straight_strip("warp", 20.0, 22.0, 0.8, increments=20)

    def load(nu12: float) -> float:
        law = HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=nu12)
        return float(MembraneSolver().run(model, law).load[-1])

    found = ratios([0.0, 0.4], [load(0.0), load(0.4)], load(0.24))
    eps = np.log(1.1)
    assert found.to_base == pytest.approx(np.exp(-(found.nu12 - 0.24) * eps), rel=1e-6)


def test_all_that_is_told_of_the_responses() -> None:
    """Two responses of one part, one value of which failed."""
    nu12 = [0.05, 0.45]
    responses = {
        "a, N": ratios(nu12, [4.4, 3.6], 4.0),
        "long, N": ratios(nu12, [9.0, np.nan], 10.0),
    }
    note = Note(NoteKind.FAILED, "breaks", "nu12 = 0.45")
    part = PartRatios("load", responses, {"0.45": "breaks"}, [note])
    study = Nu12Study(Path("a.toml"), "soft", "bars", 0.24, {"bar": part})
    assert study.lines() == [
        "load, relative to that at nu12 = 0.24",
        "                 0.05     0.45   spread",
        "bar, a, N      1.1000   0.9000   -10.0 to +10.0 %",
        "bar, long, N   0.9000      nan   -10.0 to -10.0 %",
        "note: bar, nu12 = 0.45: breaks",
    ]
    table = study.table()
    assert list(table.columns) == ["model", "response", "nu12", "value", "to_base", "to_mean"]
    assert table["response"].tolist() == ["a, N", "a, N", "long, N", "long, N"]
    numbers = table[["nu12", "value", "to_base", "to_mean"]].to_numpy().ravel()
    assert numbers == pytest.approx(
        [0.05, 4.4, 1.1, 1.1, 0.45, 3.6, 0.9, 0.9, 0.05, 9.0, 0.9, 1.0, 0.45, *[np.nan] * 3],
        nan_ok=True,
    )
    result = study.result
    assert result["models"]["bar"]["failed"] == {"0.45": "breaks"}
    assert result["models"]["bar"]["responses"]["long, N"]["value"] == [9.0, None]
    assert (result["command"], result["base_nu12"], result["response"]) == (
        "study nu12", 0.24, "load"
    )  # fmt: skip
    other = Nu12Study(
        Path("a"), "soft", "bars", 0.24, {"x": part, "y": replace(part, response="rise")}
    )
    assert other.response == "load or rise"


@pytest.mark.parametrize("value", [0.0, 0.999])
def test_all_of_the_range_of_nu12_can_be_asked_for(bars: BarSolver, value: float) -> None:
    study = vary_nu12(project_of(BarTest("a bar")), CARD, [value])
    assert study.parts["a bar"].responses[END].nu12.tolist() == [value]
    for wrong in (-1e-9, 1.0):
        with pytest.raises(InputError, match="--nu12"):
            vary_nu12(project_of(BarTest("a bar")), CARD, [wrong])
