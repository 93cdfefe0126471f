"""Maps over the sheet: points, rim, directions, colours."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.registration import plot_registration
from bubblefit.reports.rises import plot_rises
from bubblefit.reports.sphere import plot_spheres
from bubblefit.reports.surface import plot_disk
from matplotlib.figure import Figure

TURN = np.linspace(0.0, 2 * np.pi, 37)
EDGE = 100.0 * np.column_stack([np.cos(TURN), np.sin(TURN)])


def sheet(count: int) -> np.ndarray:
    """(count, 2) mm, evenly over the disk."""
    place = np.arange(count) + 0.5
    r, t = 99.0 * np.sqrt(place / count), 2.4 * place
    return np.column_stack([r * np.cos(t), r * np.sin(t)])


@pytest.mark.parametrize(("count", "step"), [(500, 1), (6000, 1), (6001, 2)])
def test_registration(figures: list[Figure], count: int, step: int) -> None:
    points = sheet(count)
    maps = [("height, mm", points[:, 0]), ("displacement, mm", points[:, 1])]
    plot_registration("r", points, maps, EDGE)
    for axes, (title, values) in zip(figures[0].axes[:2], maps, strict=True):
        (dots,) = axes.collections
        np.testing.assert_array_equal(dots.get_offsets(), points[::step])
        np.testing.assert_array_equal(dots.get_array(), values[::step])
        np.testing.assert_array_equal(np.transpose(axes.lines[0].get_data()), EDGE)
        assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title("left")) == (
            "x, mm", "y, mm", title
        )  # fmt: skip
        assert axes.get_aspect() == 1.0
        # Arrows from the centre half way to the rim, each with its name beyond its point.
        arrows = [(t.xy, t.get_position()) for t in axes.texts if not t.get_text()]
        assert arrows == [
            (pytest.approx((50.0, 0.0)), (0, 0)), (pytest.approx((0.0, 50.0)), (0, 0))
        ]  # fmt: skip
        names = {t.get_text(): t for t in axes.texts if t.get_text()}
        assert {name: t.xy for name, t in names.items()} == {
            "warp": pytest.approx((50.0, 0.0)), "fill": pytest.approx((0.0, 50.0))
        }  # fmt: skip
        for name in names.values():
            box, tip = name.get_window_extent(), axes.transData.transform(name.xy)
            assert 0 < box.x0 - tip[0] < 12 and 0 < box.y0 - tip[1] < 12


def test_disk(figures: list[Figure]) -> None:
    places = np.vstack([sheet(400), EDGE[:-1]])
    low = 0.02 * places[:, 0] - 0.5  # mm, from -2.5 to 1.5
    plot_disk("d", [("height, mm", places, low), ("none, mm", places, 0 * low)], EDGE)
    first, second, *_ = figures[0].axes
    for axes, most in ((first, 2.5), (second, 1e-9)):
        (map_,) = axes.collections
        assert map_.get_clim() == pytest.approx((-most, most))
        assert map_.levels == pytest.approx(np.linspace(-most, most, 21))
        np.testing.assert_array_equal(np.transpose(axes.lines[0].get_data()), EDGE)
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (warp), mm", "y (fill), mm")
        assert axes.get_aspect() == 1.0
    assert [a.get_title("left") for a in (first, second)] == ["height, mm", "none, mm"]


@pytest.mark.parametrize(("count", "step"), [(6000, 1), (6001, 2)])
def test_the_first_spheres_in_rows_of_three(figures: list[Figure], count: int, step: int) -> None:
    points, used = np.column_stack([sheet(count), np.zeros(count)]), np.arange(count) % 4 > 0
    off = np.where(used, points[:, 0] / 1e3, 7.0)
    drawn = [(f"{i}", points, (i + 1) * off, used) for i in range(7 if step == 1 else 4)]
    plot_spheres("s", drawn)
    panels = [axes for axes in figures[0].axes if axes.get_xlabel()]
    assert [a.get_title("left") for a in panels] == [str(i) for i in range(min(len(drawn), 6))]
    rows = [round(axes.get_position().y0, 3) for axes in panels]
    assert rows[0] == rows[1] == rows[2] > rows[3]
    largest = len(panels) * np.abs(off[used]).max()
    for i, axes in enumerate(panels):
        inside, _ = axes.collections
        every = np.flatnonzero(used[::step]) * step
        np.testing.assert_array_equal(inside.get_offsets(), points[every, :2])
        np.testing.assert_array_equal(inside.get_array(), (i + 1) * off[every])
        assert inside.get_clim() == pytest.approx((-largest, largest))
        ends = [points[used, 0].min(), points[used, 0].max()]
        edge = 0.05 * np.ptp(ends)
        assert axes.get_xlim() == pytest.approx((ends[0] - edge, ends[1] + edge))
    rest = [a for a in figures[0].axes if a not in panels and not hasattr(a, "_colorbar")]
    assert len(rest) == -len(panels) % 3 and not any(axes.get_visible() for axes in rest)


def test_points_on_their_sphere(figures: list[Figure]) -> None:
    points = np.column_stack([sheet(50), np.zeros(50)])
    plot_spheres("s", [("a", points, np.zeros(50), np.arange(50) > 2)])
    assert figures[0].axes[0].collections[0].get_clim() == (-1.0, 1.0)


@pytest.mark.parametrize(("least", "bottom"), [(0.5, 0.0), (-3.0, -3.0)])
def test_rises(figures: list[Figure], least: float, bottom: float) -> None:
    plot_rises("r", [0.002, 0.02, 0.3], [least, 20.0, 39.0])
    (axes,) = figures[0].axes
    np.testing.assert_allclose(axes.lines[0].get_data(), [[2.0, 20.0, 300.0], [least, 20.0, 39.0]])
    assert axes.get_xlim()[0] == 0.0 and axes.get_ylim()[0] == bottom
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("pressure, kPa", "rise about the centre, mm")
