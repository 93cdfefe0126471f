import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.base import FittedTest, Weighting
from bubblefit.experiments.bubble import KIND
from bubblefit.experiments.bubble.readings import ReadingSeries
from bubblefit.experiments.data_files import Output
from bubblefit.presenting import KINDS
from bubblefit.reports.kinds import bubble_readings
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.gauges import LAW, PRESSURES, gauge_heights
from ...experiments.bubble.test_prepared_readings import PLACES, gauged, prepared_of


@pytest.fixture(scope="module")
def fitted():
    """A bubble with three gauges, read 0.1 mm too low at the second, and the true law."""
    heights = gauge_heights(PLACES).T - [[0.0], [0.1], [0.0]]
    prepared = prepared_of(gauged(heights, elements=192, nuisance={"height_offset": 0.5}))
    comparisons = prepared.comparisons(MembraneSolver, Weighting())
    histories = tuple(c.solver.run(c.model, LAW) for c in comparisons)
    nuisance = {"height_offset_1": 0.0, "height_offset_2": -0.1, "height_offset_3": 0.0}
    reached = np.array([0.06, 0.08, 0.05])
    return prepared, FittedTest(
        comparisons, histories, nuisance, LAW, [LAW], reached, reached, None
    )


def test_findings_are_the_errors_of_each_gauge(fitted):
    findings = KINDS.of(KIND).findings(*fitted)
    series = findings.numbers["series"]
    assert list(series) == [f"height at ({x:g}, {y:g}) mm" for x, y in PLACES]
    assert all(s["rms"] < 0.1 and s["readings"] == len(PRESSURES) for s in series.values())
    assert "height_offset_2 -0.100 mm" in findings.lines[1]
    assert "modes = 1" in findings.warnings[0]


def test_table_has_a_row_for_each_reading(fitted):
    table = KINDS.of(KIND).residuals(*fitted)
    assert len(table) == 3 * len(PRESSURES) and set(table["unit"]) == {"mm"}
    assert np.abs(table["difference"]).max() < 0.15
    assert table["x_mm"].tolist()[len(PRESSURES)] == 50.0


def test_page_shows_measured_beside_modelled(fitted, tmp_path):
    prepared, of_fit = fitted
    presenter = KINDS.of(KIND)
    findings = presenter.findings(prepared, of_fit)
    exhibit = presenter.show(prepared, of_fit, findings, Output(tmp_path))
    (charts,) = exhibit.parts
    assert [chart.title for chart in charts.charts] == list(findings.numbers["series"])
    assert all(len(chart.series) == 2 for chart in charts.charts)
    assert len(pd.read_csv(tmp_path / "readings.csv")) == 3 * len(PRESSURES)
    before = presenter.examine(prepared, Output(tmp_path))
    assert len(before.tables[0].rows) == 3


def test_profiles_are_drawn_along_their_line():
    place = np.tile(np.linspace(-90.0, 90.0, 7), 2)
    series = ReadingSeries(
        "height",
        "heights along y",
        np.repeat([0.01, 0.04], 7),
        np.cos(place / 60.0),
        np.column_stack([0.0 * place, place]),
        np.zeros(14, dtype=int),
    )
    (chart,) = bubble_readings.series_charts([(series, series.value)], "lines").charts
    assert [curve.name for curve in chart.series] == [
        f"{source}, {p} kPa" for p in (10, 40) for source in ("measured", "model")
    ]
    np.testing.assert_allclose(chart.series[0].x, place[:7])
