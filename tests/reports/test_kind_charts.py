"""Charts of kinds: cuts and maps of bubbles, loads of strips and beams, the deformed bodies."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.meshes.strip_models import strip_mesh
from bubblefit.readers.bending import BendingCurve, BendingScatter
from bubblefit.reports import bubbles, strips
from bubblefit.reports.beam_charts import BeamBodies, beam_charts
from bubblefit.reports.bending_charts import BendLine, BendPanel, bending_charts, gas_charts
from bubblefit.reports.bubbles import cut_charts, height_charts, node_cut
from bubblefit.reports.charts import Charts, axis_ends, scale_ends
from bubblefit.reports.strips import StripCurves, load_charts, order_chart

from ..support.charts import check_charts, data, legend, lines, named, shown


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
def test_cuts(points):
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
        assert shown(chart) == (way[0], "height z, mm", f"Cut along the {way[1]}")
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


def still(points):
    return np.column_stack([0 * points, points[:, 0]])


@pytest.mark.parametrize(("on", "taken"), [(5, 5), (4, 81)])
def test_five_nodes_on_the_axis_are_its_profile(on, taken):
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


def test_loads_and_what_the_cards_miss():
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


def test_bands_of_the_solver_and_of_the_card():
    own = replace(SOFT, other=(WAY[:7], 9 * WAY[:7]), off=0.5 * WAY)
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


def test_the_side_is_the_half_that_is_seen():
    charts = beam_charts(POINTS, QUADS, STRAIN, OUTLINE, RING, BODIES, "150 mm, 140 kPa")
    check_charts(charts)
    whole, close, cut = charts.charts
    for chart, title in ((whole, "150 mm, 140 kPa"), (close, "at the collar")):
        body = chart.series[0]
        assert len(body.values) == 4 and np.abs(np.array(body.x, float)).max() <= 600.0
        assert max(body.values) == pytest.approx(0.03)
        assert chart.equal and chart.scale == "log strain along the axis"
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
    for last, ends in ((-0.4, (-0.03, 0.03)), (0.0, (0.0, 0.03))):
        strain = np.array([0.01, 0.02, 0.03, last, 0.0, 0.0])
        charts = beam_charts(POINTS, QUADS, strain, OUTLINE, RING, BODIES)
        assert scale_ends(charts.charts[0]) == pytest.approx(ends)
    charts = beam_charts(POINTS, QUADS, 0 * strain, OUTLINE, RING, BODIES)
    assert scale_ends(charts.charts[0]) == pytest.approx((0.0, 1.0))


U = np.linspace(0.0, 4.0, 41)


def strip(**changes):
    fields = {
        "direction": "warp", "points": ([3.0, 1.0, 5.0], [330.0, 90.0, 600.0]),
        "models": [("Table 3.2", U[1:], 110 * U[1:]), ("bubble", U[1:21], 90 * U[1:21])],
        "polynomial": (U, 100 * U), "scatter": 21.7, "rms": [3.107, 68.0],
    }  # fmt: skip
    return StripCurves(**{**fields, **changes})


def test_loads_and_what_the_models_miss():
    charts = load_charts("l", [strip(), strip(direction="bias45", rms=[50.1])])
    check_charts(charts)
    top, bias, low, _ = charts.charts
    assert charts.columns == 2
    np.testing.assert_allclose(lines(top, "Table 3.2")[0], [U, 110 * U], rtol=1e-5)
    assert lines(top, "bubble")[0][0, -1] == pytest.approx(2.0)
    np.testing.assert_allclose(lines(top, "load polynomial")[0], [U, 100 * U], rtol=1e-5)
    assert lines(top, "measured")[0][0] == pytest.approx([3.0, 1.0, 5.0])
    np.testing.assert_allclose(lines(low, "Table 3.2")[0], [U, 10 * U], rtol=1e-5, atol=1e-9)
    assert lines(low, "bubble")[0][1, -1] == pytest.approx(-20.0)
    # The measured points about their polynomial; it ends before the last of them.
    assert lines(low, "measured")[0][1] == pytest.approx([0, -10.0, 30.0, np.nan], nan_ok=True)
    scatter = named(low)["scatter of specimens (±)"]
    assert (scatter.lower, scatter.upper) == ([-21.7] * 2, [21.7] * 2) and low.level == 0.0
    assert low.title == "warp: RMS error Table 3.2 3.11 N, bubble 68 N"
    assert bias.title == "45° bias: RMS error 50.1 N, scatter 21.7 N"
    assert shown(top) == ("gauge elongation, mm", "load, N", "warp")
    assert shown(low)[:2] == ("gauge elongation, mm", "difference, N")
    names = ["load polynomial", "measured", "Table 3.2", "bubble", "scatter of specimens (±)"]
    assert legend(charts) == names
    drawn = load_charts("l", [strip(), strip(models=[("bubble", U, 95 * U)], rms=())]).charts
    assert len({named(chart)["bubble"].colour for chart in drawn}) == 1


def draw_strip(shear):
    mesh = strip_mesh(4.0, 8.0, 4, 8, 3.0)
    u = np.zeros_like(mesh.points)
    u[:, 1] = 0.5 * (mesh.points[:, 1] - 8.0)
    return strips.strip_charts(mesh.points, mesh.quads, u, shear, mesh.node_sets["gauge"])


def test_deformed_strip():
    shear = np.linspace(0.1, 0.6, 32)
    charts = draw_strip(shear)
    check_charts(charts)
    (chart,) = charts.charts
    body = chart.series[0]
    assert (min(body.y), max(body.y)) == pytest.approx((-4.0, 8.0))
    assert body.values == pytest.approx(shear, rel=1e-5)
    edges = lines(chart, "at rest")[0].T.reshape(-1, 3, 2)
    assert np.isnan(edges[:, 2]).all()
    assert np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).sum() == pytest.approx(24.0)
    for name, long in (("gauge at rest, 3.00 mm", 3.0), ("gauge, 4.50 mm", 4.5)):
        assert np.ptp(lines(chart, name)[0], axis=1) == pytest.approx([0.0, long])
    upper, lower = lines(chart, "grips")
    assert (upper[1].min(), upper[1].max()) == pytest.approx((8.0, 8.0 + 0.06 * 8.0))
    assert (lower[1].min(), lower[1].max()) == pytest.approx((-4.0 - 0.06 * 8.0, -4.0))
    assert np.ptp(upper[0]) == pytest.approx(max(body.x) - min(body.x))
    assert chart.equal and chart.scale == "shear strain γ12"
    for ends, limits in (
        ((-0.2, 0.6), (-0.6, 0.6)), ((-0.001, 0.6), (-0.001, 0.6)), ((0.0, 0.0), (0.0, 1.0))
    ):  # fmt: skip
        (chart,) = draw_strip(np.linspace(*ends, 32)).charts
        assert scale_ends(chart) == pytest.approx(limits)


def test_orders():
    orders, rmse = [1, 2, 3, 4, 5], [70.0, 60.0, 30.0, 21.0, 20.0]
    left = order_chart("warp", orders, rmse, [72.0, 64.0, 33.0, 23.0, 800.0], 4)
    right = order_chart("fill", orders, rmse, rmse, 2)
    check_charts(Charts("orders", [left, right], ""))
    assert (left.log_y, right.log_y) == (True, False)
    assert (left.title, right.title) == ("warp: order 4", "fill: order 2")
    assert shown(left)[:2] == ("order of the polynomial", "error of the load, N")
    assert lines(left, "RMSE of the fit")[0].tolist() == [orders, rmse]
    assert lines(left, "leave-one-out error")[0][1, -1] == 800.0
    assert lines(left, "chosen order")[0].tolist() == [[4, 4], [21.0, 23.0]]
    lost = [np.nan] * 5
    for left_out, first in ((lost, lost), ([*rmse[:4], np.inf], rmse)):
        check_charts(Charts("o", [order_chart("warp", orders, first, left_out, 4)], ""))
    load, strain = np.array([0.0, 5.0, 10.0]), np.array([[0.0, 0.0], [1.0, -0.2], [2.0, -0.5]])
    chart = strips.ratio_chart("5:1", load, strain, [("m", load, 2 * strain)])
    check_charts(Charts("b", [chart], ""))
    assert shown(chart) == ("larger load, kN/m", "strain, %", "ratio 5:1")
    for k, yarn in enumerate(("warp", "fill")):
        for name, factor in (("measured", 1), ("m", 2)):
            drawn = lines(chart, f"{yarn}, {name}")[0]
            np.testing.assert_array_equal(drawn, [load, factor * strain[:, k]])
