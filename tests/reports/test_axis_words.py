"""Every axis says what it shows and in which unit: once for a row of panels, beneath the lowest."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.bending import (
    BendLine,
    BendPanel,
    BendReadings,
    plot_bending,
    plot_bending_cases,
    plot_gas,
)
from bubblefit.reports.convergence import ConvergencePanel, plot_convergence
from bubblefit.reports.loads import StripCurves, plot_loads
from bubblefit.reports.nu12 import plot_nu12
from bubblefit.reports.orders import OrderErrors, plot_orders
from bubblefit.reports.pinned import plot_pinned
from bubblefit.reports.scatter import plot_heights
from bubblefit.reports.style import GREY
from matplotlib.figure import Figure

X = np.linspace(0.0, 4.0, 5)
LINE = BendLine("card", 0, X, 3 * X, 0.14 + 0 * X, 5e7 + X)
SEEN = BendReadings([(X, 3 * X)], X, 3 * X, 0 * X + 1)
STRIP = StripCurves("fill", [("model", X, X)], (X, X), None, None)
PANEL = ConvergencePanel("bubble", [2.0, 1.0], {"apex, mm": [0.1]}, [10, 40], [0.1, 0.3])
ORDER = OrderErrors("warp", [1, 2], [3.0, 2.0], [3.0, 2.0], 2)
STRAINS, SIGMA = np.tile(X, (3, 1)), np.full((3, 5), 40.0)
DEFLECTION, CHANGE = "deflection of the collar, mm", "change to the next finer level, %"
EDGE = "mean edge, mm"

#: Drawing, and (x, y) of each axis.
FIGURES = {
    "bending alone": (
        lambda: plot_bending("b", BendPanel("one", [LINE])), [(DEFLECTION, "load, N")]
    ),
    "bending": (
        lambda: plot_bending("b", BendPanel("one", [LINE], SEEN)),
        [("", "load, N"), (DEFLECTION, "model $-$ mean, N")],
    ),
    "cases": (
        lambda: plot_bending_cases("b", [BendPanel(n, [LINE]) for n in "abc"], 2),
        [("", "load, N"), ("deflection, mm", ""), ("deflection, mm", "load, N"), ("", "")],
    ),
    "gas": (
        lambda: plot_gas("b", BendPanel("one", [LINE])),
        [("volume less that when inflated, litres", "gauge pressure, kPa"), (DEFLECTION, "")],
    ),
    "convergence": (
        lambda: plot_convergence("b", [PANEL, PANEL], "elements"),
        [(EDGE, CHANGE), (EDGE, ""), ("elements x increments", "seconds")],
    ),
    "loads": (
        lambda: plot_loads("b", [STRIP, STRIP]),
        [("", "load, N"), ("", ""), ("gauge elongation, mm", "difference, N"),
         ("gauge elongation, mm", "")],
    ),
    "nu12": (
        lambda: plot_nu12("b", {"a": {"r": (X, X)}, "b": {"r": (X, X)}}, 0.24, "load"),
        [("nu12", "load / that at nu12 = 0.24"), ("nu12", "")],
    ),
    "orders": (
        lambda: plot_orders("b", [ORDER, ORDER]),
        [("order of the polynomial", "error of the load, N"), ("order of the polynomial", "")],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FIGURES)
def test_quantity_and_unit(name: str, figures: list[Figure]) -> None:
    draw, wanted = FIGURES[name]
    draw()
    assert [(a.get_xlabel(), a.get_ylabel()) for a in figures[0].axes] == wanted


def test_what_is_not_determined_lies_above_a_line(figures: list[Figure]) -> None:
    lost = SIGMA.copy()
    lost[2] = np.inf
    plot_pinned("p", STRAINS, {"bubble": lost, "strips": SIGMA})
    for panel in figures[0].axes:
        (line,) = (line for line in panel.lines if line.get_color() == GREY)
        assert line.get_ydata() == pytest.approx([1000.0] * 2)
        end = 1000.0 * 10 ** (2.6 * 0.14 + 0.32)
        assert panel.get_ylim() == pytest.approx((10.0, end))
    assert figures[0].axes[0].get_ylabel() == r"1 $\sigma$, % of the modulus"
    assert [panel.get_ylabel() for panel in figures[0].axes[1:]] == ["", ""]


def test_without_any_sigma_the_axes_are_there(figures: list[Figure]) -> None:
    plot_pinned("p", STRAINS, {})
    assert figures[0].axes[0].get_ylim()[0] == pytest.approx(1.0)


def test_rows_of_cases_have_their_own_loads(figures: list[Figure]) -> None:
    panels = [
        BendPanel(str(i), [BendLine("card", 0, X, f * X, X, X)]) for i, f in enumerate((1, 2, 9))
    ]
    plot_bending_cases("b", panels, 2)
    for axes, highest in zip(figures[0].axes[:3], (8.0, 8.0, 36.0), strict=True):
        assert axes.get_ylim() == pytest.approx((0.0, 1.06 * highest))
    assert figures[0].axes[0].get_xlim() == pytest.approx((0.0, 1.03 * 4.0))


def test_heights_have_all_points_in_sight(figures: list[Figure]) -> None:
    seen, model = np.array([1.0, 20.0, 30.0]), np.array([-0.5, 21.0, 31.0])
    plot_heights("h", [0.022], [seen], [model])
    left, right = figures[0].axes
    assert left.get_xlim() == left.get_ylim() == pytest.approx((-0.5, 1.03 * 31.0))
    np.testing.assert_array_equal(left.lines[1].get_data(), [seen, model])
    np.testing.assert_array_equal(right.lines[1].get_data(), [seen, model - seen])
    rms, r2 = np.sqrt((1.5**2 + 2) / 3), 1 - (1.5**2 + 2) / ((seen - 17) ** 2).sum()
    assert right.get_title("left") == f"RMS {rms:.2g} mm"
    assert left.get_title("left") == f"$R^2$ = {r2:.3f}"
    assert [t.get_text() for t in figures[0].legends[0].get_texts()] == ["22 kPa"]
    assert (left.get_xlabel(), left.get_ylabel()) == ("measured z, mm", "modelled z, mm")
    assert (right.get_xlabel(), right.get_ylabel()) == (
        "measured z, mm",
        "modelled $-$ measured, mm",
    )
