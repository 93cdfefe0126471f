"""Charts of bubbles: cuts, heights, maps over the sheet, a log beside heights."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.bubbles import (
    MOST,
    POINTS,
    _below_one,
    clock_charts,
    cut_charts,
    disk_charts,
    height_charts,
    node_cut,
    point_cut,
    registration_charts,
    rise_charts,
    sphere_charts,
)
from bubblefit.reports.charts import axis_ends, scale_ends

from ..drawings import data, legend, lines, named, shown
from ..figure_checks import check_charts


def cap(xy: np.ndarray, height: float) -> np.ndarray:
    """Displacement (n, 3) of a parabolic cap of radius 100 mm."""
    inside = 1 - (xy**2).sum(axis=1) / 1e4
    return np.column_stack([0.05 * xy * inside[:, None], height * inside])


def polar(angles: np.ndarray) -> np.ndarray:
    r, t = np.meshgrid(np.linspace(10, 100, 10), angles)
    ring = np.column_stack([(r * np.cos(t)).ravel(), (r * np.sin(t)).ravel()])
    return np.vstack([[0.0, 0.0], ring])


QUARTER, FULL = polar(np.linspace(0, np.pi / 2, 7)), polar(np.linspace(0, 2 * np.pi, 25)[:-1])
PRESSURES = np.array([0.022, 0.186, 0.3])
TURN = np.linspace(0.0, 2 * np.pi, 37)
EDGE = 100.0 * np.column_stack([np.cos(TURN), np.sin(TURN)])


@pytest.mark.parametrize("points", [QUARTER, FULL], ids=["quarter", "full"])
def test_cuts(points: np.ndarray) -> None:
    heights = (13.0, 30.0, 39.0)
    model = np.array([cap(points, h) for h in heights])
    grid = FULL[np.hypot(*FULL.T) < 90]
    measured = [(grid, cap(grid, h + 1)) for h in heights]
    alone = cut_charts("b", PRESSURES, points, model)
    both = cut_charts("b", PRESSURES, points, model, measured, "words")
    check_charts(alone)
    for axis, chart in enumerate(alone.charts):
        for curve, height in zip(data(chart), heights, strict=True):
            at = curve[0] / (1 + 0.05 * (1 - curve[0] ** 2 / 1e4))
            assert curve[1] == pytest.approx(height * (1 - at**2 / 1e4), rel=0.02, abs=0.3)
            assert curve[1].max() == pytest.approx(height)
        pairs = data(both.charts[axis])
        for best, spots, height in zip(pairs[::2], pairs[1::2], heights, strict=True):
            assert (best[1].max(), spots[1].max()) == pytest.approx((height, height + 1))
        assert shown(chart) == (
            ("x, mm", "y, mm")[axis], "height z, mm", f"Cut along the {('warp', 'fill')[axis]}"
        )  # fmt: skip
        assert [s.look for s in both.charts[axis].series] == ["line", "dots"] * 3
    assert legend(alone) == ["22 kPa", "186 kPa", "300 kPa"] and both.caption == "words"


def test_of_many_pressures_some_are_drawn() -> None:
    many = cut_charts("b", np.linspace(0.01, 0.3, 20), FULL, np.array([cap(FULL, 9.0)] * 20))
    assert len(many.charts[0].series) == MOST and "Of 20 pressures 8 are drawn" in many.caption


@pytest.mark.parametrize(("lift", "bottom"), [(5.0, 0.0), (-50.0, -52.0)])
def test_cuts_stand_on_the_sheet(lift: float, bottom: float) -> None:
    """The axis begins with height zero, or below where a frame hangs lower."""
    hung = cut_charts("p", [0.022], FULL, [cap(FULL, 40.0) + np.array([0.0, 0.0, lift])])
    for chart in hung.charts:
        low = axis_ends(chart)[1][0]
        assert low == 0.0 if bottom == 0.0 else low < -50.0


def test_heights_are_drawn_against_each_other() -> None:
    seen = [np.linspace(1.0, h, 12) for h in (13.0, 30.0, 39.0)]
    modelled = [z + 0.1 * k for k, z in enumerate(seen)]
    charts = height_charts(PRESSURES, seen, modelled)
    check_charts(charts)
    left, right = charts.charts
    for own, off, z, model in zip(data(left)[1:], data(right), seen, modelled, strict=True):
        np.testing.assert_allclose(own, [z, model], rtol=1e-5)
        np.testing.assert_allclose(off, [z, model - z], rtol=1e-5, atol=1e-9)
    rule = data(left)[0]
    np.testing.assert_array_equal(rule[0], rule[1])
    assert right.level == 0.0
    rms = np.sqrt(np.mean([0.0, 0.01, 0.04]))
    every, spread = np.concatenate(seen), np.concatenate(modelled) - np.concatenate(seen)
    said = 1 - (spread**2).sum() / ((every - every.mean()) ** 2).sum()
    assert shown(left) == ("measured z, mm", "modelled z, mm", f"R² = 1 − {1 - said:.1e}")
    assert shown(right) == ("measured z, mm", "modelled − measured, mm", f"RMS {rms:.2g} mm")
    assert legend(charts) == ["22 kPa", "186 kPa", "300 kPa"]
    same = height_charts(PRESSURES, seen, seen).charts
    assert [chart.title for chart in same] == ["R² = 1 − 0.0e+00", "RMS 0 mm"]


def test_fit_that_explains_nothing() -> None:
    """Of equal heights no share is explained; below the mean's error it is negative."""
    first = height_charts([0.022], [[3.0, 3.0]], [[3.0, 4.0]], "known").charts
    other = height_charts([0.022], [[3.0, 5.0]], [[5.0, 3.0]], "known").charts
    assert [first[0].title, other[0].title] == ["R² = nan", "R² = -3.000"]
    assert first[1].y_label == "modelled − known, mm"
    assert [_below_one(r) for r in (0.999, 0.9991)] == ["0.999", "1 − 9.0e-04"]


def sheet(count: int) -> np.ndarray:
    """(count, 2) mm, evenly over the disk."""
    place = np.arange(count) + 0.5
    r, t = 99.0 * np.sqrt(place / count), 2.4 * place
    return np.column_stack([r * np.cos(t), r * np.sin(t)])


@pytest.mark.parametrize(("count", "step"), [(500, 1), (POINTS, 1), (POINTS + 1, 2)])
def test_registration(count: int, step: int) -> None:
    points = sheet(count)
    maps = [("height, mm", points[:, 0]), ("rise at 20 kPa, mm", points[:, 1])]
    charts = registration_charts(points, maps, EDGE)
    for chart, (title, values) in zip(charts.charts, maps, strict=True):
        spots = chart.series[0]
        np.testing.assert_allclose(np.transpose([spots.x, spots.y]), points[::step], rtol=1e-5)
        np.testing.assert_allclose(spots.values, values[::step], rtol=1e-5)
        np.testing.assert_allclose(lines(chart, "rim")[0].T, EDGE, rtol=1e-5, atol=1e-9)
        assert chart.equal and f"{chart.title}, {chart.scale}" == title
        assert shown(chart)[:2] == ("x, mm", "y, mm")
        # From the centre half way to the rim.
        assert lines(chart, "warp")[0].tolist() == [[0, 50], [0, 0]]
        assert lines(chart, "fill")[0].tolist() == [[0, 0], [0, 50]]


def test_disk() -> None:
    places = np.vstack([sheet(400), EDGE[:-1]])
    low = 0.02 * places[:, 0] - 0.5  # mm, from -2.5 to 1.5
    charts = disk_charts([("height, mm", places, low), ("none, mm", places, 0 * low)], EDGE)
    check_charts(charts)
    for chart, most in zip(charts.charts, (2.5, 1e-9), strict=True):
        assert scale_ends(chart) == pytest.approx((-most, most)) and chart.equal
        body = chart.series[0]
        x = np.array(body.x, dtype=float).reshape(-1, 3).mean(axis=1)
        wanted = 0.02 * x - 0.5 if most > 1 else 0 * x
        np.testing.assert_allclose(body.values, wanted, atol=1e-4)
        assert shown(chart)[:2] == ("x (warp), mm", "y (fill), mm") and chart.scale == "mm"
    assert [chart.title for chart in charts.charts] == ["height", "none"]


@pytest.mark.parametrize(("count", "step"), [(POINTS, 1), (4 * POINTS, 3)])
def test_the_first_spheres_in_one_scale(count: int, step: int) -> None:
    points, used = np.column_stack([sheet(count), np.zeros(count)]), np.arange(count) % 4 > 0
    off = np.where(used, points[:, 0] / 1e3, 7.0)
    drawn = [(f"{i}", points, (i + 1) * off, used) for i in range(7)]
    charts = sphere_charts(drawn).charts
    assert [chart.title for chart in charts] == [str(i) for i in range(6)]
    largest = 6 * np.abs(off[used]).max()
    for i, chart in enumerate(charts):
        inside = chart.series[0]
        np.testing.assert_allclose(inside.x, points[used, 0][::step], rtol=1e-5)
        np.testing.assert_allclose(inside.values, (i + 1) * off[used][::step], rtol=1e-5)
        assert scale_ends(chart) == pytest.approx((-largest, largest))


def test_points_astray_do_not_make_the_ball_small() -> None:
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = np.column_stack([20 + 10 * np.cos(turn), 10 * np.sin(turn), 0 * turn])
    points[4] = [600.0, 0.0, 0.0]
    used, off = np.arange(40) != 4, np.linspace(-0.2, 0.1, 40)
    (chart,) = sphere_charts([("a: 10 mm", points, np.where(used, off, 580.0), used)]).charts
    assert axis_ends(chart)[0] == pytest.approx((9.0, 31.0), abs=0.1)
    assert shown(chart) == ("x, mm", "y, mm", "a: 10 mm") and chart.equal
    assert scale_ends(chart) == pytest.approx((-0.2, 0.2))
    assert chart.series[0].values == pytest.approx(off[used], rel=1e-5)
    assert lines(chart, "left out")[0].tolist() == [[600.0], [0.0]]
    assert chart.scale == "beyond the sphere, mm"


@pytest.mark.parametrize("least", [0.5, -3.0])
def test_rises(least: float) -> None:
    charts = rise_charts([0.002, 0.02, 0.3], [least, 20.0, 39.0])
    check_charts(charts)
    (chart,) = charts.charts
    np.testing.assert_allclose(data(chart)[0], [[2.0, 20.0, 300.0], [least, 20.0, 39.0]])
    low = axis_ends(chart)[1][0]
    assert low == 0.0 if least > 0 else low < -3.0
    assert shown(chart)[:2] == ("pressure, kPa", "rise about the centre, mm")


def test_pressures_and_heights_by_one_clock() -> None:
    times = np.arange(5.0)
    pressures, heights = np.array([0.0, 0.01, 0.02, 0.03, np.nan]), np.arange(5.0) ** 2
    charts = clock_charts(times, pressures, heights, np.array([0.02]))
    check_charts(charts)
    log, height, both = charts.charts
    np.testing.assert_array_equal(data(log)[0], [times, 1e3 * pressures])
    np.testing.assert_array_equal(data(height)[0], [times, heights])
    np.testing.assert_array_equal(data(both)[0], [1e3 * pressures, heights])
    assert lines(both, "taken")[0].tolist() == [[20.0], [4.0]] and named(both)["taken"].hollow
    assert shown(log) == ("time by the log's clock, s", "pressure, kPa", "pressure of the log")
    assert shown(both)[:2] == ("pressure, kPa", "height of the apex, mm")


def test_cut_of_a_mesh_without_nodes_on_the_axis_is_interpolated():
    turned = polar(np.linspace(0, 2 * np.pi, 73)[:-1] + np.pi / 72)
    cut = node_cut(turned, cap(turned, 30.0), 0)
    middle = np.interp(0.0, cut.position, cut.height)
    assert len(cut.position) > 70 and middle == pytest.approx(30.0, rel=0.01)


#: Rows of points along x: on the axis and 2.5 mm beside it, each point 5.6 mm from the next.
ALONG = np.arange(0.0, 100.0, 10.0)
ROWS = np.vstack(
    [np.column_stack([ALONG, 0 * ALONG]), np.column_stack([ALONG + 5, 0 * ALONG + 2.5])]
)


def still(points: np.ndarray) -> np.ndarray:
    """Risen by 1 mm for every mm of x, not moved aside."""
    return np.column_stack([0 * points, points[:, 0]])


@pytest.mark.parametrize(("on", "used"), [(10, 10), (5, 5), (4, 14)])
def test_five_points_on_the_axis_are_its_profile(on: int, used: int) -> None:
    """Of fewer, those beside it count as well."""
    points = np.vstack([ROWS[:on], ROWS[10:]])
    cut = point_cut(points, still(points), 0)
    assert len(cut.position) == used
    np.testing.assert_array_equal(cut.height, cut.position)
    assert (np.diff(cut.position) > 0).all()


@pytest.mark.parametrize(
    ("points", "used"),
    [([[3.0, 2.0], [3.0, -2.0]], 2), ([[3.0, 2.0], [7.0, 2.5]], 1), ([[3.0, 2.0]], 0),
     ([[3.0, 0.0]], 1), ([[3.0, 2.0], [6.0, 2.0]], 0)],
)  # fmt: skip
def test_few_points(points: list[list[float]], used: int) -> None:
    """Half their distance from the axis at most; one alone has to lie on it."""
    given = np.array(points)
    assert len(point_cut(given, still(given), 0).position) == used


def test_no_points() -> None:
    assert len(point_cut(np.zeros((0, 2)), np.zeros((0, 3)), 1).position) == 0


@pytest.mark.parametrize(("on", "taken"), [(5, 5), (4, 81)])
def test_five_nodes_on_the_axis_are_its_profile(on: int, taken: int) -> None:
    """Of fewer, the mesh is cut at as many places from end to end."""
    x = np.linspace(0.0, 80.0, on)
    beside = np.column_stack([np.repeat([0.0, 80.0], 2), np.tile([-10.0, 10.0], 2)])
    points = np.vstack([np.column_stack([x, 0 * x]), beside])
    cut = node_cut(points, still(points), 0)
    assert len(cut.position) == taken
    np.testing.assert_allclose(cut.position, np.linspace(0.0, 80.0, taken))
    np.testing.assert_allclose(cut.height, cut.position)


@pytest.mark.parametrize("cut", [node_cut, point_cut])
def test_heights_at_rest_do_not_count(cut) -> None:
    """Points of a measured sheet have three coordinates: places are told by x and y."""
    draw = np.random.default_rng(2)
    flat = draw.uniform(-50, 50, (200, 2))
    moved = np.column_stack([0.01 * flat, 10.0 - 1e-3 * (flat**2).sum(axis=1)])
    raised = np.column_stack([flat, 600.0 + 40.0 * draw.normal(size=200)])
    for axis in (0, 1):
        one, other = cut(flat, moved, axis), cut(raised, moved, axis)
        assert len(one.position) > 3
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(one.height, other.height)
