"""Charts of bent cylinders: curves, what was measured, the gas, the beam in mm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.reports.charts import Charts, axis_ends, scale_ends
from bubblefit.reports.cylinders import (
    BeamBodies,
    BendLine,
    BendPanel,
    BendReadings,
    beam_charts,
    bending_charts,
    gas_charts,
)

from ..drawings import data, legend, lines, named, shown
from ..figure_checks import check_charts

WAY = np.linspace(0.0, 40.0, 9)
GRID = np.linspace(0.0, 30.0, 7)
SOFT = BendLine(
    "soft", 0, WAY, 3 * WAY, 0.14 + 1e-5 * WAY, 5e7 - 1e4 * WAY, knee=(20.0, 60.0), rms=3.106
)
STIFF = BendLine("stiff", 1, WAY, 5 * WAY, 0.14 + 2e-5 * WAY, 5e7 - 2e4 * WAY, limit=(40.0, 200.0))
MEASURED = BendReadings(
    [(WAY[:5], 3.9 * WAY[:5]), (WAY[:6], 4.1 * WAY[:6])], GRID, 4 * GRID, 0.1 * GRID
)
CASE = BendPanel("one", [SOFT, STIFF], MEASURED)


def test_loads_and_what_the_cards_miss() -> None:
    charts = bending_charts([CASE], misses=True, columns=1)
    check_charts(charts)
    top, low = charts.charts
    np.testing.assert_array_equal(lines(top, "soft")[0], [WAY, 3 * WAY])
    np.testing.assert_array_equal(lines(top, "stiff")[0], [WAY, 5 * WAY])
    assert lines(top, "knee")[0].ravel().tolist() == [20.0, 60.0]
    assert lines(top, "limit point")[0].ravel().tolist() == [40.0, 200.0]
    for drawn, reading in zip(lines(top, "measured"), MEASURED.readings, strict=True):
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


def test_bands_of_the_solver_and_of_the_card() -> None:
    """The other end stops before; the axes hold both."""
    way, off = WAY[:7], 0.5 * WAY
    own = replace(SOFT, other=(way, 9 * way), off=off)
    charts = bending_charts([BendPanel("one", [own, STIFF], spread="95 % by the card")])
    check_charts(charts)
    (chart,) = charts.charts
    np.testing.assert_array_equal(lines(chart, "soft, other end")[0], [way, 9 * way])
    first = named(chart)["soft"]
    np.testing.assert_allclose([first.lower, first.upper], [2.5 * WAY, 3.5 * WAY])
    assert named(chart)["soft, other end"].colour == first.colour
    assert "95 % by the card" in named(chart) and axis_ends(chart)[1][1] > 270.0


def test_all_cases_with_the_same_loads_in_a_row() -> None:
    panels = [BendPanel("one", [SOFT]), BendPanel("two", [STIFF]), BendPanel("lost"), BendPanel("")]
    charts = bending_charts(panels, columns=2)
    check_charts(charts)
    one, two, lost, free = charts.charts
    assert axis_ends(one) == axis_ends(two)
    assert axis_ends(one)[1] == pytest.approx((0.0, 1.06 * 200.0))
    assert axis_ends(one)[0] == pytest.approx((0.0, 1.06 * 40.0))
    assert lost.title == "lost" and not lost.series and not (free.title or free.series)
    # The page leaves out what has no curve.
    assert [c.title for c in bending_charts(panels).charts] == ["one: RMS error 3.11 N", "two"]
    with pytest.raises(ValueError, match="no cases to draw"):
        bending_charts([BendPanel("none")])


def test_readings_beyond_the_cards_are_seen() -> None:
    """Load and deflection go as far as what was measured where that is more."""
    short = BendLine("short", 0, WAY[:3], WAY[:3])
    long = BendReadings([(WAY[:7], 4.1 * WAY[:7])], GRID, 4 * GRID, 0.1 * GRID)
    charts = bending_charts([BendPanel("one", [short], long)], misses=True)
    check_charts(charts)
    # Where the card does not go nothing is known of it.
    off = lines(charts.charts[1], "short")[0][1]
    assert off == pytest.approx(np.where(GRID <= 10.0, -3 * GRID, np.nan), nan_ok=True)


def test_gas_in_kilopascal_and_litres() -> None:
    charts = gas_charts(CASE)
    check_charts(charts)
    left, right = charts.charts
    np.testing.assert_allclose(data(left)[0], [-0.01 * WAY, 140.0 + 0.01 * WAY], atol=1e-9)
    np.testing.assert_allclose(data(right)[0], [WAY, 140.0 + 0.01 * WAY])
    assert legend(charts) == ["soft, from 50 litres", "stiff, from 50 litres"]
    assert "litres" in left.x_label and "kPa" in left.y_label


#: mm of the collar's wall; how far the close view goes, in the collar's lengths.
WALL, CLOSE = 12.0, 2.2
BODIES = BeamBodies(((-500.0, -150.0), (500.0, -150.0)), 50.0, 10.0, 100.0, 80.0)
#: Four quads in a row on the seen side, two behind: (n, 3) mm.
Z = np.linspace(-600.0, 600.0, 5)
POINTS = np.array([[x, y, z] for x in (80.0, -80.0) for y in (-75.0, 75.0) for z in Z])
QUADS = np.array([[i, i + 1, i + 6, i + 5] for i in (0, 1, 2, 3, 10, 11)])
STRAIN = np.array([0.01, 0.02, 0.03, -0.4, 0.9, 0.9])
OUTLINE = np.array([[-600.0, -75.0], [600.0, -75.0], [600.0, 75.0], [-600.0, -75.0]])
RING = (np.array([[-75.0, 0.0], [0.0, 75.0]]), np.array([[-70.0, -5.0], [0.0, 60.0]]))


def beam(strain: np.ndarray = STRAIN) -> Charts:
    return beam_charts(POINTS, QUADS, strain, OUTLINE, RING, BODIES, "150 mm, 140 kPa")


def test_the_side_is_the_half_that_is_seen() -> None:
    charts = beam()
    check_charts(charts)
    whole, close, cut = charts.charts
    for chart in (whole, close):
        body = chart.series[0]
        assert len(body.values) == 4 and np.abs(np.array(body.x, float)).max() <= 600.0
        assert max(body.values) == pytest.approx(0.03)
        assert chart.equal and chart.scale == "log strain along the axis"
        np.testing.assert_array_equal(lines(chart, "inflated")[0].T, OUTLINE)
    assert shown(whole) == ("z, mm", "y, mm", "150 mm, 140 kPa")
    assert shown(close) == ("z, mm", "y, mm", "at the collar")
    assert axis_ends(whole)[0] == pytest.approx((-618.0, 618.0))
    # The supports' feet below, the collar's wall above, and room.
    assert axis_ends(whole)[1] == pytest.approx((-220.0, 10.0 + 100.0 + WALL + 20.0))
    tall = 100.0 + 4 * WALL
    assert axis_ends(close)[0] == pytest.approx((-CLOSE * 80.0, CLOSE * 80.0))
    assert axis_ends(close)[1] == pytest.approx((10.0 - tall, 10.0 + tall))
    supports = lines(whole, "support")
    for ring, z in zip(supports, (-500.0, 500.0), strict=True):
        radius = np.hypot(ring[0] - z, ring[1] + 150.0)
        assert radius == pytest.approx(np.full(len(radius), 50.0), rel=1e-4)
    walls = [(w[0].min(), w[0].max(), w[1].min(), w[1].max()) for w in lines(whole, "collar")]
    assert walls == [(-40.0, 40.0, -90.0 - WALL, -90.0), (-40.0, 40.0, 110.0, 110.0 + WALL)]
    for ring, name in zip(RING, ("inflated", "bent"), strict=True):
        np.testing.assert_array_equal(lines(cut, name)[0].T, ring)
    (ring,) = lines(cut, "collar")
    assert np.hypot(ring[0], ring[1] - 10.0) == pytest.approx(np.full(73, 106.0), rel=1e-4)


def test_what_is_nearer_hides_what_is_behind() -> None:
    """Quads on the half that is seen, its middle included, from the far to the near."""
    x = np.array([40.0, -40.0, 0.0, 80.0])
    side = np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])  # z, y
    points = np.array([[at, y, z + at] for at in x for z, y in side])
    quads, strain = np.arange(16).reshape(4, 4), np.array([0.1, 0.2, 0.3, 0.4])
    body = beam_charts(points, quads, strain, 0.1 * OUTLINE, RING, BODIES).charts[0].series[0]
    assert body.values == [0.3, 0.1, 0.4]
    middles = np.array(body.x, dtype=float).reshape(-1, 4).mean(axis=1)
    assert middles == pytest.approx([0.0, 40.0, 80.0])


@pytest.mark.parametrize(
    ("supports", "collar", "rises", "ends"),
    [
        (-150.0, 0.0, 0.0, (-200.0, 112.0)),  # feet, collar
        (0.0, 10.0, 0.0, (-102.0, 122.0)),  # collar
        (0.0, -10.0, 95.0, (-122.0, 170.0)),  # collar, inflated beam
        (0.0, 60.0, -80.0, (-155.0, 172.0)),  # beam, collar
    ],
)
def test_the_lowest_and_the_highest(supports, collar, rises, ends) -> None:
    """Of the beam now and before, of collar and supports, with 20 mm of room."""
    bodies = BeamBodies(((-500.0, supports), (500.0, supports)), 50.0, collar, 100.0, 80.0)
    now, before = POINTS + np.array([0.0, min(rises, 0.0), 0.0]), OUTLINE.copy()
    before[:, 1] += max(rises, 0.0)
    whole = beam_charts(now, QUADS, STRAIN, before, RING, bodies).charts[0]
    low, high = ends
    assert axis_ends(whole)[1] == pytest.approx((low - 20.0, high + 20.0))


@pytest.mark.parametrize(
    ("strain", "ends"),
    [
        ([0.01, 0.02, 0.03, -0.4, 0.0, 0.0], (-0.03, 0.03)),
        ([0.01, 0.02, 0.03, 0.0, 0.0, 0.0], (0.0, 0.03)),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (0.0, 1.0)),
    ],
)
def test_colours_of_wrinkles(strain: list[float], ends: tuple[float, float]) -> None:
    """All of them one colour."""
    assert scale_ends(beam(np.array(strain)).charts[0]) == pytest.approx(ends)
