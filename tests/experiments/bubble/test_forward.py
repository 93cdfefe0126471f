"""Cards on a bubble: numbers, lines, table and files of a made-up history."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble import KIND, forward
from bubblefit.experiments.bubble.section import Sheet
from bubblefit.experiments.kinds import CardRun, Output
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.base import History

from ...drawings import caught

PART = "bubble"
BETA = np.zeros(12)
BETA[[11, 7, 3]] = 500.0, 200.0, 40.0
MODEL = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.8, (0.022, 0.3), (0.022, 0.3))
#: In mm: a paraboloid of 10 and 30 mm, sheared aside by 1 mm at the end.
ROUND = 1 - (MODEL.mesh.points[:, :2] ** 2).sum(axis=1) / 100.0**2


def history() -> History:
    u = np.zeros((2, len(ROUND), 3))
    u[:, :, 2] = np.outer([10.0, 30.0], ROUND)
    u[1, :, 0] = ROUND
    strain = np.array([0.11, 0.22, 0.04]), np.array([0.0, 0.0, -0.33])
    return History(np.array([0.022, 0.3]), u, strain[1], strain[0])


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    return caught(monkeypatch, forward, "cut_charts")


def simulated(folder: Path, sheet: object = Sheet(), **outcomes: Any) -> Any:
    test: Any = SimpleNamespace(name="b", pressures=MODEL.pressures, sheet=sheet)
    cards: Any = dict.fromkeys(outcomes, SimpleNamespace(law=HypoelasticLaw(BETA, 0.25)))
    runs = {(name, PART): CardRun(MODEL, outcome) for name, outcome in outcomes.items()}
    return KIND.simulate(test, cards, runs, Output(folder))


def test_one_card(tmp_path: Path, drawn: list[Any]) -> None:
    said = simulated(tmp_path, soft=history())
    own = {
        "pressure_kPa": pytest.approx([22.0, 300.0]),
        "apex_mm": pytest.approx([10.0, 30.0]),
        "strain_reached": {"warp": 0.11, "fill": 0.22, "shear": 0.33},
    }
    assert said.numbers == {**own, "cards": {"soft": own}}
    assert said.lines == [
        "    22.0 kPa   apex   10.000 mm",
        "   300.0 kPa   apex   30.000 mm",
    ]
    table = pd.read_csv(tmp_path / "displacement.csv")
    assert list(table.columns) == [
        "pressure_kPa", "node", "x_mm", "y_mm", "dx_mm", "dy_mm", "dz_mm"
    ]  # fmt: skip
    count = len(ROUND)
    assert table["pressure_kPa"].tolist() == pytest.approx([22.0] * count + [300.0] * count)
    assert table["node"].tolist() == [*range(count)] * 2
    points = np.tile(MODEL.mesh.points[:, :2], (2, 1))
    assert table[["x_mm", "y_mm"]].to_numpy() == pytest.approx(points, abs=1e-6)
    moved = history().displacement.reshape(-1, 3)
    assert table[["dx_mm", "dy_mm", "dz_mm"]].to_numpy() == pytest.approx(moved, abs=1e-6)
    ((path, name, pressures, points, shown),) = drawn
    assert name == "soft"
    assert path == tmp_path / "profiles.png" and tuple(pressures) == MODEL.pressures
    np.testing.assert_array_equal(points, MODEL.mesh.points)
    np.testing.assert_array_equal(shown, history().displacement)
    assert (tmp_path / "bubble.pvd").exists()


def test_several_cards_one_of_which_fails(tmp_path: Path, drawn: list[Any]) -> None:
    sheet = "any but a flat one"
    said = simulated(
        tmp_path, sheet, broken=SolverFailure("no equilibrium", "membrane"), soft=history()
    )
    assert list(said.numbers) == ["cards"]
    assert said.numbers["cards"]["broken"] == {"failed": "no equilibrium"}
    assert said.lines == [
        "broken: failed: no equilibrium",
        "soft:",
        "    22.0 kPa   apex   10.000 mm",
        "   300.0 kPa   apex   30.000 mm",
        "note: simulated from a flat and taut sheet with a fixed rim, whatever [bubble.sheet] says",
    ]
    assert {path.name for path in tmp_path.iterdir()} == {
        "displacement-2.csv",
        "bubble-2.pvd",
        "bubble-2-vtu",
    }
    assert drawn[0][0] == tmp_path / "profiles-2.png"


def test_what_a_study_looks_at() -> None:
    assert forward.quantities(MODEL, history()) == {
        "apex at 22 kPa, mm": pytest.approx(10.0),
        "apex at 300 kPa, mm": pytest.approx(30.0),
        "largest in-plane displacement at 300 kPa, mm": pytest.approx(1.0),
    }
    assert forward.responses(MODEL, history()) == {
        "22 kPa": pytest.approx(10.0), "300 kPa": pytest.approx(np.hypot(30.0, 1.0))
    }  # fmt: skip
