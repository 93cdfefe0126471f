"""Charts of strips: loads, the deformed strip, orders of polynomials."""

import numpy as np
import pytest
from bubblefit.meshes.strip_models import strip_mesh
from bubblefit.reports import strips
from bubblefit.reports.charts import Charts, axis_ends, scale_ends
from bubblefit.reports.strips import StripCurves, load_charts, order_chart

from ..support.charts import check_charts, legend, lines, named, shown

U = np.linspace(0.0, 4.0, 41)


def strip(**changes):
    fields = {
        "direction": "warp", "points": ([3.0, 1.0, 5.0], [330.0, 90.0, 600.0]),
        "models": [("Table 3.2", U[1:], 110 * U[1:]), ("bubble", U[1:21], 90 * U[1:21])],
        "polynomial": (U, 100 * U), "scatter": 21.7, "rms": [3.107, 68.0],
    }  # fmt: skip
    return StripCurves(**{**fields, **changes})


def test_loads_of_models_are_drawn_beside_points():
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
    models = [(name, U, 100 * U) for name in ("A", "B", "C")]
    _, low = load_charts("l", [strip(models=models, rms=[None, 15.0, 585.0])]).charts
    assert low.title == "warp: RMS error B 15 N, C 585 N"
    top_of_two, _ = load_charts("l", [strip(models=models[:2], rms=[None, 15.0])]).charts
    assert top_of_two.title == "warp"
    assert shown(top) == ("gauge elongation, mm", "load, N", "warp")
    assert shown(low)[:2] == ("gauge elongation, mm", "difference, N")
    names = ["load polynomial", "measured", "Table 3.2", "bubble", "scatter of specimens (±)"]
    assert legend(charts) == names
    drawn = load_charts("l", [strip(), strip(models=[("bubble", U, 95 * U)], rms=())]).charts
    assert len({named(chart)["bubble"].colour for chart in drawn}) == 1


def test_axis_of_measured_loads_begins_at_zero_however_high_they_are():
    points = ([3.0, 4.0, 5.0], [500.0, 550.0, 600.0])
    (chart,) = load_charts("l", [strip(points=points, models=[], polynomial=None, rms=())]).charts
    assert axis_ends(chart)[1][0] == 0.0


def draw_strip(shear):
    mesh = strip_mesh(4.0, 8.0, 4, 8, 3.0)
    u = np.zeros_like(mesh.points)
    u[:, 1] = 0.5 * (mesh.points[:, 1] - 8.0)
    return strips.strip_charts(mesh.points, mesh.quads, u, shear, mesh.node_sets["gauge"])


def test_deformed_strip_is_drawn_with_its_strains():
    shear = np.linspace(0.1, 0.6, 32)
    charts = draw_strip(shear)
    check_charts(charts)
    (chart,) = charts.charts
    body = chart.series[0]
    assert (min(body.y), max(body.y)) == pytest.approx((-4.0, 8.0))
    assert body.values == pytest.approx(100 * shear, rel=1e-5)
    edges = lines(chart, "at rest")[0].T.reshape(-1, 3, 2)
    assert np.isnan(edges[:, 2]).all()
    assert np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).sum() == pytest.approx(24.0)
    for name, long in (("gauge at rest, 3.00 mm", 3.0), ("gauge, 4.50 mm", 4.5)):
        assert np.ptp(lines(chart, name)[0], axis=1) == pytest.approx([0.0, long])
    upper, lower = lines(chart, "grips")
    assert (upper[1].min(), upper[1].max()) == pytest.approx((8.0, 8.0 + 0.06 * 8.0))
    assert (lower[1].min(), lower[1].max()) == pytest.approx((-4.0 - 0.06 * 8.0, -4.0))
    assert np.ptp(upper[0]) == pytest.approx(max(body.x) - min(body.x))
    assert chart.equal and chart.scale == "shear strain γ12, %"
    for ends, limits in (
        ((-0.2, 0.6), (-60, 60)), ((-0.001, 0.6), (-0.1, 60)), ((0.0, 0.0), (0.0, 1.0))
    ):  # fmt: skip
        (chart,) = draw_strip(np.linspace(*ends, 32)).charts
        assert scale_ends(chart) == pytest.approx(limits)


def test_orders_of_polynomials_are_drawn_with_their_errors():
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
