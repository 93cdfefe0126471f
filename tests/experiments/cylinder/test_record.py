"""What is kept of a run of a cylinder, and which results are none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.cylinder.predicted import arrays_of, early_end
from bubblefit.solvers.base import History

MODEL = SimpleNamespace(deflections=(10.0, 20.0))


def history(frames: int = 3, **other: Any) -> History:
    given = {
        "cavity_pressure": np.array([0.1, 0.101, 0.102])[:frames],
        "cavity_volume": 5e7 - np.arange(frames),
    } | other
    moved = np.arange(frames * 6.0).reshape(frames, 2, 3)
    return History(np.arange(frames) * 50.0, moved, np.zeros(3), np.zeros(3), **given)


def test_what_is_kept() -> None:
    kept = arrays_of(MODEL, history(wrinkled=[0.0, 0.1, 0.3]))
    assert {name: value.tolist() for name, value in kept.items()} == {
        "deflection": [0.0, 10.0, 20.0],
        "load": [0.0, 50.0, 100.0],
        "pressure": [0.1, 0.101, 0.102],
        "volume": [5e7, 5e7 - 1, 5e7 - 2],
        "inflated": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
        "bent": [[12.0, 13.0, 14.0], [15.0, 16.0, 17.0]],
        "wrinkled": [0.0, 0.1, 0.3],
    }
    assert arrays_of(MODEL, history())["wrinkled"].size == 0


def test_an_early_end_is_a_result_where_the_solver_says_why() -> None:
    short = history(2, early="no equilibrium")
    assert arrays_of(MODEL, short)["deflection"].tolist() == [0.0, 10.0]
    assert early_end(MODEL, short) == "no equilibrium"
    assert early_end(MODEL, history(3, early="said after the end")) == ""
    with pytest.raises(SolverFailure, match="the results end at 10 of 20 mm, and do not say why"):
        arrays_of(MODEL, history(2))


@pytest.mark.parametrize("name", ["cavity_pressure", "cavity_volume"])
def test_results_without_gas(name: str) -> None:
    with pytest.raises(SolverFailure, match="no gas pressure or no volume"):
        arrays_of(MODEL, history(**{name: None}))
