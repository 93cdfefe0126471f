"""Drawings of a bent beam: the half that is seen, with its strains."""

import numpy as np
import pytest
from bubblefit.reports.beam_charts import BeamBodies, beam_charts
from bubblefit.reports.charts import axis_ends, scale_ends

from ..support.charts import check_charts, lines, shown

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
