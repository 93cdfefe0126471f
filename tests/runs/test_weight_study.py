"""Studies of weights: moduli and errors in closed form, and going on."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.project.project import read_project
from bubblefit.runs import weight_study as study_of
from bubblefit.runs.result import Fit
from bubblefit.runs.weight_study import COUNTS, weights

from ..builders.closed_forms import best_warp, relative_error
from ..builders.projects import constant_strips
from ..support.charts import charts_of
from ..support.commands import in_process
from ..support.refusals import raised


@pytest.fixture(autouse=True)
def without_pages(monkeypatch):
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


def test_moduli_and_errors_follow_the_weight(tmp_path):
    constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5"))
    command = ("validate", "project.toml", "--weights", "two", "--starts", "1", "--quiet")
    done = in_process(*command, "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "weights.csv")
    assert table["weight_times"].to_list() == pytest.approx(COUNTS)
    (column,) = {name for name in table if name.startswith("E1_MPa at 0.0")} - {"E1_MPa at 0"}
    middle = float(column.removeprefix("E1_MPa at "))
    middle = min(
        strain
        for strain in (float(name[10:]) for name in table if name.startswith("E1_MPa at "))
        if strain > 0
    )
    assert f"E1_MPa at {100 * middle:.3g} %" in done.output
    expected = [best_warp(1, 0.5 * count) for count in COUNTS]
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
    name = f"at {100 * float(column[10:]):.3g} %"
    (warp,) = (s for s in charts["moduli"][0].series if s.name == name)
    assert warp.y == pytest.approx(table[column], rel=1e-5)


def test_interrupted_study_of_weights_is_resumed(project, tmp_path, monkeypatch):
    whole, asked = study_of.refit, []

    def counting(found, names, count, y):
        asked.append(count)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return whole(found, names, count, y)

    monkeypatch.setattr(study_of, "refit", counting)
    given = {"starts": 1, "counts": (0.5, 1, 2, 4), "out": tmp_path / "out"}
    raised(KeyboardInterrupt, "", weights, project, "two", **given)
    study = weights(project, "two", **given, resume=True)
    assert asked == [2, 4, 4, 0.5]
    assert [run.count for run in study.runs] == [0.5, 1, 2, 4]
    assert all(run.analyses < 20 for run in study.runs)  # from the optimum beside it
    with pytest.raises(InputError, match=r"run\.json: parts: .*another counted"):
        weights(project, "one", **given, resume=True)


def test_weight_of_a_test_that_is_only_predicted_cannot_be_studied(tmp_path):
    zero = constant_strips(tmp_path, ("weight = 3.0", "weight = 0"))
    for counted in ("one", "two"):
        with pytest.raises(InputError, match="--weights"):
            weights(read_project(zero), counted, starts=1)
