"""Charts as Vega draws them: every value, files, figures of the page, hostile characters."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.reports import charts as declared
from bubblefit.reports import vega
from bubblefit.reports.charts import Chart, Charts, axis_ends, dots, faces, line
from bubblefit.reports.html import chart_views
from bubblefit.reports.vega import figure, panel, save, view
from PIL import Image

from ..support.charts import check_charts
from ..support.refusals import raised


def test_every_value_is_given_to_vega():
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
    assert colours[2:4] == [vega.PALETTE[1], vega.PALETTE[0]]
    assert [scale["type"] for scale in spec["scales"][:2]] == ["linear", "log"]
    assert [axis["title"] for axis in spec["axes"]] == ["x, mm", "y, N"]
    legend = {scale["name"]: scale for scale in spec["scales"]}["legend-shape"]
    assert (legend["domain"], legend["range"]) == (["a", "b"], ["stroke", "circle"])


def test_lines_are_solid_unless_they_say_so():
    series = [
        line("a", [0, 1], [0, 1]),
        *(line(f"{n}", [0, 1], [0, 1], dashes=n) for n in range(9)),
    ]
    spec = panel(Chart("", "x", "y", series))
    drawn = [mark["encode"]["update"]["strokeDash"]["value"] for mark in spec["marks"]]
    assert drawn[:2] == [[], []] and drawn[1:5] == drawn[5:9] == list(vega.DASHES)
    legend = {scale["name"]: scale for scale in spec["scales"]}["legend-strokeDash"]
    assert legend["range"] == drawn


@pytest.mark.parametrize(("letters", "columns"), [(1, 9), (10, 4), (20, 2), (50, 1), (80, 1)])
def test_columns_of_a_legend_fit_in_the_width_of_the_chart(letters, columns):
    """A letter takes 6.2 pixels, the sample beside a name 34, in a chart of 386."""
    series = [line(name * letters, [0, 1], [0, 1]) for name in "abc"]
    (legend,) = panel(Chart("", "x", "y", series), 386)["legends"]
    assert legend["columns"] == columns and legend["labelLimit"] == 352


def test_charts_are_saved_by_suffix_and_refused_otherwise(tmp_path):
    corners = np.array([[[0, 0], [1, 0], [1, 1], [0, 1]], [[1, 0], [2, 0], [2, 1], [1, 1]]])
    shape = Chart("s", "x, mm", "y, mm", [faces(corners, [1, 2])], equal=True, scale="N")
    names = Chart("", "test", "E1, %", [dots("a", [1, 2], [3, 4])], y_names=("one & <two>", "b"))
    charts = Charts("c", [shape, names, Chart("", "", "", [])], "")
    check_charts(charts)
    for suffix, start in ((".png", b"\x89PNG"), (".svg", b"<svg"), (".pdf", b"%PDF")):
        content = save(tmp_path / f"c{suffix}", charts).read_bytes()
        assert content.startswith(start) and len(content) > 2000
    with Image.open(tmp_path / "c.png") as picture:
        assert picture.width > 1000 and len(picture.convert("RGB").getcolors(1 << 20)) > 4
    text = (tmp_path / "c.svg").read_text()
    assert text.count(f'fill="{vega.COLOURS["from least"][0]}"') >= 1
    assert "one &amp; &lt;two&gt;" in text
    for file, own, words in (("none.png", Charts("c", [], ""), "nothing to draw"),
                             ("c.bmp", charts, r"ends in \.png")):  # fmt: skip
        raised((ValueError, InputError), words, save, tmp_path / file, own)


def test_figure_of_page_is_the_view_of_the_chart():
    chart = Chart("<t>", "x, mm", "y, N", [line("<a>", [0, 1], [0, 1]), line("b", [0, 1], [1, 1])])
    one, two = figure(view(chart)), figure(view(replace(chart, title="other")))
    assert one.startswith('<svg class="chart" viewBox="0 0 ') and 'aria-label="&lt;t&gt;"' in one
    assert "&lt;a&gt;" in one and "<a>" not in one
    names = [set(re.findall(r'id="([^"]+)"', text)) for text in (one, two)]
    assert names[0] and not names[0] & names[1]
    style = vega.dark_style()
    for light in (*vega.PALETTE, *vega.RISING):
        assert f'svg [stroke="{light}"]' in style and vega.DARK[light] != light
    series = [line("a", [0, 1], [0, 1]), declared.band("b", [0], [0], [1])]
    first = Chart("1", "x, mm", "y, N", series)
    other = replace(first, series=[line("a", [0, 1], [0, 1], colour=2)])
    assert list(declared.looks_of([first, first]) or ()) == ["a", "b"]
    assert declared.looks_of([first, other]) is None


def test_control_characters_are_removed_from_drawings(tmp_path):
    for bad in ("\x00", "\x1b", "\x01", "\ud800", "\uffff"):
        words = f"a{bad}b"
        series = [line(words, [0, 1], [0, 1]), line("b", [0, 1], [1, 0])]
        chart = Chart(words, words, words, series, words, y_names=(words,), scale=words)
        assert "a\ufffdb" in figure(view(chart))
        assert save(tmp_path / "c.svg", Charts(words, [chart, chart], words)).stat().st_size > 1000


def test_names_from_the_top_down_all_have_their_label():
    names = tuple(f"test {k}" for k in range(1, 20))
    rows = Chart("", "1 sigma, %", "", [dots("E1", range(1, 20), range(1, 20))], y_names=names)
    assert axis_ends(rows)[1] == (19.5, 0.5)
    drawn = str(figure(view(rows)))
    assert all(f">{name}</text>" in drawn for name in names)


def test_long_names_have_room_for_a_wider_font():
    """Names end at the axis: what lies left of it holds each letter at 6 pixels."""
    names = ("7. bubble, elliptic rim at 45 degrees", "b")
    rows = Chart("", "1 sigma, %", "test", [dots("E1", [1, 2], [1, 2])], y_names=names)
    drawn = str(figure(view(rows)))
    left = float(re.search(r"translate\(([\d.]+),", drawn)[1])
    assert left > 6 * len(names[0]) and ">test</text>" not in drawn


def test_far_ticks_of_a_logarithmic_axis_are_powers_of_ten():
    curve = Chart("", "x", "y", [line("a", [1, 2, 3], [1e-10, 1e-4, 1e2])], log_y=True)
    labels = re.findall(">([^<]*)</text>", str(figure(view(curve))))
    assert labels[-4:] == ["10⁻¹⁰", "10⁻⁵", "1", "y"]


def test_charts_of_a_row_have_one_height():
    short = Chart("short", "x", "y", [line("a", [1, 2], [1, 2])])
    long = Chart("a title of two lines " * 4, "x", "y", [line(c, [1, 2], [1, 2]) for c in "abcdef"])
    views = chart_views(Charts("row", [short, long], ""))
    boxes = {re.search('viewBox="([^"]*)"', str(figure(spec)))[1] for spec in views}
    assert len(boxes) == 1
