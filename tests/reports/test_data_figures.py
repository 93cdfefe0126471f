"""Figures of what was measured: a ball through points, a log beside heights."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.clock import plot_clock
from bubblefit.reports.curves import plot_curves
from bubblefit.reports.sphere import plot_spheres
from bubblefit.reports.style import BLUE, NAMED, VERMILION
from matplotlib.figure import Figure


def test_points_astray_do_not_make_the_ball_small(figures: list[Figure]) -> None:
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = np.column_stack([20 + 10 * np.cos(turn), 10 * np.sin(turn), 0 * turn])
    points[4] = [600.0, 0.0, 0.0]
    used = np.arange(40) != 4
    off = np.linspace(-0.2, 0.1, 40)
    plot_spheres("s", [("a: 10 mm", points, np.where(used, off, 580.0), used)])
    panel, bar = figures[0].axes
    assert panel.get_xlim() == pytest.approx((9.0, 31.0), abs=0.1)
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("x, mm", "y, mm")
    assert panel.get_title("left") == "a: 10 mm" and panel.get_aspect() == 1.0
    inside, astray = panel.collections
    assert inside.get_clim() == pytest.approx((-0.2, 0.2))
    np.testing.assert_allclose(inside.get_array(), off[used])
    np.testing.assert_allclose(astray.get_offsets(), [[600.0, 0.0]])
    assert bar.get_ylabel() == "beyond the sphere, mm (x: left out)"


def test_pressures_and_heights_by_one_clock(figures: list[Figure]) -> None:
    times = np.arange(5.0)
    pressures, heights = np.array([0.0, 0.01, 0.02, 0.03, np.nan]), np.arange(5.0) ** 2
    plot_clock("c", times, pressures, heights, np.array([0.02]))
    left, right, beside = figures[0].axes
    np.testing.assert_array_equal(left.lines[0].get_data(), [times, 1e3 * pressures])
    np.testing.assert_array_equal(beside.lines[0].get_data(), [times, heights])
    np.testing.assert_array_equal(right.lines[0].get_data(), [1e3 * pressures, heights])
    known, other = left.get_legend().legend_handles
    assert (known.get_color(), other.get_color()) == (BLUE, VERMILION)
    boxes = [[t.get_text() for t in axes.get_legend().get_texts()] for axes in (left, right)]
    assert boxes == [["pressure of the log", "height"], ["all frames", "taken"]]
    assert right.lines[1].get_fillstyle() == "none"
    assert not beside.xaxis.get_gridlines()[0].get_visible()
    (taken,) = (line for line in right.lines if line.get_color() == VERMILION)
    np.testing.assert_array_equal(taken.get_data(), [[20.0], [4.0]])
    height = "height of the apex, mm"
    assert (left.get_xlabel(), left.get_ylabel()) == ("time by the log's clock, s", "pressure, kPa")
    assert beside.get_ylabel() == height
    assert (right.get_xlabel(), right.get_ylabel()) == ("pressure, kPa", height)


def test_six_specimens_of_a_direction_are_named(figures: list[Figure]) -> None:
    x = np.array([0.0, 1.0, 2.0])
    warp = [(f"specimen {i}", x, (i + 1) * x) for i in range(8)]
    plot_curves("c", {"warp": warp, "fill": [("", x, 5 * x)]})
    left, right = figures[0].axes
    for i, line in enumerate(left.lines):
        np.testing.assert_array_equal(line.get_data(), [x, (i + 1) * x])
    assert [line.get_color() for line in left.lines] == [*NAMED, *NAMED[:2]]
    names = [text.get_text() for text in left.get_legend().get_texts()]
    assert names == [f"specimen {i}" for i in range(6)]
    assert right.get_legend() is None and len(right.lines) == 1
    words = ("elongation of the gauge, mm", "load, N")
    assert [(a.get_xlabel(), a.get_ylabel()) for a in (left, right)] == [words] * 2
    assert [a.get_title("left") for a in (left, right)] == ["warp", "fill"]
