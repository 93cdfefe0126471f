"""Charts of bent cylinders: loads, bands of solver and card, pressure of the gas."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.readers.bending import BendingCurve, BendingScatter
from bubblefit.reports.bending_charts import (
    BeamBodies,
    BendLine,
    BendPanel,
    beam_charts,
    bending_charts,
    gas_charts,
)
from bubblefit.reports.charts import axis_ends, scale_ends

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


BODIES = BeamBodies(((-500.0, -150.0), (500.0, -150.0)), 50.0, 10.0, 100.0, 80.0)


#: Four quads in a row on the seen side, two behind: (n, 3) mm.
Z = np.linspace(-600.0, 600.0, 5)


POINTS = np.array([[x, y, z] for x in (80.0, -80.0) for y in (-75.0, 75.0) for z in Z])


QUADS = np.array([[i, i + 1, i + 6, i + 5] for i in (0, 1, 2, 3, 10, 11)])


STRAIN = np.array([0.01, 0.02, 0.03, -0.4, 0.9, 0.9])


OUTLINE = np.array([[-600.0, -75.0], [600.0, -75.0], [600.0, 75.0], [-600.0, -75.0]])


RING = (np.array([[-75.0, 0.0], [0.0, 75.0]]), np.array([[-70.0, -5.0], [0.0, 60.0]]))


def test_side_view_is_the_half_that_is_seen():
    charts = beam_charts(POINTS, QUADS, STRAIN, OUTLINE, RING, BODIES, "150 mm, 140 kPa")
    check_charts(charts)
    whole, close, cut = charts.charts
    for chart, title in ((whole, "150 mm, 140 kPa"), (close, "at the collar")):
        body = chart.series[0]
        assert len(body.values) == 4 and np.abs(np.array(body.x, float)).max() <= 600.0
        assert max(body.values) == pytest.approx(3.0)
        assert chart.equal and chart.scale == "log strain along the axis, %"
        np.testing.assert_array_equal(lines(chart, "inflated")[0].T, OUTLINE)
        assert shown(chart) == ("z, mm", "y, mm", title)
    tall = 100.0 + 4 * 12.0
    for chart, ends in (
        (whole, ((-618.0, 618.0), (-220.0, 142.0))),
        (close, ((-176.0, 176.0), (10.0 - tall, 10.0 + tall))),
    ):
        np.testing.assert_allclose(axis_ends(chart), ends)
    for ring, z in zip(lines(whole, "support"), (-500.0, 500.0), strict=True):
        assert np.hypot(ring[0] - z, ring[1] + 150.0) == pytest.approx(50.0, rel=1e-4)
    walls = [(w[0].min(), w[0].max(), w[1].min(), w[1].max()) for w in lines(whole, "collar")]
    assert walls == [(-40.0, 40.0, -102.0, -90.0), (-40.0, 40.0, 110.0, 122.0)]
    for ring, name in zip(RING, ("inflated", "bent"), strict=True):
        np.testing.assert_array_equal(lines(cut, name)[0].T, ring)
    (ring,) = lines(cut, "collar")
    assert np.hypot(ring[0], ring[1] - 10.0) == pytest.approx(106.0, rel=1e-4)
    # Wrinkles have one colour.
    for last, ends in ((-0.4, (-3.0, 3.0)), (0.0, (0.0, 3.0))):
        strain = np.array([0.01, 0.02, 0.03, last, 0.0, 0.0])
        charts = beam_charts(POINTS, QUADS, strain, OUTLINE, RING, BODIES)
        assert scale_ends(charts.charts[0]) == pytest.approx(ends)
    charts = beam_charts(POINTS, QUADS, 0 * strain, OUTLINE, RING, BODIES)
    assert scale_ends(charts.charts[0]) == pytest.approx((0.0, 1.0))


def test_close_view_is_at_the_last_of_two_rollers():
    bodies = replace(BODIES, collars=(-250.0, 250.0))
    _, close, _ = beam_charts(POINTS, QUADS, STRAIN, OUTLINE, RING, bodies).charts
    assert axis_ends(close)[0] == pytest.approx((250.0 - 176.0, 250.0 + 176.0))
