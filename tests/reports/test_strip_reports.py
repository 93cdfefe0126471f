"""Figures of strip tests and laws: what is drawn, not only that something is."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from bubblefit.meshes.strip_models import strip_mesh
from bubblefit.reports.laws import LawRow, plot_laws
from bubblefit.reports.loads import StripCurves, plot_loads
from bubblefit.reports.moduli import plot_moduli
from bubblefit.reports.moduli_together import plot_moduli_together
from bubblefit.reports.orders import OrderErrors, plot_orders
from bubblefit.reports.pinned import plot_pinned
from bubblefit.reports.strip import plot_strip
from bubblefit.reports.style import BLACK, GREY, NAMED, SKY, named_look
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from ..drawings import legend, lines
from ..places import PUBLISHED

U = np.linspace(0.0, 4.0, 41)
STRAINS = np.linspace(0, [0.15, 0.2, 0.6], 20).T
MODULI = np.array([[800.0], [150.0], [20.0]]) * (1 + STRAINS)


def is_inside(figure: Figure) -> bool:
    """Whether no legend hangs over the edge of the figure."""
    box = figure.legends[0].get_window_extent()
    return box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1


# Loads


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


def test_loads(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_loads(tmp_path / "l.png", [strip(), strip(direction="bias45", rms=[50.1])])
    top, _, low, _ = drawn[0].axes
    (best,), (second,) = lines(top, NAMED[0]), lines(top, NAMED[1])
    assert best == pytest.approx(np.array([U, 110 * U]))
    assert second[0, -1] == pytest.approx(2.0)
    assert lines(top, SKY)[0] == pytest.approx(np.array([U, 100 * U]))
    assert lines(top, GREY)[0][0] == pytest.approx([3.0, 1.0, 5.0])
    assert lines(low, NAMED[0])[0] == pytest.approx(np.array([U, 10 * U]), abs=1e-9)
    assert lines(low, NAMED[1])[0][1, -1] == pytest.approx(-20.0)
    # The measured points about their polynomial; it ends before the last of them.
    assert lines(low, GREY)[0][1] == pytest.approx([0, -10.0, 30.0, np.nan], nan_ok=True)
    band = low.patches[0].get_extents().transformed(low.transData.inverted())
    assert (band.y0, band.y1) == pytest.approx((-21.7, 21.7))
    assert lines(low, BLACK)[0][1].tolist() == [0.0, 0.0]
    box = top.get_legend()
    assert [handle.get_color() for handle in box.legend_handles] == [*NAMED[:2]]
    assert box.get_title().get_text() == "RMS error, warp"
    assert legend(drawn[0]) == [
        "measured", "polynomial", "Table 3.2", "bubble", "scatter of specimens (±)",
    ]  # fmt: skip
    assert is_inside(drawn[0])


def test_loads_say_what_and_how_well(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_loads(tmp_path / "l.png", [strip(), strip(direction="bias45", rms=[50.1])])
    warp, bias, low, _ = drawn[0].axes
    assert (warp.get_title("left"), bias.get_title("left")) == ("warp", "45° bias")
    assert (warp.get_ylabel(), low.get_ylabel()) == ("load, N", "difference, N")
    assert low.get_xlabel() == "gauge elongation, mm"
    shown = [axes.get_legend() for axes in (warp, bias)]
    assert [[t.get_text() for t in box.get_texts()] for box in shown] == [
        ["3.11 N", "68 N"],
        ["50.1 N"],
    ]
    assert "bias" in shown[1].get_title().get_text()


def test_without_a_polynomial_the_points_are_the_target(
    tmp_path: Path, drawn: list[Figure]
) -> None:
    plot_loads(tmp_path / "l.png", [strip(polynomial=None, rms=())])
    dots = lines(drawn[0].axes[1], NAMED[0])[0]
    assert dots[0] == pytest.approx([0, 1, 3, 5])
    assert dots[1] == pytest.approx([0, 20.0, 0.0, np.nan], nan_ok=True)


def test_loads_of_models_alone(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_loads(tmp_path / "l.png", [strip(polynomial=None, points=None, rms=())])
    assert len(drawn[0].axes) == 1
    assert legend(drawn[0]) == ["Table 3.2", "bubble"]
    assert drawn[0].axes[0].get_xlabel() == "gauge elongation, mm"
    assert drawn[0].axes[0].xaxis.get_tick_params()["labelbottom"]
    plot_loads(tmp_path / "l.png", [strip(), strip(polynomial=None, points=None)])
    assert [axes.axison for axes in drawn[1].axes] == [True, True, True, False]


def test_a_model_has_one_colour_in_all_panels(tmp_path: Path, drawn: list[Figure]) -> None:
    other = strip(models=[("bubble", U, 95 * U)], rms=())
    plot_loads(tmp_path / "l.png", [strip(), other])
    assert lines(drawn[0].axes[1], NAMED[1])[0][1] == pytest.approx(95 * U)
    assert lines(drawn[0].axes[1], NAMED[0]) == []


def test_points_before_zero_are_seen(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_loads(tmp_path / "l.png", [strip(points=([-0.2, 1.0], [1.0, 90.0])), strip()])
    first, second = drawn[0].axes[:2]
    assert (first.get_xlim()[0], second.get_xlim()[0]) == (-0.2, 0.0)


@pytest.mark.parametrize(("least", "bottom"), [(40.0, 0.0), (-40.0, -40.0)])
def test_loads_stand_on_zero_and_all_are_seen(
    tmp_path: Path, drawn: list[Figure], least: float, bottom: float
) -> None:
    """The axis begins at no load, or below where a machine recorded less."""
    pulled = strip(models=[], polynomial=None, points=([1.0, 2.0], [least, 200.0]), rms=())
    plot_loads(tmp_path / "l.png", [pulled])
    low, high = drawn[0].axes[0].get_ylim()
    assert low == 0.0 if bottom == 0.0 else low < bottom
    assert high > 200.0


def test_no_strips(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no strips"):
        plot_loads(tmp_path / "l.png", [])


def test_many_names_stay_apart() -> None:
    looks = [(named_look(i)["color"], str(named_look(i)["linestyle"])) for i in range(20)]
    assert len(set(looks)) == 20


def test_measured_loads(tmp_path: Path, drawn: list[Figure], shared_data: Path) -> None:
    """The published polynomials lie on the published points, to their scatter."""

    def rows(path: Path) -> list[dict[str, str]]:
        with path.open() as text:
            return list(csv.DictReader(line for line in text if not line.startswith("#")))

    curves = []
    points = rows(shared_data / "uniaxial/valmex7318_load_gauge.csv")
    for row in rows(PUBLISHED / "published_uniaxial_polynomials.csv"):
        own = [p for p in points if p["series"] == row["direction"]]
        x, y = (np.array([float(p[k]) for p in own]) for k in ("gauge_disp_mm", "load_N"))
        u = np.linspace(0.0, x.max(), 2001)  # to the last point, as they were fitted
        load = np.polyval([*(float(row[f"c{k}"]) for k in (4, 3, 2, 1)), 0.0], u)
        scatter = float(row["data_scatter_N"])
        curves.append(StripCurves(row["direction"], (), (x, y), (u, load), scatter))
    plot_loads(tmp_path / "l.png", curves)
    for axes, curve in zip(drawn[0].axes[3:], curves, strict=True):
        difference = lines(axes, GREY)[0][1]
        assert np.sqrt(np.mean(difference**2)) == pytest.approx(curve.scatter, rel=0.03)


# Moduli


def test_named_laws_with_their_own_ranges(tmp_path: Path, drawn: list[Figure]) -> None:
    band = np.array([MODULI - 5.0, MODULI + 5.0])
    band[1, 2, 15:] = np.inf
    plot_moduli(
        tmp_path / "m.png", np.array([STRAINS, 0.4 * STRAINS]), np.array([MODULI, 2 * MODULI]),
        names=["uniaxial", "bubble"], band=band,
    )  # fmt: skip
    shear = drawn[0].axes[2]
    assert lines(shear, NAMED[0])[0] == pytest.approx(np.array([STRAINS[2], MODULI[2]]))
    assert lines(shear, NAMED[1])[0] == pytest.approx(np.array([0.4 * STRAINS[2], 2 * MODULI[2]]))
    assert to_hex(shear.collections[0].get_facecolor()[0]) == to_hex(NAMED[0])
    band = shear.collections[0].get_paths()[0].vertices
    assert band[:, 0].max() == pytest.approx(STRAINS[2, 14])
    assert band[:, 1].min() == pytest.approx(MODULI[2, 0] - 5.0)
    assert legend(drawn[0]) == ["uniaxial", "bubble", "95 % band"]


def test_best_and_next_are_drawn_as_before(tmp_path: Path, drawn: list[Figure]) -> None:
    fits = np.array([MODULI, 1.1 * MODULI, 1.2 * MODULI])
    plot_moduli(tmp_path / "m.png", STRAINS, fits, MODULI / 1.01)
    assert legend(drawn[0]) == ["best", "next 2", "known"]
    top, low = drawn[0].axes[0], drawn[0].axes[3]
    assert [line.get_color() for line in top.lines][1:] == [SKY, SKY, BLACK]
    assert lines(low, BLACK)[0][1] == pytest.approx(1.0)
    assert low.texts[0].get_text() == "best: at most 1 %"


def test_moduli_that_do_not_match(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="1 names for 2 fits"):
        plot_moduli(tmp_path / "m.png", STRAINS, np.array([MODULI] * 2), names=["a"])
    with pytest.raises(ValueError, match="same strains"):
        plot_moduli(tmp_path / "m.png", STRAINS[None], MODULI[None], MODULI)


def test_the_three_moduli_together(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_moduli_together(tmp_path / "m.png", STRAINS, MODULI, 0.1 * MODULI, "Table 3.2")
    plot_moduli_together(tmp_path / "m.png", STRAINS, MODULI - 30.0)
    log, linear = (figure.axes[0] for figure in drawn)
    assert (log.get_yscale(), linear.get_yscale()) == ("log", "linear")
    assert log.get_ylim() == pytest.approx((MODULI.min() / 1.5, MODULI.max() * 1.5))
    least, most = MODULI.min() - 30.0, MODULI.max() - 30.0
    assert linear.get_ylim() == pytest.approx((least, 1.08 * most))
    assert log.get_xlim()[0] == linear.get_xlim()[0] == 0.0
    words = [(axes.get_xlabel(), axes.get_ylabel()) for axes in (log, linear)]
    assert words == [("logarithmic strain", "tangent modulus, MPa")] * 2
    for m, band in enumerate(log.collections):
        ends = band.get_paths()[0].vertices[:, 1]
        assert (ends.min(), ends.max()) == pytest.approx(
            (0.9 * MODULI[m].min(), 1.1 * MODULI[m].max())
        )
    curves = [np.array(line.get_data()) for line in log.lines]
    for m in range(3):
        assert curves[2 * m] == pytest.approx(np.array([STRAINS[m], MODULI[m]]))
        assert curves[2 * m + 1].ravel() == pytest.approx([STRAINS[m, -1], MODULI[m, -1]])
    assert len(log.collections) == 3 and log.get_title("left") == "Table 3.2"


# Deformed strip


def draw_strip(path: Path, shear: np.ndarray, grips: bool = True) -> None:
    mesh = strip_mesh(4.0, 8.0, 4, 8, 3.0)
    u = np.zeros_like(mesh.points)
    u[:, 1] = 0.5 * (mesh.points[:, 1] - 8.0)
    gauge = mesh.node_sets["gauge"]
    plot_strip(path, mesh.points, mesh.quads, u, shear, gauge, "bias", grips)


def upper_height(axes) -> float:
    return axes.patches[0].get_height()


def test_deformed_strip(tmp_path: Path, drawn: list[Figure]) -> None:
    shear = np.linspace(0.1, 0.6, 32)
    draw_strip(tmp_path / "s.png", shear)
    axes, bar = drawn[0].axes
    faces = next(c for c in axes.collections if isinstance(c, PolyCollection))
    corners = np.concatenate([path.vertices for path in faces.get_paths()])
    assert (corners[:, 1].min(), corners[:, 1].max()) == pytest.approx((-4.0, 8.0))
    assert np.asarray(faces.get_array()) == pytest.approx(shear)
    assert faces.get_clim() == pytest.approx((0.0, 0.6))
    rest, now = (c for c in axes.collections if isinstance(c, LineCollection))
    edges = np.array(rest.get_segments())
    assert np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).sum() == pytest.approx(24.0)
    assert np.array(now.get_segments())[..., 1].min() == pytest.approx(-4.0)
    before, after = (np.array(line.get_data()) for line in axes.lines)
    assert np.ptp(before, axis=1) == pytest.approx([0.0, 3.0])
    assert np.ptp(after, axis=1) == pytest.approx([0.0, 4.5])
    # At rest grey and open, now black and filled, as the outlines.
    marks = [(line.get_color(), line.get_markerfacecolor()) for line in axes.lines]
    assert marks == [(GREY, "none"), (BLACK, "white")]
    assert [to_hex(c.get_edgecolor()[0]) for c in (rest, now)] == [
        to_hex(GREY), to_hex(BLACK)
    ]  # fmt: skip
    assert [(p.get_x(), p.get_width()) for p in axes.patches] == [
        (corners[:, 0].min(), pytest.approx(np.ptp(corners[:, 0])))
    ] * 2
    assert upper_height(axes) == pytest.approx(0.06 * 8.0)
    upper, lower = axes.patches
    assert (upper.get_y(), lower.get_y() + lower.get_height()) == pytest.approx((8.0, -4.0))
    assert axes.get_aspect() == 1.0 and "gamma" in bar.get_ylabel()
    assert legend(drawn[0]) == ["at rest", "grips", "gauge at rest, 3.00 mm", "gauge, 4.50 mm"]
    assert is_inside(drawn[0])


@pytest.mark.parametrize(
    ("ends", "limits"),
    [
        ((-0.2, 0.6), (-0.6, 0.6)),
        ((-0.001, 0.6), (-0.001, 0.6)),
        ((-0.6, -0.1), (-0.6, 0.0)),
        ((-3e-4, -1e-4), (-3e-4, 0.0)),
        ((0.0, 0.0), (0.0, 1.0)),
    ],
)
def test_the_scale_of_shear_holds_zero(
    tmp_path: Path, drawn: list[Figure], ends: tuple[float, float], limits: tuple[float, float]
) -> None:
    draw_strip(tmp_path / "s.png", np.linspace(*ends, 32), grips=False)
    assert drawn[0].axes[0].collections[0].get_clim() == pytest.approx(limits)
    assert not drawn[0].axes[0].patches


def test_shear_for_every_quad(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="3 shear strains for 32 quads"):
        draw_strip(tmp_path / "s.png", np.zeros(3))


# Forms of the law, data sets, orders


def test_laws(tmp_path: Path, drawn: list[Figure]) -> None:
    rows = [
        LawRow("constant", 3, 210.0, 260.0, [200.0, 300.0]),
        LawRow("cubic", 12, 48.0, 60.0, [50.0, np.nan]),
        LawRow("trilinear", 9, float("nan")),
    ]
    plot_laws(tmp_path / "l.png", rows, scatter=45.0)
    axes = drawn[0].axes[0]
    assert [t.get_text() for t in axes.get_xticklabels()] == [
        "constant (3)", "cubic (12)\n1 fold without a result", "trilinear (9)\nno fit",
    ]  # fmt: skip
    assert [t.get_text() for t in axes.texts] == ["210", "48", "260", "60"]
    marked = {line.get_label(): line for line in axes.lines}
    data = [np.asarray(line.get_ydata(), dtype=float) for line in marked.values()]
    assert any(np.array_equal(y, [210.0, 48.0, np.nan], equal_nan=True) for y in data)
    assert any(np.array_equal(y, [200.0, 300.0]) for y in data)
    assert any(np.array_equal(y, [45.0, 45.0]) for y in data)
    # The dots of a law stand beside its place, its folds to their right, joined by a bar.
    dots = {line.get_label(): np.asarray(line.get_xdata()) for line in axes.lines}
    places = sorted(tuple(np.round(x, 9)) for x in dots.values())
    assert places == [
        (-0.14, 0.86, 1.86), (0.0, 1.0), (0.14, 0.14), (0.14, 1.14, 2.14), (0.24, 0.24),
        (1.14, 1.14), (1.24,),
    ]  # fmt: skip
    assert axes.get_xlim() == pytest.approx((-0.6, 2.6))
    assert axes.get_ylim() == pytest.approx((0.0, 1.1 * 300.0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "form of the moduli (number of coefficients)", "RMS error, N"
    )  # fmt: skip
    for text in axes.texts:  # beside its dot, at its left
        box, dot = text.get_window_extent(), axes.transData.transform(text.xy)
        assert 3 < dot[0] - box.x1 < 16 and box.y0 < dot[1] < box.y1
    assert axes.get_yscale() == "linear"
    assert legend(drawn[0]) == [
        "error of the fit", "cross-validated error", "single folds", "scatter of specimens",
    ]  # fmt: skip
    assert is_inside(drawn[0])


def test_laws_over_decades(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_laws(tmp_path / "l.png", [LawRow("constant", 3, 500.0), LawRow("cubic", 12, 5.0)])
    assert drawn[0].axes[0].get_yscale() == "log"
    assert drawn[0].axes[0].get_xlim() == pytest.approx((-0.6, 1.6))
    lost = LawRow("spline", 6, 500.0, 510.0, [np.nan, 505.0, np.inf])
    plot_laws(tmp_path / "m.png", [lost], scatter=1500.0)
    axes = drawn[1].axes[0]
    assert axes.get_xticklabels()[0].get_text() == "spline (6)\n2 folds without a result"
    assert axes.get_ylim() == pytest.approx((0.0, 1650.0))
    assert legend(drawn[0]) == ["error of the fit", "cross-validated error"]
    with pytest.raises(ValueError, match="no laws"):
        plot_laws(tmp_path / "l.png", [])


def test_what_is_not_determined_is_marked(tmp_path: Path, drawn: list[Figure]) -> None:
    alone, both = np.full((3, 20), 3.0), np.full((3, 20), 1.0)
    alone[2, 10:15], alone[2, 15], alone[2, 16:] = 5e3, np.nan, np.inf
    plot_pinned(tmp_path / "p.png", STRAINS, {"bubble": alone, "both": both})
    warp, _, shear = drawn[0].axes
    line, mark = lines(shear, NAMED[0])
    assert line[1, :10] == pytest.approx(3.0) and np.isnan(line[1, 10:]).all()
    assert np.isnan(mark[1, :10]).all() and (mark[1, 10:] > 1000.0).all()
    assert (mark[1, 10:] < shear.get_ylim()[1]).all()
    assert [t.get_text() for t in shear.texts] == ["not determined (over 1000 %)"]
    assert mark[1, 10:] == pytest.approx(10 ** (3 + 0.14 * 0.8))
    (band,) = shear.patches
    end = shear.get_ylim()[1]
    low, high = band.get_extents().transformed(shear.transData.inverted()).intervaly
    assert (low, high) == pytest.approx((1000.0, end))
    assert [f"{tick:g}" for tick in shear.get_yticks()] == ["1", "10", "100", "1000"]
    labels = [label.get_text() for label in warp.get_yticklabels()]
    assert labels == ["1", "10", "100", "1000"]
    (words,) = shear.texts
    box, panel = words.get_window_extent(), shear.get_window_extent()
    marks = shear.transData.transform((0, 10 ** (3 + 0.14 * 2.6)))[1]
    assert 0 < panel.x1 - box.x1 < 0.05 * panel.width and box.y0 > marks - 2
    assert np.isnan(lines(warp, NAMED[0])[1][1]).all() and not warp.texts
    assert lines(shear, NAMED[1])[0][1] == pytest.approx(1.0)
    assert shear.get_yscale() == "log" and legend(drawn[0]) == ["bubble", "both"]


@pytest.mark.parametrize(
    ("least", "most", "ends"),
    [(3.0, 3.0, (1.0, 10.0)), (0.02, 0.03, (0.01, 0.1)), (0.02, 30.0, (0.01, 100.0))],
)
def test_what_is_determined_is_seen_in_whole_decades(
    tmp_path: Path, drawn: list[Figure], least: float, most: float, ends: tuple[float, float]
) -> None:
    sigma = np.tile(np.geomspace(least, most, 20), (3, 1))
    plot_pinned(tmp_path / "p.png", STRAINS, {"both": sigma})
    for panel in drawn[0].axes:
        assert panel.get_ylim() == pytest.approx(ends)


@pytest.mark.parametrize("value", [0.0, 0.4, 1000.0, np.inf])
def test_pinned_at_the_ends(tmp_path: Path, drawn: list[Figure], value: float) -> None:
    plot_pinned(tmp_path / "p.png", STRAINS, {"both": np.full((3, 20), value)})
    low, high = drawn[0].axes[0].get_ylim()
    assert 0 < low < high
    shown, lost = lines(drawn[0].axes[0], NAMED[0])
    assert lost[1] == pytest.approx(10 ** (3 + 0.14 * 0.8), nan_ok=True) or value <= 1000.0
    assert value > 1000.0 or shown[1] == pytest.approx(max(value, 1e-3))
    assert low == pytest.approx({0.0: 1e-3, 0.4: 0.1, 1000.0: 1e3}.get(value, 1.0))
    line, mark = (np.isfinite(data[1]).all() for data in (shown, lost))
    assert (line, mark) == (value <= 1000.0, value > 1000.0)


def test_orders(tmp_path: Path, drawn: list[Figure]) -> None:
    orders, rmse = [1, 2, 3, 4, 5], [70.0, 60.0, 30.0, 21.0, 20.0]
    warp = OrderErrors("warp", orders, rmse, [72.0, 64.0, 33.0, 23.0, 800.0], 4)
    fill = OrderErrors("fill", orders, rmse, rmse, 2)
    plot_orders(tmp_path / "o.png", [warp, fill])
    left, right = drawn[0].axes
    assert (left.get_yscale(), right.get_yscale()) == ("log", "linear")
    assert (left.get_title("left"), right.get_title("left")) == ("warp: order 4", "fill: order 2")
    assert left.lines[0].get_ydata() == pytest.approx(rmse)
    assert left.lines[1].get_ydata()[-1] == 800.0
    bar = left.patches[0]
    assert (bar.get_x(), bar.get_width()) == pytest.approx((3.7, 0.6))
    assert left.get_xlim() == right.get_xlim() == (0.5, 5.5)
    assert all(tick == round(tick) for tick in right.get_xticks())
    assert legend(drawn[0]) == ["RMSE of the fit", "leave-one-out error", "chosen order"]
    # Leaving out the one point that an order hangs on has no finite error.
    lost = [np.nan] * 5
    plot_orders(tmp_path / "o.png", [OrderErrors("warp", orders, rmse, [*rmse[:4], np.inf], 4)])
    plot_orders(tmp_path / "o.png", [OrderErrors("warp", orders, lost, lost, 4)])
    assert [f.axes[0].get_ylim() for f in drawn[1:]] == [pytest.approx((0, 77)), (0, 1)]
    with pytest.raises(ValueError, match="no directions"):
        plot_orders(tmp_path / "o.png", [])
