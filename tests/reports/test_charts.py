"""Charts, maps and surfaces as data, and what Vega is given of them: every value in its place."""

from __future__ import annotations

import multiprocessing
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bubblefit.reports import maps as maps_drawn
from bubblefit.reports import vega
from bubblefit.reports.charts import (
    MOST_POINTS,
    Chart,
    Charts,
    axis_ends,
    band,
    dots,
    ends_of,
    faces,
    line,
    looks_of,
    scale_ends,
    shades_of,
    spans_a_decade,
)
from bubblefit.reports.maps import (
    BAR,
    CENTRE,
    CLASSES,
    MOST_PLACES,
    Packed,
    Shade,
    Solid,
    classes,
    map_chart,
    maps_of,
    pack,
    row_ends,
    scale_bar,
    scale_of,
    seen,
    solid_svg,
)
from bubblefit.reports.vega import (
    COLOURS,
    DARK,
    PALETTE,
    RISING,
    dark_style,
    figure,
    panel,
    save,
    view,
)
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from ..figure_checks import check_charts

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


def test_ends_of_the_axes() -> None:
    chart = Chart("t", "x", "y", [line("a", [0, 4], [0, 5], band=([1, 1], [90, 90]))], top=10.0)
    assert axis_ends(chart) == ((0.0, 4.0), (0.0, 10.0))
    bare = axis_ends(Chart("t", "x", "y", []))
    assert all(high > low for low, high in bare)
    log = axis_ends(Chart("t", "x", "y", [line("", [1, 10], [-1, 100])], log_x=True, log_y=True))
    assert log[0] == (1.0, 10.0) and 0 < log[1][0] < 100 < log[1][1]
    names = axis_ends(Chart("t", "x", "y", [dots("", [1, 2], [1, 2])], x_names=("a", "b")))
    assert names[0] == (0.5, 2.5)
    part = Chart("t", "x", "y", [line("", [0, 9], [0, 9])], x_range=(1, 2), y_range=(3, 4))
    assert axis_ends(part) == ((1, 2), (3, 4))


@pytest.mark.parametrize(
    ("values", "wanted"),
    [([1.0, 10.0], False), ([1.0, 10.1], True), ([0.0, 50.0], False), ([-1.0, 50.0], False),
     ([np.nan, 1.0, np.inf, 11.0], True), ([np.nan], False), ([], False), ([[1.0], [11.0]], True)],
)  # fmt: skip
def test_more_than_a_decade(values: list[float], wanted: bool) -> None:
    assert spans_a_decade(values) is wanted


@pytest.mark.parametrize(
    ("strain", "shades", "ends"),
    [([-0.05, 1.0], "from least", (-0.05, 1.0)), ([-0.06, 1.0], "about zero", (-1.0, 1.0)),
     ([-1.0, 0.06], "about zero", (-1.0, 1.0)), ([-1.0, 0.05], "from least", (-1.0, 0.05)),
     ([0.0, 0.0], "from least", (0.0, 1.0)), ([np.nan, 0.2], "from least", (0.2, 1.2))],
)  # fmt: skip
def test_colours_of_values(strain: list[float], shades: str, ends: tuple[float, float]) -> None:
    assert shades_of(strain) == shades
    assert ends_of(np.array(strain), shades_of(strain)) == pytest.approx(ends)


def test_every_value_is_given_to_vega() -> None:
    """A band, a curve with a gap and an end, dots with error bars: each a mark of its data."""
    curve = line(
        "a", [0, 1, 2, 4], [0, 5, np.nan, 10], band=([0, 4, 4, 9], [1, 6, 6, 10]), ends=True
    )
    spots = dots("b", [2.0], [5.0], ([4.0], [6.5]), colour=1)
    spec = panel(Chart("T", "x, mm", "y, N", [curve, spots], level=3.0, log_y=True))
    assert spec["data"][0]["values"] == [
        {"x": [0, 1, 2, 4], "y": [0, 5, None, 10], "lower": [0, 4, 4, 9], "upper": [1, 6, 6, 10]}
    ]
    kinds = [mark["type"] for mark in spec["marks"]]
    assert kinds == ["rule", "area", "rule", "line", "symbol", "symbol"]
    assert spec["marks"][3]["encode"]["update"]["defined"]["signal"].endswith("datum.y > 0")
    colours = [mark["encode"]["update"].get("stroke", {}).get("value") for mark in spec["marks"]]
    assert colours[2:4] == [PALETTE[1], PALETTE[0]]
    assert [scale["type"] for scale in spec["scales"][:2]] == ["linear", "log"]
    assert [axis["title"] for axis in spec["axes"]] == ["x, mm", "y, N"]
    legend = {scale["name"]: scale for scale in spec["scales"]}["legend-shape"]
    assert (legend["domain"], legend["range"]) == (["a", "b"], ["stroke", "circle"])


def test_one_legend_of_all_charts_where_names_have_one_look() -> None:
    first = Chart("1", "x, mm", "y, N", [line("a", [0, 1], [0, 1]), band("b", [0], [0], [1])])
    other = Chart("2", "x, mm", "y, N", [line("a", [0, 1], [0, 1], colour=2)])
    assert list(looks_of([first, first]) or ()) == ["a", "b"]
    assert looks_of([first, other]) is None


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_files(tmp_path: Path, suffix: str) -> None:
    corners = np.array([[[0, 0], [1, 0], [1, 1], [0, 1]], [[1, 0], [2, 0], [2, 1], [1, 1]]])
    shape = Chart("s", "x, mm", "y, mm", [faces("", corners, [1, 2])], equal=True, scale="N")
    names = Chart("", "test", "E1, %", [dots("a", [1, 2], [3, 4])], x_names=("one & <two>", "b"))
    charts = Charts("c", [shape, names, Chart("", "", "", [])], "")
    check_charts(charts)
    content = save(tmp_path / f"c{suffix}", charts).read_bytes()
    starts = {".png": b"\x89PNG", ".svg": b"<svg", ".pdf": b"%PDF"}
    assert content.startswith(starts[suffix]) and len(content) > 2000
    if suffix == ".png":
        with Image.open(tmp_path / "c.png") as picture:
            assert picture.width > 1000 and len(picture.convert("RGB").getcolors(1 << 20)) > 4
    if suffix == ".svg":
        text = content.decode()
        # Two squares, true to scale, in the colours of the least and the largest value.
        assert text.count(f'fill="{COLOURS["from least"][0]}"') >= 1
        assert "one &amp; &lt;two&gt;" in text
    with pytest.raises(ValueError, match="nothing to draw"):
        save(tmp_path / "none.png", Charts("c", [], ""))
    with pytest.raises(ValueError, match=r"expected \.png"):
        save(tmp_path / "c.bmp", charts)


def test_a_drawing_true_to_scale() -> None:
    chart = Chart("", "x, mm", "y, mm", [line("", [0, 100], [0, 25])], equal=True)
    width, height = (signal["value"] for signal in panel(chart)["signals"][:2])
    (x0, x1), (y0, y1) = axis_ends(chart)
    assert width / (x1 - x0) == pytest.approx(height / (y1 - y0), rel=1e-3)


def test_the_figure_of_the_page() -> None:
    """Named parts have names of their own; words are escaped."""
    chart = Chart("<t>", "x, mm", "y, N", [line("<a>", [0, 1], [0, 1]), line("b", [0, 1], [1, 1])])
    other = replace(chart, title="other")
    one, two = figure(view(chart)), figure(view(other))
    assert one.startswith('<svg class="chart" viewBox="0 0 ') and 'aria-label="&lt;t&gt;"' in one
    assert "&lt;a&gt;" in one and "<a>" not in one
    names = [set(re.findall(r'id="([^"]+)"', text)) for text in (one, two)]
    assert names[0] and not names[0] & names[1]


@pytest.mark.parametrize("bad", ["\x00", "\x1b", "\x01", "\ud800", "\uffff"])
def test_characters_that_no_drawing_may_hold(tmp_path: Path, bad: str) -> None:
    """They would end the process."""
    words = f"a{bad}b"
    series = [line(words, [0, 1], [0, 1]), line("b", [0, 1], [1, 0])]
    chart = Chart(words, words, words, series, words, x_names=(words,), scale=words)
    assert "a\ufffdb" in figure(view(chart))
    assert save(tmp_path / "c.png", Charts(words, [chart, chart], words)).stat().st_size > 1000


def test_a_dark_screen_has_a_colour_for_each() -> None:
    style = dark_style()
    for light in (*PALETTE, *RISING):
        assert f'svg [stroke="{light}"]' in style and DARK[light] != light


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
    chart = map_chart(found, left, 0)
    (spots,) = chart.series
    np.testing.assert_allclose(np.transpose([spots.x, spots.y]), places, atol=1e-4)
    assert spots.values == pytest.approx([0, 1, 2], abs=1e-4)
    assert scale_ends(chart) == pytest.approx((-2, 2)) and chart.scale == "mm" and chart.equal


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
    quads = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    shade = Shade("s", "mm", pack([[1.0, np.nan]]))
    svg = solid_svg(Solid("n", ["1"], "p", pack(corners), pack(quads), [shade], "c"), 0)
    assert svg.count("Z") == 2 and 'fill="#999"' in svg


#: As wide as a digit of 12 px is in the widest of the usual fonts.
DIGIT = 7.7


def test_numbers_of_a_colour_bar_have_room() -> None:
    """The longest there are, "-7.43e-11", beside a surface."""
    words = re.findall(r'x="16"[^>]*>([^<]*)<', scale_bar("about zero", "mm", -7.43e-11, 7.43e-11))
    assert len(words[-1]) == 9 and BAR - 8 >= 16 + DIGIT * max(map(len, words))


def test_a_surface_is_whole_and_clear_of_its_colour_bar() -> None:
    """However it is turned, from straight above, too."""
    turn = np.linspace(0, 2 * np.pi, 25)
    rim = np.column_stack([100 * np.cos(turn), 100 * np.sin(turn), 0 * turn])[None]
    assert CENTRE[0] + scale_of(rim) * 100 <= maps_drawn.WIDTH - BAR
    assert min(CENTRE) >= scale_of(rim) * 100
    # And as large as that allows.
    assert scale_of(rim) * 100 > 0.9 * min(CENTRE)


def drawn_in_a_fork(charts: Charts, pipe: Any) -> None:
    pipe.send(vega.rendered(charts, ".svg"))


def test_a_forked_process_draws_too() -> None:
    """The thread that draws is not copied by a fork: a call in the copy would wait for ever."""
    charts = Charts(
        "c", [Chart("t", "x, mm", "y, mm", [line("a", [0, 1], [0, 1])], "a line")], "a line"
    )
    own = vega.rendered(charts, ".svg")
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    child = context.Process(target=drawn_in_a_fork, args=(charts, there))
    child.start()
    try:
        assert here.poll(60) and here.recv() == own
    finally:
        child.kill()
        child.join()
