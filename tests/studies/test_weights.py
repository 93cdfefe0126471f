"""What the weight between tests does to a fit, beside the closed form of strips."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.project.project import read_project
from bubblefit.runs import weights as study_of
from bubblefit.runs.result import Fit
from bubblefit.runs.weights import COUNTS, weight_study
from scipy.optimize import minimize_scalar

from ..commands import in_process
from ..page_charts import charts_of
from ..projects import ELONGATION, MODULI, constant_strips


@pytest.fixture(autouse=True)
def without_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page of the fit is no matter here, and takes most of the time."""
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


#: mm of elongation at which the gauges of the tests end.
ENDS = {"one": 2.9, "two": 2.5}


def relative_error(test: str, direction: str, modulus: float) -> float:
    """RMS error of a constant modulus (MPa) over the largest load, without contraction."""
    strain = np.log1p(ELONGATION[ELONGATION <= ENDS[test]] / 20)
    loads = np.array([20 * e * strain for e in MODULI[test][direction]])
    return float(np.sqrt(np.mean((20 * modulus * strain - loads) ** 2)) / loads.max())


def best_warp(weight: float) -> float:
    """E1 (MPa) that both tests together ask for: fill of "one" has half of its weight."""

    def total(modulus: float) -> float:
        own = relative_error("one", "warp", modulus) / 2
        return own + weight * relative_error("two", "warp", modulus)

    found = minimize_scalar(total, bounds=(200, 500), method="bounded", options={"xatol": 1e-6})
    return float(found.x)


def test_moduli_and_errors_follow_the_weight(tmp_path: Path) -> None:
    """E1 at every weight of "two", whose weight in the project is 3, and the error of each test."""
    constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5"))
    command = ("validate", "project.toml", "--weights", "two", "--starts", "1", "--quiet")
    done = in_process(*command, "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "weights.csv")
    assert table["weight_times"].to_list() == pytest.approx(COUNTS)
    (column,) = {name for name in table if name.startswith("E1_MPa at 0.0")} - {"E1_MPa at 0"}
    expected = [best_warp(0.5 * count) for count in COUNTS]
    # It matters: from near the mean of one to near the mean of the other.
    assert expected[-1] - expected[0] > 25
    assert table[column].to_numpy() == pytest.approx(expected, rel=2e-4)
    for test in ("one", "two"):
        errors = np.array([relative_error(test, "warp", e) for e in expected])
        if test == "one":
            errors = (errors + relative_error("one", "fill", 190.0)) / 2
        assert table[f"relative {test}"].to_numpy() == pytest.approx(errors, rel=1e-3)
    said = json.loads((tmp_path / "out" / "result.json").read_text())
    own = expected[len(COUNTS) // 2]
    change = [min(expected) / own - 1, max(expected) / own - 1]
    assert said["change"]["E1"] == pytest.approx(change, abs=1e-3)
    assert said["change"]["E2"] == pytest.approx([0, 0], abs=1e-4)
    assert f"E1 changes by {100 * change[0]:+.2g} to {100 * change[1]:+.2g} %" in done.output
    charts = charts_of(tmp_path / "out")
    for series in charts["errors"][0].series:
        assert series.x == pytest.approx(COUNTS, rel=1e-5)
        assert series.y == pytest.approx(100 * table[f"relative {series.name}"], rel=1e-5)
    (warp,) = (s for s in charts["moduli"][0].series if s.name == f"at {float(column[10:]):.3g}")
    assert warp.y == pytest.approx(table[column], rel=1e-5)
    assert (tmp_path / "out" / "weights.png").stat().st_size > 10_000


def test_a_study_of_weights_goes_on_where_it_was(tmp_path, monkeypatch) -> None:
    project = read_project(constant_strips(tmp_path))
    whole = study_of.refitted
    asked: list[float] = []

    def counting(found, names, count, y):
        asked.append(count)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return whole(found, names, count, y)

    monkeypatch.setattr(study_of, "refitted", counting)
    given = {"starts": 1, "counts": (0.5, 1, 2, 4), "out": tmp_path / "out"}
    with pytest.raises(KeyboardInterrupt):
        weight_study(project, "two", **given)
    study = weight_study(project, "two", **given, resume=True)
    assert asked == [2, 4, 4, 0.5]
    assert [run.count for run in study.runs] == [0.5, 1, 2, 4]
    assert all(run.analyses < 20 for run in study.runs)  # from the optimum beside it
    with pytest.raises(InputError, match=r"run\.json: parts: .*another counted"):
        weight_study(project, "one", **given, resume=True)


@pytest.mark.parametrize("counted", ["strips", "three"])
def test_the_weight_is_of_some_tests(tmp_path: Path, counted: str) -> None:
    project = read_project(constant_strips(tmp_path))
    with pytest.raises(InputError, match=r"--weights: .* not of all: strips, one, two; got"):
        weight_study(project, counted)
