"""Charts of bubbles: cuts, heights against each other, profiles of nodes on the axis."""

import numpy as np
import pytest
from bubblefit.reports import bubbles
from bubblefit.reports.bubbles import clock_charts, cut_charts, height_charts, node_cut
from bubblefit.reports.charts import axis_ends

from ..support.charts import check_charts, data, legend, shown


def cap(xy, height):
    inside = 1 - (xy**2).sum(axis=1) / 1e4
    return np.column_stack([0.05 * xy * inside[:, None], height * inside])


def polar(angles):
    r, t = np.meshgrid(np.linspace(10, 100, 10), angles)
    ring = np.column_stack([(r * np.cos(t)).ravel(), (r * np.sin(t)).ravel()])
    return np.vstack([[0.0, 0.0], ring])


QUARTER, FULL = polar(np.linspace(0, np.pi / 2, 7)), polar(np.linspace(0, 2 * np.pi, 25)[:-1])


PRESSURES, NAMES = np.array([0.022, 0.186, 0.3]), ["22 kPa", "186 kPa", "300 kPa"]


@pytest.mark.parametrize("points", [QUARTER, FULL], ids=["quarter", "full"])
def test_cuts_pass_through_measured_points(points):
    heights = (13.0, 30.0, 39.0)
    model = np.array([cap(points, h) for h in heights])
    grid = FULL[np.hypot(*FULL.T) < 90]
    measured = [(grid, cap(grid, h + 1)) for h in heights]
    alone = cut_charts("b", PRESSURES, points, model)
    both = cut_charts("b", PRESSURES, points, model, measured, "words")
    check_charts(alone)
    for axis, (chart, other) in enumerate(zip(alone.charts, both.charts, strict=True)):
        for curve, height in zip(data(chart), heights, strict=True):
            at = curve[0] / (1 + 0.05 * (1 - curve[0] ** 2 / 1e4))
            assert curve[1] == pytest.approx(height * (1 - at**2 / 1e4), rel=0.02, abs=0.3)
            assert curve[1].max() == pytest.approx(height)
        tops = [own[1].max() for own in data(other)]
        assert tops == pytest.approx([13.0, 14.0, 30.0, 31.0, 39.0, 40.0])
        assert [s.look for s in other.series] == ["line", "dots"] * 3
        way = (("x, mm", "warp"), ("y, mm", "fill"))[axis]
        assert shown(chart) == (way[0], "rise dz, mm", f"Cut along the {way[1]}")
    assert legend(alone) == NAMES and both.caption == "words"
    # The axis begins with height zero, or below where a frame hangs lower; some are drawn.
    many = cut_charts("b", np.linspace(0.01, 0.3, 20), FULL, np.array([cap(FULL, 9.0)] * 20))
    assert len(many.charts[0].series) == bubbles.MAX_PRESSURES == 8
    assert "Of 20 pressures 8" in many.caption
    for lift, bottom in ((5.0, 0.0), (-50.0, -50.0)):
        hung = cut_charts("p", [0.022], FULL, [cap(FULL, 40.0) + np.array([0.0, 0.0, lift])])
        for chart in hung.charts:
            low = axis_ends(chart)[1][0]
            assert low == 0.0 if bottom == 0.0 else low < bottom


def test_heights_are_drawn_against_each_other():
    seen = [np.linspace(1.0, h, 12) for h in (13.0, 30.0, 39.0)]
    modelled = [z + 0.1 * k for k, z in enumerate(seen)]
    charts = height_charts(PRESSURES, seen, modelled)
    check_charts(charts)
    left, right = charts.charts
    rule, *pairs = data(left)
    for own, off, z, model in zip(pairs, data(right), seen, modelled, strict=True):
        np.testing.assert_allclose(own, [z, model], rtol=1e-5)
        np.testing.assert_allclose(off, [z, model - z], rtol=1e-5, atol=1e-9)
    np.testing.assert_array_equal(rule[0], rule[1])
    assert right.level == 0.0 and legend(charts) == NAMES
    rms = np.sqrt(np.mean([0.0, 0.01, 0.04]))
    every, spread = np.concatenate(seen), np.concatenate(modelled) - np.concatenate(seen)
    lost = (spread**2).sum() / ((every - every.mean()) ** 2).sum()
    assert shown(left) == ("measured z, mm", "modelled z, mm", f"R² = 1 − {lost:.1e}")
    assert shown(right) == ("measured z, mm", "modelled − measured, mm", f"RMS {rms:.2g} mm")
    same = height_charts(PRESSURES, seen, seen).charts
    assert [chart.title for chart in same] == ["R² = 1 − 0.0e+00", "RMS 0 mm"]
    # Of equal heights no share is explained; below the mean's error it is negative.
    first = height_charts([0.022], [[3.0, 3.0]], [[3.0, 4.0]], "known").charts
    other = height_charts([0.022], [[3.0, 5.0]], [[5.0, 3.0]], "known").charts
    assert [first[0].title, other[0].title] == ["R² = nan", "R² = -3.000"]
    assert first[1].y_label == "modelled − known, mm"
    assert [bubbles._below_one(r) for r in (0.999, 0.9991)] == ["0.999", "1 − 9.0e-04"]


def test_frames_that_are_taken_are_marked_at_their_pressures():
    """Where the log has no pressure, no frame is taken."""
    times, pressures = np.arange(5.0), np.array([np.nan, 0.01, 0.03, 0.02, np.nan])
    heights = 100.0 * times
    log, rises, pairs = clock_charts(times, pressures, heights, np.array([0.019, 0.031])).charts
    np.testing.assert_allclose(data(log)[0], [times, 1e3 * pressures])
    np.testing.assert_allclose(data(rises)[0], [times, heights])
    frames, taken = pairs.series
    np.testing.assert_allclose(data(pairs)[0], [1e3 * pressures, heights])
    assert (taken.x, taken.y) == ([20.0, 30.0], [300.0, 200.0])
    assert (frames.name, taken.name) == ("all frames", "taken")
    assert frames.colour != taken.colour and taken.hollow and not frames.hollow


def test_pressures_have_colours_from_a_tenth_of_the_scale_on():
    assert bubbles.ranks(4) == pytest.approx([0.1, 0.4, 0.7, 1.0])


def still(points):
    return np.column_stack([0 * points, points[:, 0]])


@pytest.mark.parametrize(("on", "taken"), [(5, 5), (4, 81)])
def test_nodes_on_the_axis_are_the_profile(on, taken):
    x = np.linspace(0.0, 80.0, on)
    beside = np.column_stack([np.repeat([0.0, 80.0], 2), np.tile([-10.0, 10.0], 2)])
    points = np.vstack([np.column_stack([x, 0 * x]), beside])
    position, height = node_cut(points, still(points), 0)
    assert len(position) == taken
    np.testing.assert_allclose(position, np.linspace(0.0, 80.0, taken))
    np.testing.assert_allclose(height, position)
    turned = polar(np.linspace(0, 2 * np.pi, 73)[:-1] + np.pi / 72)
    position, height = node_cut(turned, cap(turned, 30.0), 0)
    assert len(position) > 70
    assert np.interp(0.0, position, height) == pytest.approx(30.0, rel=0.01)
