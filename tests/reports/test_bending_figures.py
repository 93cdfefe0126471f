"""Figures of bent cylinders: curves, what was measured, and the gas."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

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
from bubblefit.reports.style import BLACK, GREY, NAMED
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from ..drawings import data, legend, lines, titles

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


def test_loads_and_what_the_cards_miss(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_bending(tmp_path / "b.png", CASE)
    top, low = drawn[0].axes
    (soft, knee), (stiff, limit) = lines(top, NAMED[0]), lines(top, NAMED[1])
    np.testing.assert_array_equal(soft, [WAY, 3 * WAY])
    np.testing.assert_array_equal(stiff, [WAY, 5 * WAY])
    assert (knee.ravel().tolist(), limit.ravel().tolist()) == ([20.0, 60.0], [40.0, 200.0])
    for shown, reading in zip(lines(top, GREY), MEASURED.readings, strict=True):
        np.testing.assert_array_equal(shown, reading)
    np.testing.assert_array_equal(data(top)[0], [GRID, 4 * GRID])
    (band,) = top.collections
    upper = band.get_paths()[0].vertices[:, 1].max()
    assert upper == pytest.approx((4.1 * GRID).max())
    (off,), (other,) = lines(low, NAMED[0]), lines(low, NAMED[1])
    assert off == pytest.approx(np.array([GRID, -GRID]))
    assert other == pytest.approx(np.array([GRID, GRID]))
    assert top.get_xlim() == pytest.approx((0.0, 1.03 * 40.0))
    assert top.get_ylim() == pytest.approx((0.0, 1.06 * 200.0))
    (below,) = low.collections
    ends = below.get_paths()[0].vertices[:, 1]
    assert (ends.min(), ends.max()) == pytest.approx((-3.0, 3.0))
    assert lines(low, BLACK)[0][1].tolist() == [0.0, 0.0]
    box = top.get_legend()
    assert [text.get_text() for text in box.get_texts()] == ["3.11 N"]
    assert legend(drawn[0]) == [
        "soft", "stiff", "measured", "mean", "scatter of repetitions (±)", "knee", "limit point",
    ]  # fmt: skip


def test_a_band_goes_from_the_curve_to_its_other_end(tmp_path: Path, drawn: list[Figure]) -> None:
    """The other end stops before; the axes hold it."""
    way = WAY[:7]
    case = BendPanel("one", [replace(SOFT, other=(way, 4 * way)), STIFF], band="from soft to hard")
    plot_bending(tmp_path / "b.png", case)
    (axes,) = drawn[0].axes
    (band,) = axes.collections
    corners = {tuple(corner) for corner in band.get_paths()[0].vertices.tolist()}
    assert {(30.0, 90.0), (30.0, 120.0)} <= corners and max(x for x, _ in corners) == 30.0
    assert band.get_facecolor()[0][:3] == pytest.approx(to_rgb(NAMED[0]))
    (own, other, _) = lines(axes, NAMED[0])
    assert {len(own[0]), len(other[0])} == {7, 9}
    assert legend(drawn[0]) == ["soft", "stiff", "from soft to hard", "knee", "limit point"]
    high = BendPanel("two", [replace(SOFT, other=(WAY, 9 * WAY))], band="from soft to hard")
    plot_bending_cases(tmp_path / "a.png", [high], 1)
    assert drawn[1].axes[0].get_ylim()[1] == pytest.approx(1.06 * 360.0)


def test_all_cases_with_the_same_loads_in_a_row(tmp_path: Path, drawn: list[Figure]) -> None:
    other = BendPanel("two", [STIFF])
    plot_bending_cases(tmp_path / "a.png", [BendPanel("one", [SOFT]), other, BendPanel("")], 2)
    assert titles(drawn[0]) == ["one", "two", "", ""]
    one, two, *free = drawn[0].axes
    assert one.get_ylim() == two.get_ylim() == pytest.approx((0.0, 1.06 * 200.0))
    np.testing.assert_array_equal(lines(one, NAMED[0])[0], [WAY, 3 * WAY])
    np.testing.assert_array_equal(lines(two, NAMED[1])[0], [WAY, 5 * WAY])
    assert not any(axes.axison for axes in free)


def test_a_free_place_and_who_names_the_axis(figures: list[Figure]) -> None:
    """The lowest panel of a column does, and one above a free place."""
    names = ["a", "b", "c", "d", "", "f"]
    plot_bending_cases("a", [BendPanel(n, [SOFT] if n else []) for n in names], 2)
    panels = figures[0].axes
    wanted = {"b": False, "c": True, "d": False, "f": True, "a": False}
    for name, axes in zip(names, panels, strict=True):
        assert axes.axison == bool(name)
        if name:
            assert axes.get_xlabel() == ("deflection, mm" if wanted[name] else "")
            assert axes.xaxis.get_tick_params()["labelbottom"] == wanted[name]
            assert axes.get_ylabel() == ("load, N" if name == "a" or name == "c" else "")


def test_nothing_to_draw(figures: list[Figure]) -> None:
    plot_bending("a", BendPanel("none"))
    plot_bending_cases("b", [BendPanel("none")], 1)
    for figure in figures:
        (axes,) = figure.axes
        assert (axes.get_xlim(), axes.get_ylim()) == ((0.0, 1.0), (0.0, 1.0))
        assert not figure.legends
    with pytest.raises(ValueError, match="no cases to draw"):
        plot_bending_cases("b", [], 1)


def test_readings_beyond_the_cards_are_seen(figures: list[Figure]) -> None:
    """Load and deflection go as far as what was measured where that is more."""
    short = BendLine("short", 0, WAY[:3], WAY[:3])
    long = BendReadings([(WAY[:7], 4.1 * WAY[:7])], GRID, 4 * GRID, 0.1 * GRID)
    plot_bending("a", BendPanel("one", [short], long))
    top, low = figures[0].axes
    assert top.get_xlim() == pytest.approx((0.0, 1.03 * 30.0))
    assert top.get_ylim() == pytest.approx((0.0, 1.06 * 4.1 * 30.0))
    # Where the card does not go nothing is known of it.
    off = lines(low, NAMED[0])[0][1]
    assert off == pytest.approx(np.where(GRID <= 10.0, -3 * GRID, np.nan), nan_ok=True)


def test_gas_in_kilopascal_and_litres(tmp_path: Path, drawn: list[Figure]) -> None:
    plot_gas(tmp_path / "g.png", CASE)
    left, right = drawn[0].axes
    (by_volume,), (by_way,) = lines(left, NAMED[0]), lines(right, NAMED[0])
    assert by_volume == pytest.approx(np.array([-0.01 * WAY, 140.0 + 0.01 * WAY]))
    assert by_way == pytest.approx(np.array([WAY, 140.0 + 0.01 * WAY]))
    assert legend(drawn[0]) == ["soft, from 50 litres", "stiff, from 50 litres"]
    shown = [axes.yaxis.get_tick_params()["labelleft"] for axes in (left, right)]
    assert shown == [True, False]
    assert "litres" in left.get_xlabel() and "kPa" in left.get_ylabel()
