"""Figures of bent cylinders: a line is the prediction, its band goes to the other end."""

from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.data_files import Output
from bubblefit.reports.bending_charts import bending_charts
from bubblefit.reports.kinds.cylinder import figures

from ....builders.bending_results import LOAD, WAY
from ....support.charts import caught


# Figures
def test_file_names_differ_whatever_the_names_of_tests():
    found = figures.file_names(["150 mm, 90 kPa", "150 mm; 90 kPa", "150 MM 90 kpa", "???", "-x."])
    assert list(found.values()) == [
        "150-mm-90-kPa", "150-mm-90-kPa-2", "150-MM-90-kpa-3", "4", "x"
    ]  # fmt: skip


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Any]]:
    calls: dict[str, list[Any]] = {"draw_beam": [], "write_beam": []}
    for name, found in calls.items():
        monkeypatch.setattr(figures, name, lambda *what, own=found: own.append(what))
    return {**calls, "saved": caught(monkeypatch, figures, "bending_charts", "gas_charts")}


def test_line_is_prediction_and_band_reaches_the_other_end(banded, tmp_path, drawn, monkeypatch):
    shown = dict(figures.draw_figures(banded, Output(tmp_path)))
    soft, hard = drawn["saved"][0][1][0].lines
    np.testing.assert_array_equal([soft.deflection, soft.load], [WAY, LOAD])
    assert hard.other_limit is None
    np.testing.assert_array_equal(soft.other_limit, [WAY, 1.5 * LOAD])
    assert "figures/150-90-load.png" not in shown  # a chart on the page
    ((*_, path, title),) = drawn["draw_beam"]
    assert (path.name, title) == ("150-90-beam.png", "150/90, soft, 80 mm")
    names = [name for name, _ in figures.write_beams(banded, Output(tmp_path))]
    beams = ("soft", "soft-rigid-wall", "hard")
    assert names == [f"beams/150-90-{name}.vtu" for name in beams]
    monkeypatch.setattr(figures, "bending_charts", bending_charts)
    (charts,) = figures.load_charts(banded)
    assert charts.caption == "Load over deflection; line: slack, dashed: rigid wall"
    (chart,) = charts.charts
    curves = {s.name: s for s in chart.series if s.look == "line"}
    assert list(curves) == ["mean", "soft", "soft, other end", "hard"]
    assert curves["soft, other end"].y == pytest.approx(1.5 * LOAD)
    assert curves["soft, other end"].dashes == 1 and curves["soft"].y == pytest.approx(LOAD)
