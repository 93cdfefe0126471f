"""Charts of strips and biaxial tests: loads, differences, orders, the deformed strip."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from bubblefit.meshes.strip_models import strip_mesh
from bubblefit.reports.charts import Charts, axis_ends, scale_ends
from bubblefit.reports.strips import (
    BiaxialPanel,
    OrderErrors,
    StripCurves,
    biaxial_charts,
    load_charts,
    order_charts,
    specimen_charts,
    strip_charts,
)

from ..drawings import data, legend, lines, named, shown
from ..figure_checks import check_charts
from ..places import PUBLISHED

U = np.linspace(0.0, 4.0, 41)


def strip(**changes) -> StripCurves:
    fields = {
        "direction": "warp",
        "models": [("Table 3.2", U[1:], 110 * U[1:]), ("bubble", U[1:21], 90 * U[1:21])],
        "points": ([3.0, 1.0, 5.0], [330.0, 90.0, 600.0]),
        "polynomial": (U, 100 * U),
        "scatter": 21.7,
        "rms": [3.107, 68.0],
    }
    return StripCurves(**{**fields, **changes})


def test_loads_and_what_the_models_miss() -> None:
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
    assert legend(charts) == [
        "load polynomial", "measured", "Table 3.2", "bubble", "scatter of specimens (±)",
    ]  # fmt: skip


def test_without_a_polynomial_the_points_are_the_target() -> None:
    low = load_charts("l", [strip(polynomial=None, rms=())]).charts[1]
    (spots,) = lines(low, "Table 3.2")
    assert spots[0] == pytest.approx([0, 1, 3, 5])
    assert spots[1] == pytest.approx([0, 20.0, 0.0, np.nan], nan_ok=True)


def test_loads_of_models_alone() -> None:
    (chart,) = load_charts("l", [strip(polynomial=None, points=None, rms=())]).charts
    assert [s.name for s in chart.series] == ["Table 3.2", "bubble"]
    mixed = load_charts("l", [strip(), strip(polynomial=None, points=None)])
    assert len(mixed.charts) == 3


def test_a_model_has_one_colour_in_all_charts() -> None:
    other = strip(models=[("bubble", U, 95 * U)], rms=())
    charts = load_charts("l", [strip(), other]).charts
    assert len({named(chart)["bubble"].colour for chart in charts}) == 1


@pytest.mark.parametrize("least", [40.0, -40.0])
def test_loads_stand_on_zero_and_all_are_seen(least: float) -> None:
    """The axis begins at no load, or below where a machine recorded less."""
    pulled = strip(models=[], polynomial=None, points=([1.0, 2.0], [least, 200.0]), rms=())
    low, high = axis_ends(load_charts("l", [pulled]).charts[0])[1]
    assert (low == 0.0 if least > 0 else low < least) and high > 200.0


def test_no_strips() -> None:
    with pytest.raises(ValueError, match="no strips"):
        load_charts("l", [])


def test_measured_loads(shared_data: Path) -> None:
    """The published polynomials lie on the published points, to their scatter."""

    def rows(path: Path) -> list[dict[str, str]]:
        with path.open() as text:
            return list(csv.DictReader(line for line in text if not line.startswith("#")))

    points = rows(shared_data / "uniaxial/valmex7318_load_gauge.csv")
    for row in rows(PUBLISHED / "published_uniaxial_polynomials.csv"):
        own = [p for p in points if p["series"] == row["direction"]]
        x, y = (np.array([float(p[k]) for p in own]) for k in ("gauge_disp_mm", "load_N"))
        u = np.linspace(0.0, x.max(), 2001)  # to the last point, as they were fitted
        load = np.polyval([*(float(row[f"c{k}"]) for k in (4, 3, 2, 1)), 0.0], u)
        scatter = float(row["data_scatter_N"])
        curve = StripCurves(row["direction"], [("p", u, load)], (x, y), (u, load), scatter)
        off = lines(load_charts("l", [curve]).charts[1], "measured")[0][1]
        assert np.sqrt(np.mean(off**2)) == pytest.approx(scatter, rel=0.03)


def test_six_specimens_of_a_direction_are_named() -> None:
    x = np.array([0.0, 1.0, 2.0])
    warp = [(f"specimen {i}", x, (i + 1) * x) for i in range(8)]
    left, right = specimen_charts({"warp": warp, "fill": [("", x, 5 * x)]}).charts
    for i, curve in enumerate(data(left)):
        np.testing.assert_array_equal(curve, [x, (i + 1) * x])
    assert [s.name for s in left.series] == [*(f"specimen {i}" for i in range(6)), "", ""]
    assert len(right.series) == 1
    assert shown(left) == ("elongation of the gauge, mm", "load, N", "warp")


def draw_strip(shear: np.ndarray, grips: bool = True) -> Charts:
    mesh = strip_mesh(4.0, 8.0, 4, 8, 3.0)
    u = np.zeros_like(mesh.points)
    u[:, 1] = 0.5 * (mesh.points[:, 1] - 8.0)
    gauge = mesh.node_sets["gauge"]
    return strip_charts(mesh.points, mesh.quads, u, shear, gauge, "bias", grips)


def test_deformed_strip() -> None:
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
    before, after = lines(chart, "gauge at rest, 3.00 mm")[0], lines(chart, "gauge, 4.50 mm")[0]
    assert np.ptp(before, axis=1) == pytest.approx([0.0, 3.0])
    assert np.ptp(after, axis=1) == pytest.approx([0.0, 4.5])
    upper, lower = lines(chart, "grips")
    assert (upper[1].min(), upper[1].max()) == pytest.approx((8.0, 8.0 + 0.06 * 8.0))
    assert (lower[1].min(), lower[1].max()) == pytest.approx((-4.0 - 0.06 * 8.0, -4.0))
    assert np.ptp(upper[0]) == pytest.approx(max(body.x) - min(body.x))
    assert chart.equal and chart.scale == "shear strain γ12" and chart.title == "bias"


@pytest.mark.parametrize(
    ("ends", "limits"),
    [((-0.2, 0.6), (-0.6, 0.6)), ((-0.001, 0.6), (-0.001, 0.6)), ((0.0, 0.0), (0.0, 1.0))],
)
def test_the_scale_of_shear(ends: tuple[float, float], limits: tuple[float, float]) -> None:
    (chart,) = draw_strip(np.linspace(*ends, 32), grips=False).charts
    assert scale_ends(chart) == pytest.approx(limits)
    assert "grips" not in named(chart)


def test_shear_for_every_quad() -> None:
    with pytest.raises(ValueError, match="3 shear strains for 32 quads"):
        draw_strip(np.zeros(3))


def test_orders() -> None:
    orders, rmse = [1, 2, 3, 4, 5], [70.0, 60.0, 30.0, 21.0, 20.0]
    warp = OrderErrors("warp", orders, rmse, [72.0, 64.0, 33.0, 23.0, 800.0], 4)
    charts = order_charts([warp, OrderErrors("fill", orders, rmse, rmse, 2)])
    check_charts(charts)
    left, right = charts.charts
    assert (left.log_y, right.log_y) == (True, False)
    assert (left.title, right.title) == ("warp: order 4", "fill: order 2")
    assert shown(left)[:2] == ("order of the polynomial", "error of the load, N")
    assert lines(left, "RMSE of the fit")[0].tolist() == [orders, rmse]
    assert lines(left, "leave-one-out error")[0][1, -1] == 800.0
    assert lines(left, "chosen order")[0].tolist() == [[4, 4], [21.0, 23.0]]
    # Leaving out the one point that an order hangs on has no finite error.
    lost = [np.nan] * 5
    for left_out, first in ((lost, lost), ([*rmse[:4], np.inf], rmse)):
        check_charts(order_charts([OrderErrors("warp", orders, first, left_out, 4)]))
    with pytest.raises(ValueError, match="no directions"):
        order_charts([])


def test_biaxial_ratios() -> None:
    load, strain = np.array([0.0, 5.0, 10.0]), np.array([[0.0, 0.0], [1.0, -0.2], [2.0, -0.5]])
    charts = biaxial_charts("b", [BiaxialPanel("5:1", load, strain, [("m", load, 2 * strain)])])
    check_charts(charts)
    (chart,) = charts.charts
    assert shown(chart) == ("larger load, kN/m", "strain, %", "ratio 5:1")
    for k, yarn in enumerate(("warp", "fill")):
        np.testing.assert_array_equal(lines(chart, f"{yarn}, measured")[0], [load, strain[:, k]])
        np.testing.assert_array_equal(lines(chart, f"{yarn}, m")[0], [load, 2 * strain[:, k]])
    with pytest.raises(ValueError, match="no ratio"):
        biaxial_charts("b", [])
