"""Charts, maps and surfaces as data and as SVG: every value in its place."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bubblefit.reports import map_svg as maps_drawn
from bubblefit.reports import solid_svg as solids_drawn
from bubblefit.reports.axes import Axis, axes_of
from bubblefit.reports.chart_svg import FEW, LEFT, NARROW, RIGHT, WIDTH, chart_svg
from bubblefit.reports.charts import MOST_POINTS, Chart, Series, dots, line
from bubblefit.reports.map_svg import map_svg, row_ends, scale_bar
from bubblefit.reports.maps import MOST_PLACES, Shade, Solid, maps_of
from bubblefit.reports.packed import Packed, pack
from bubblefit.reports.shades import CLASSES, classes
from bubblefit.reports.solid_svg import BAR, CENTRE, scale_of, seen, solid_svg
from bubblefit.reports.ticks import log_ticks, ticks, written
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

FINITE = st.floats(-1e6, 1e6)


@given(arrays(float, st.integers(1, 40), elements=FINITE | st.just(np.nan)))
def test_packed_numbers_come_back(values: np.ndarray) -> None:
    packed = pack(values)
    back = packed.values
    np.testing.assert_array_equal(np.isnan(back), np.isnan(values))
    np.testing.assert_allclose(back, values, atol=0.5001 * packed.step, rtol=1e-9)


@pytest.mark.parametrize("shape", [(2,), (4,), (2, 2)])
def test_packed_numbers_of_another_shape(shape: tuple[int, ...]) -> None:
    whole = pack([1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="expected"):
        _ = Packed(shape, whole.least, whole.step, whole.data).values


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_ticks_are_round_and_inside(low: float, span: float) -> None:
    found = ticks(low, low + span)
    assert 2 <= len(found) <= 11
    assert all(low - 1e-6 * span <= value <= low + span * (1 + 1e-6) for value in found)
    steps = np.diff(found)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
    leading = steps[0] / 10 ** np.floor(np.log10(steps[0]) + 1e-9)
    assert min(abs(leading - k) for k in (1, 2, 5, 10)) < 1e-5


def test_ticks_of_decades() -> None:
    assert log_ticks(1.0, 100.0) == pytest.approx([1, 2, 5, 10, 20, 50, 100])
    assert log_ticks(1e-9, 1.0) == pytest.approx([1e-9, 1e-7, 1e-5, 1e-3, 1e-1])
    assert [written(v) for v in (0.0, -0.05, 1e-9, 250.0)] == ["0", "\u22120.05", "1e-9", "250"]


def test_places_on_axes() -> None:
    assert Axis(0.0, 2.0).place(0.5) == 250.0
    assert Axis(1.0, 100.0, log=True).place(10.0) == pytest.approx(500.0)
    assert Axis(1.0, 100.0, log=True).place(-1.0) is None
    chart = Chart("t", "x", "y", [line("a", [0, 4], [3, 5], band=([1, 1], [90, 90]))], top=10.0)
    x, y = axes_of(chart)
    assert (x.low, x.high) == (0.0, 4.0) and y.high == 10.0
    bare = axes_of(Chart("t", "x", "y", []))
    assert all(axis.high > axis.low for axis in bare)


def marks(svg: str, look: str) -> list[np.ndarray]:
    """Places (n, 2) of every path of a look."""
    found = re.findall(
        rf'<path class="{look}[^"]*"[^>]*? d="([^"]+)"', svg.split('class="plot"')[1]
    )
    return [np.array(re.findall(r"([\d.-]+) ([\d.-]+)", d), dtype=float) for d in found]


def test_every_value_is_drawn_in_its_place() -> None:
    """y from 0 to 10 upwards, x from 0 to 4: a band, a curve with a gap and an end, dots."""
    curve = line(
        "a", [0, 1, 2, 4], [0, 5, np.nan, 10], band=([0, 4, 4, 9], [1, 6, 6, 10]), ends=True
    )
    chart = Chart(
        "T", "x", "y", [curve, dots("b", [2.0], [5.0], colour=1)], from_zero=True, top=10.0
    )
    svg = chart_svg(chart)
    x, y = axes_of(chart)
    (way,) = marks(svg, "line")
    np.testing.assert_allclose(way[:, 0], [x.place(v) for v in (0, 1, 4)], atol=0.01)
    np.testing.assert_allclose(way[:, 1], [1000 - y.place(v) for v in (0, 5, 10)], atol=0.01)
    assert "L" in svg and svg.count("M0 ") >= 1
    end, spot = marks(svg, "dot")
    np.testing.assert_allclose(end, way[-1:], atol=0.01)
    np.testing.assert_allclose(spot, [[x.place(2.0), 500.0]], atol=0.01)
    (band,) = marks(svg, "band")
    assert len(band) == 8  # there and back
    assert svg.count('class="entry"') == 2 and 'aria-label="T"' in svg


def test_many_points_are_thinned() -> None:
    many = dots("a", np.arange(5 * MOST_POINTS), np.arange(5 * MOST_POINTS))
    assert len(many.x) == MOST_POINTS and many.x[1] == 5.0
    places = np.random.default_rng(1).random((3 * MOST_PLACES, 2))
    value = places[:, 0]
    found = maps_of("m", "p", ["1"], [places], [("d", "mm", [value], [value], [value])],
                    ("x", "y"), "Words.", "")  # fmt: skip
    assert found.counts == [MOST_PLACES] and found.caption.endswith("one in 3 is shown.")


def test_maps_of_a_row_share_their_colours() -> None:
    """Measured and modelled; what is left has its own, about zero."""
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    one, two = np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0])
    found = maps_of("m", "p", ["1"], [places], [("d", "mm", [one], [two], [two - one])],
                    ("x", "y"), "", "")  # fmt: skip
    measured, modelled, left = found.panels
    assert row_ends(found, measured, 0) == row_ends(found, modelled, 0) == pytest.approx((0, 4))
    assert row_ends(found, left, 0) == pytest.approx((-2, 2))
    assert classes(np.array([-2.0, 0.0, 2.0, np.nan]), -2, 2).tolist() == [0, 6, CLASSES - 1, -1]
    svg = map_svg(found, left, 0)
    assert svg.count("h0") == 3 and svg.count("<rect") == CLASSES
    assert re.findall(r'class="end"[^>]*>([^<]*)<', svg) == ["2", "0", "\u22122"]


def test_a_surface_from_the_front_and_from_above() -> None:
    """Right is right, up is up; what is nearer comes later."""
    points = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    flat, near = seen(points, 0.0, 0.0)
    np.testing.assert_allclose(flat, [[1, 0], [0, 0], [0, 1]], atol=1e-12)
    np.testing.assert_allclose(near, [0, -1, 0], atol=1e-12)
    flat, near = seen(points, 0.0, 90.0)
    np.testing.assert_allclose(flat, [[1, 0], [0, 1], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(near, [0, 0, 1], atol=1e-12)
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 1], [2, 1, 1]]], float)
    faces = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    shade = Shade("s", "mm", pack([[1.0, np.nan]]))
    svg = solid_svg(Solid("n", ["1"], "p", pack(corners), pack(faces), [shade], "c"), 0)
    assert svg.count("Z") == 2 and 'fill="#999"' in svg


def test_three_charts_in_a_row_keep_the_size_of_letters() -> None:
    """Narrower in the same unit; legend and plot keep within."""
    series = [line(f"a name that is long, {k}", [0, 1], [0, k]) for k in range(4)]
    chart = Chart("t", "x", "y", series)
    for beside, width in ((1, WIDTH), (2, WIDTH), (3, NARROW), (6, NARROW)):
        svg = chart_svg(chart, beside)
        assert svg.startswith(f'<svg class="chart" viewBox="0 0 {width:g} ')
        assert f'width="{width - LEFT - RIGHT:g}"' in svg
        starts = re.findall(r'class="entry" transform="translate\(([\d.]+) ', svg)
        assert len(starts) == 4 and all(float(start) < 0.6 * width for start in starts)


def test_few_dots_alone_are_large() -> None:
    def drawn(count: int, *more: Series) -> str:
        return chart_svg(Chart("", "x", "y", [dots("", range(count), range(count)), *more]))

    assert 'class="chart few"' in drawn(FEW)
    assert 'class="chart"' in drawn(FEW + 1)
    assert 'class="chart"' in drawn(3, line("", [0, 1], [0, 1]))


#: As wide as a digit of 12 px is in the widest of the usual fonts.
DIGIT = 7.7


def test_numbers_of_a_colour_bar_have_room() -> None:
    """The longest there are, "-7.43e-11", beside a map and beside a surface."""
    words = re.findall(r'x="16"[^>]*>([^<]*)<', scale_bar("about zero", "mm", -7.43e-11, 7.43e-11))
    need = 16 + DIGIT * max(map(len, words))
    assert len(words[-1]) == 9
    assert maps_drawn.RIGHT - 8 >= need and BAR - 8 >= need


def test_a_surface_is_whole_and_clear_of_its_colour_bar() -> None:
    """However it is turned, from straight above, too."""
    turn = np.linspace(0, 2 * np.pi, 25)
    rim = np.column_stack([100 * np.cos(turn), 100 * np.sin(turn), 0 * turn])[None]
    assert CENTRE[0] + scale_of(rim) * 100 <= solids_drawn.WIDTH - BAR
    assert CENTRE[0] >= scale_of(rim) * 100
    assert CENTRE[1] >= scale_of(rim) * 100
    # And as large as that allows.
    assert scale_of(rim) * 100 > 0.9 * min(CENTRE)
