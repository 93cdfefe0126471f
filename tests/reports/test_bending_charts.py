"""Charts of bent cylinders: loads, bands of solver and card, pressure of the gas."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.readers.bending import BendingCurve, BendingScatter
from bubblefit.reports.bending_charts import BendLine, BendPanel, bending_charts, gas_charts
from bubblefit.reports.charts import axis_ends

from ..support.charts import check_charts, data, legend, lines, named, shown

WAY = np.linspace(0.0, 40.0, 9)


GRID = np.linspace(0.0, 30.0, 7)


SOFT = BendLine(
    "soft", 0, WAY, 3 * WAY, 0.14 + 1e-5 * WAY, 5e7 - 1e4 * WAY, knee=(20.0, 60.0), rms=3.106
)


STIFF = BendLine("stiff", 1, WAY, 5 * WAY, 0.14 + 2e-5 * WAY, 5e7 - 2e4 * WAY, limit=(40.0, 200.0))


READINGS = [(WAY[:5], 3.9 * WAY[:5]), (WAY[:6], 4.1 * WAY[:6])]


CURVES = [BendingCurve("a", *pair) for pair in READINGS]


MEASURED = BendingScatter(GRID, 4 * GRID, 0.1 * GRID, np.full(7, 2))


CASE = BendPanel("one", [SOFT, STIFF], CURVES, MEASURED)


def test_loads_of_cards_are_drawn_beside_readings():
    charts = bending_charts([CASE], misses=True, columns=1)
    check_charts(charts)
    top, low = charts.charts
    np.testing.assert_array_equal(lines(top, "soft")[0], [WAY, 3 * WAY])
    np.testing.assert_array_equal(lines(top, "stiff")[0], [WAY, 5 * WAY])
    assert lines(top, "knee")[0].ravel().tolist() == [20.0, 60.0]
    assert lines(top, "limit point")[0].ravel().tolist() == [40.0, 200.0]
    for drawn, reading in zip(lines(top, "measured"), READINGS, strict=True):
        np.testing.assert_allclose(drawn, reading)
    np.testing.assert_array_equal(lines(top, "mean")[0], [GRID, 4 * GRID])
    scatter = named(top)["scatter of repetitions (±)"]
    np.testing.assert_allclose([scatter.lower, scatter.upper], [3.9 * GRID, 4.1 * GRID])
    assert lines(low, "soft")[0] == pytest.approx(np.array([GRID, -GRID]))
    assert lines(low, "stiff")[0] == pytest.approx(np.array([GRID, GRID]))
    below = named(low)["scatter of repetitions (±)"]
    assert (min(below.lower), max(below.upper)) == pytest.approx((-3.0, 3.0)) and low.level == 0
    assert top.title == "one: RMS error 3.11 N" and low.title == "RMS error: soft 3.11 N"
    assert shown(top)[:2] == ("deflection of the collar, mm", "load, N")
    assert low.y_label == "model − mean, N"
    assert {"soft", "stiff", "measured", "mean", "knee", "limit point"} < set(legend(charts))


def test_bands_of_solver_and_card_are_drawn():
    own = replace(SOFT, other_limit=(WAY[:7], 9 * WAY[:7]), half_band=0.5 * WAY)
    charts = bending_charts([BendPanel("one", [own, STIFF], spread="95 % by the card")])
    check_charts(charts)
    (chart,) = charts.charts
    np.testing.assert_array_equal(lines(chart, "soft, other end")[0], [WAY[:7], 9 * WAY[:7]])
    first = named(chart)["soft"]
    np.testing.assert_allclose([first.lower, first.upper], [2.5 * WAY, 3.5 * WAY])
    assert named(chart)["soft, other end"].colour == first.colour
    assert "95 % by the card" in named(chart) and axis_ends(chart)[1][1] > 270.0
    short = BendLine("short", 0, WAY[:3], WAY[:3])
    charts = bending_charts([BendPanel("one", [short], CURVES[1:], MEASURED)], misses=True)
    check_charts(charts)
    off = lines(charts.charts[1], "short")[0][1]
    assert off == pytest.approx(np.where(GRID <= 10.0, -3 * GRID, np.nan), nan_ok=True)


def test_gas_in_kilopascal_and_litres():
    charts = gas_charts(CASE)
    check_charts(charts)
    left, right = charts.charts
    np.testing.assert_allclose(data(left)[0], [-0.01 * WAY, 140.0 + 0.01 * WAY], atol=1e-9)
    np.testing.assert_allclose(data(right)[0], [WAY, 140.0 + 0.01 * WAY])
    assert legend(charts) == ["soft, from 50 litres", "stiff, from 50 litres"]
    assert "litres" in left.x_label and "kPa" in left.y_label
