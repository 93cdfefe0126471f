"""Charts, maps and surfaces as Vega is given them; the page as text, escaped, in one file."""

import base64
import hashlib
import json
import multiprocessing
import os
import re
from dataclasses import replace
from html.parser import HTMLParser

import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.meshes.mesh import Mesh
from bubblefit.reports import charts as declared
from bubblefit.reports import content, maps, vega
from bubblefit.reports.charts import Chart, Charts, axis_ends, dots, faces, line, scale_ends
from bubblefit.reports.content import (
    PageSection,
    Picture,
    Report,
    Table,
    read_page_data,
    round_trip,
)
from bubblefit.reports.html import folds, number, percent, write_page, write_report
from bubblefit.reports.maps import Panel, Solid, maps_of, pack, write_vtu
from bubblefit.reports.vega import figure, panel, save, view
from bubblefit.storage.writing import replacing
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from ..support.charts import check_charts
from ..support.refusals import raised

FINITE = st.floats(-1e6, 1e6)


@given(arrays(float, st.integers(1, 40), elements=FINITE | st.just(np.nan)))
def test_packed_numbers_come_back(values):
    packed = pack(values)
    back = packed.values
    np.testing.assert_array_equal(np.isnan(back), np.isnan(values))
    np.testing.assert_allclose(back, values, atol=0.5001 * packed.step, rtol=1e-9)
    for shape in ((len(values) - 1,), (len(values) + 1,), (len(values), 2)):
        with pytest.raises(ValueError, match="expected"):
            _ = replace(packed, shape=shape).values


def test_ends_of_the_axes():
    def chart(series, **look):
        return axis_ends(Chart("t", "x", "y", series, **look))

    banded = line("a", [0, 4], [0, 5], band=([1, 1], [90, 90]))
    assert chart([banded], top=10.0) == ((0, 4), (0, 10))
    assert all(high > low for low, high in chart([]))
    log = chart([line("", [1, 10], [-1, 100])], log_x=True, log_y=True)
    assert log[0] == (1.0, 10.0) and 0 < log[1][0] < 100 < log[1][1]
    assert chart([dots("", [1, 2], [1, 2])], x_names=("a", "b"))[0] == (0.5, 2.5)
    part = chart([line("", [0, 9], [0, 9])], x_range=(1, 2), y_range=(3, 4))
    assert part == ((1, 2), (3, 4))
    title = "E1, along the warp: best: at most 1.2e-08 % of the modulus that is known"
    lines = panel(Chart(title, "x", "y", [banded]), vega.NARROW)["title"]["text"]
    assert " ".join(lines) == title and len(lines) == 2  # whole, and not cut by dots
    assert max(map(len, lines)) * vega.TITLE_LETTER_WIDTH <= vega.NARROW + 40
    flat = Chart("", "x, mm", "y, mm", [line("", [0, 100], [0, 25])], equal=True)
    width, height = (signal["value"] for signal in panel(flat)["signals"][:2])
    (x0, x1), (y0, y1) = axis_ends(flat)
    assert width / (x1 - x0) == pytest.approx(height / (y1 - y0), rel=1e-3)


@pytest.mark.parametrize(
    ("values", "wanted"),
    [([1.0, 10.0], False), ([1.0, 10.1], True), ([0.0, 50.0], False), ([-1.0, 50.0], False),
     ([np.nan, 1.0, np.inf, 11.0], True), ([np.nan], False), ([], False), ([[1.0], [11.0]], True)],
)  # fmt: skip
def test_more_than_a_decade(values, wanted):
    assert declared.spans_a_decade(values) is wanted


@pytest.mark.parametrize(
    ("strain", "shades", "ends"),
    [([-0.05, 1.0], "from least", (-0.05, 1.0)), ([-0.06, 1.0], "about zero", (-1.0, 1.0)),
     ([-1.0, 0.06], "about zero", (-1.0, 1.0)), ([-1.0, 0.05], "from least", (-1.0, 0.05)),
     ([0.0, 0.0], "from least", (0.0, 1.0)), ([np.nan, 0.2], "from least", (0.2, 1.2))],
)  # fmt: skip
def test_colours_of_values(strain, shades, ends):
    assert declared.shades_of(strain) == shades
    assert declared.ends_of(np.array(strain), shades) == pytest.approx(ends)


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


def test_files(tmp_path):
    corners = np.array([[[0, 0], [1, 0], [1, 1], [0, 1]], [[1, 0], [2, 0], [2, 1], [1, 1]]])
    shape = Chart("s", "x, mm", "y, mm", [faces("", corners, [1, 2])], equal=True, scale="N")
    names = Chart("", "test", "E1, %", [dots("a", [1, 2], [3, 4])], x_names=("one & <two>", "b"))
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


def test_the_figure_of_the_page():
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


def test_characters_that_no_drawing_may_hold(tmp_path):
    for bad in ("\x00", "\x1b", "\x01", "\ud800", "\uffff"):
        words = f"a{bad}b"
        series = [line(words, [0, 1], [0, 1]), line("b", [0, 1], [1, 0])]
        chart = Chart(words, words, words, series, words, x_names=(words,), scale=words)
        assert "a\ufffdb" in figure(view(chart))
        assert save(tmp_path / "c.svg", Charts(words, [chart, chart], words)).stat().st_size > 1000


def maps_at(places, one, two):
    rows = [("d", "mm", [one], [two], [two - one])]
    return maps.maps_of("m", "p", ["1"], [places], rows, ("x", "y"), "Words.", "")


def test_maps_of_a_row_share_their_colours():
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = maps_at(places, np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0]))
    for own, ends in zip(found.panels, ((0, 4), (0, 4), (-2, 2)), strict=True):
        assert maps.row_ends(found, own, 0) == pytest.approx(ends)
    # Of rounding alone no map is red or blue: the ends are a millionth of the largest value.
    even = np.array([0.0, 20.0, 40.0])
    found = maps_at(places, even, even + np.array([0.0, 1e-11, -3e-11]))
    low, high = maps.row_ends(found, found.panels[2], 0)
    assert (low, high) == pytest.approx((-4e-5, 4e-5), rel=1e-3)
    rows = [("d", "mm", [even], [even], [0 * even])]
    known = maps.maps_of("m", "p", ["1"], [places], rows, ("x", "y"), "", "", "known")
    assert [p.name for p in known.panels] == ["d, known", "d, modelled", "d, modelled − known"]
    found = maps_at(places, np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0]))
    chart = maps.map_chart(found, found.panels[2], 0)
    (spots,) = chart.series
    np.testing.assert_allclose(np.transpose([spots.x, spots.y]), places, atol=1e-4)
    assert spots.values == pytest.approx([0, 1, 2], abs=1e-4)
    assert scale_ends(chart) == pytest.approx((-2, 2)) and chart.scale == "mm" and chart.equal
    every = np.arange(5 * declared.MAX_POINTS)
    many = dots("a", every, every)
    assert len(many.x) == declared.MAX_POINTS and many.x[1] == 5.0
    places = np.random.default_rng(1).random((3 * maps.MAX_PLACES, 2))
    found = maps_at(places, places[:, 0], places[:, 0])
    assert found.counts == [maps.MAX_PLACES] and found.caption.endswith("one in 3 is shown.")


def test_a_surface_from_the_front_and_from_above():
    points = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for height, places, nearness in ((0.0, [[1, 0], [0, 0], [0, 1]], [0, -1, 0]),
                                     (90.0, [[1, 0], [0, 1], [0, 0]], [0, 0, 1])):  # fmt: skip
        flat, near = maps.project(points, 0.0, height)
        np.testing.assert_allclose(flat, places, atol=1e-12)
        np.testing.assert_allclose(near, nearness, atol=1e-12)
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 1], [2, 1, 1]]], float)
    quads = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    shade = maps.Panel("s", "mm", pack([[1.0, np.nan]]))
    own = maps.Solid("n", ["1"], "p", pack(corners), pack(quads), [shade], "c")
    svg = figure(maps.solid_view(own))
    assert svg.count('fill="#999"') == 1 and svg.count('stroke="#440154"') == 1


def test_a_forked_process_draws_too():
    """The thread that draws is not copied by a fork: a call in the copy would wait for ever."""
    chart = Chart("t", "x, mm", "y, mm", [line("a", [0, 1], [0, 1])], "a line")
    charts = Charts("c", [chart], "a line")
    own = vega.rendered(charts, ".svg")
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    child = context.Process(target=lambda: there.send(vega.rendered(charts, ".svg")))
    child.start()
    try:
        assert here.poll(60) and here.recv() == own
    finally:
        child.kill()
        child.join()


PLACES = np.array([(x, y) for y in (-1.0, 0.0, 1.0) for x in (-1.0, 0.0, 1.0)])
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
HEIGHTS = [k * (2.0 - (PLACES**2).sum(axis=1)) for k in (1.0, 2.0)]
LOADS = ["22 kPa", "59 kPa"]


def full_report():
    x = np.linspace(0.0, 0.1, 5)
    best = line("best <1>", x, 300 - 1000 * x, band=(250 - 1000 * x, 350 - 1000 * x), ends=True)
    measured = dots("measured", x, 290 - 900 * x, colour=1)
    chart = Chart("E1", "strain", "MPa", [best, measured], "it falls")
    rows = [("dz", "mm", [h + 0.1 for h in HEIGHTS], HEIGHTS, [-0.1 * h for h in HEIGHTS])]
    maps = maps_of("bubble", "pressure", LOADS, [PLACES] * 2, rows, ("x", "y"), "Maps", "a dome")
    points = np.array([np.column_stack([PLACES, h]) for h in HEIGHTS])
    shade = Panel("height", "mm", pack([h[QUADS].mean(axis=1) for h in HEIGHTS]))
    solid = Solid("dome", LOADS, "pressure", pack(points), pack(QUADS), [shade], "Dome", "a dome")
    return Report(
        "Test <1> & more", "Good.", [("objective e", 3.1234567e-12), ("method", "lm")],
        ["beta_0 <is> on its bound"],
        [
            PageSection("Curves", [
                Charts("moduli", [chart], "Tangent moduli"),
                Picture("figures/sorted optima.png", "Optima"),
            ]),
            PageSection("Fields", [maps, solid]),
            PageSection("Nothing", []),
            PageSection("Tables", [Table("Surfaces", ["kPa", "R²"], [[22, 0.99971]], "Table 4.1")]),
            PageSection("More", [
                content.Words(["said <so>"]), content.Words(["mind"], marked=True, warning=True),
                content.Facts([("mass", 1.0)], "Weights"), content.Listing("a < b"),
                content.Download("card.toml", "a = 'é'\n", "Save it"),
            ]),
        ],
        [("result.json", "everything")], {"bubblefit": "0.1.0"},
    )  # fmt: skip


class Tags(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.links, self.pictures = [], [], []

    def handle_starttag(self, tag, attrs):
        own = dict(attrs)
        self.links += [v for k, v in attrs if k in ("src", "href", "xlink:href", "srcset")]
        assert "style" not in own and not any(name.startswith("on") for name in own)
        if tag in ("img", "svg"):
            self.pictures.append(own)
        if tag not in ("meta", "img", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def drawn(folder):
    path = folder / "figures" / "sorted optima.png"
    path.parent.mkdir()
    Image.new("RGB", (60, 60), "white").save(path)
    return path


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    folder = tmp_path_factory.mktemp("full")
    drawn(folder)
    return write_report(folder, full_report()).parent


def test_the_page(full, tmp_path):
    for page, pictures in ((full, 6), (write_report(tmp_path, Report(title="Bare")).parent, 0)):
        tags = Tags()
        text = (page / "report.html").read_text(encoding="utf-8")
        tags.feed(text)
        assert tags.open == []
        assert all(link.startswith(("data:", "#")) for link in tags.links)
        outside = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
        assert "@import" not in outside and not re.search(r"url\((?!#)", outside)
        assert len(text) < 5_000_000
        assert all(own.get("alt") or own.get("aria-label") for own in tags.pictures)
        assert len(tags.pictures) == pictures
    page = (full / "report.html").read_text(encoding="utf-8")
    rules = re.search(r'Security-Policy" content="(.*?)"', page)
    allowed = dict(rule.split(" ", 1) for rule in rules[1].replace("&#39;", "'").split("; "))
    assert allowed["default-src"] == "'none'" and allowed["img-src"] == "data:"
    for tag, rule, count in (("script", "script-src", 2), ("style", "style-src", 1)):
        every = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        hashes = [hashlib.sha256(own.encode()).digest() for own in every]
        digests = {f"'sha256-{base64.b64encode(own).decode()}'" for own in hashes}
        assert set(allowed[rule].split()) == digests and len(every) == count
    for text in (
        "Test &lt;1&gt; &amp; more", "3.123e-12", "beta_0 &lt;is&gt;", "0.9997", "Table 4.1",
        "result.json", "bubblefit 0.1.0", "best &lt;1&gt;", "said &lt;so&gt;", "a &lt; b",
        "Weights", 'download="card.toml"', "data:image/png;base64,", "59 kPa", "dz, measured",
        r"best \u003c1\u003e",
    ):  # fmt: skip
        assert text in page, text
    assert ">Nothing<" not in page and "<so>" not in page
    card = re.search(r'href="data:application/octet-stream;base64,(.*?)"', page)
    assert base64.b64decode(card[1]).decode() == "a = 'é'\n"


def test_a_picture_that_is_not_there_is_named(tmp_path):
    (tmp_path / "out").mkdir()
    names = ["lost.png", "../figures/sorted optima.png", str(drawn(tmp_path))]
    report = Report("x", sections=[PageSection("s", [Picture(n, "Fig") for n in names])])
    page = write_report(tmp_path / "out", report).read_text()
    assert "<img" not in page
    assert page.count("is not in the folder") == 3


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "is damaged"), ("[]", "is damaged"), ("{}", "is damaged"),
        ('{"layout": 99, "title": "x"}', "another version's layout: expected 1, got 99"),
        ('{"layout": 1, "title": 3}', "title"),
        ('{"layout": 1, "title": "x", "sections": [{"title": "s", "parts": [{"part": "?"}]}]}',
         "sections.0.parts.0"),
    ],
)  # fmt: skip
def test_data_that_are_no_page(tmp_path, content, said):
    (tmp_path / "page.json").write_text(content)
    raised(InputError, re.escape(said), read_page_data, tmp_path)
    raised(InputError, r"page\.json.*cannot be read", read_page_data, tmp_path / "none")


def test_data_are_strict_json(full, tmp_path):
    chart = Chart("a", "x", "y", [line("b", [0, 1, np.nan], [np.inf, 2, 3])])
    table = Table("t", ["a"], [[np.float64("nan")], [np.int64(3)]])
    report = Report("x", sections=[PageSection("s", [Charts("c", [chart], ""), table])])
    write_report(tmp_path, report)
    content = json.loads((tmp_path / "page.json").read_text(), parse_constant=pytest.fail)
    charts, shown = content["sections"][0]["parts"]
    assert charts["charts"][0]["series"][0]["y"] == [None, 2.0, 3.0]
    assert shown["rows"] == [[None], [3]]
    again = write_page(full, read_page_data(full), tmp_path / "again.html").read_bytes()
    assert again == (full / "report.html").read_bytes()
    assert read_page_data(full) == round_trip(full_report())


@pytest.mark.parametrize(
    ("columns", "text", "parts"),
    [
        (8, (), [[0, 1, 2, 3, 4, 5, 6, 7]]),
        (24, (), [[0, *range(1, 10)], [0, *range(10, 19)], [0, *range(19, 24)]]),
        # Columns of words right after the first name a row too; others do not.
        (24, (1, 9), [[0, 1, *range(2, 10)], [0, 1, *range(10, 18)], [0, 1, *range(18, 24)]]),
    ],
)
def test_a_wide_table_is_folded_and_keeps_every_column(columns, text, parts):
    rows = [[f"row {k}", *[-0.12345] * (columns - 1)] for k in range(2)]  # 7 letters a number
    assert folds(Table("t", ["name", *["c"] * (columns - 1)], rows, text=text)) == parts
    assert folds(Table("t", ["name", "said"], [["a", "words " * 99]], text=(1,))) == [[0, 1]]


def test_vtu_holds_the_deformed_mesh(tmp_path):
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
    mesh = Mesh(points, np.array([[0, 1, 2, 3]]), {"rim": np.arange(4)})
    u = np.arange(12.0).reshape(4, 3)
    path = write_vtu(
        mesh, u, tmp_path / "b.vtu", {"height": u[:, 2]}, {"thickness": np.array([0.81])}
    )
    back = meshio.read(path)
    assert back.points == pytest.approx(mesh.points + u)
    assert back.point_data["displacement"] == pytest.approx(u)
    assert back.point_data["height"] == pytest.approx(u[:, 2])
    assert back.cell_data["thickness"][0] == pytest.approx([0.81])
    with pytest.raises(ValueError, match="height: 3 rows for 4 nodes"):
        write_vtu(mesh, u, path, {"height": np.zeros(3)})


def test_numbers(tmp_path):
    values = (None, float("nan"), float("inf"), 3, "x", True, 0.123456, 12345.6)
    assert " ".join(map(number, values)) == "– – – 3 x True 0.1235 1.235e+04"
    shares = (0.01234, 0.9949, 0.995, 0.996, 1.234, 12.0, 0.1, 0.0)
    said = "1.2 % 99 % 100 % 100 % 123 % 1200 % 10 % 0 %"
    assert " ".join(map(percent, shares)) == said
    path = tmp_path / "result.txt"
    path.write_text("old")
    full = OSError(28, "No space left on device")
    for failure, error in ((RuntimeError(), RuntimeError), (full, OutputError)):
        with pytest.raises(error), replacing(path) as temporary:
            temporary.write_text("half")
            raise failure
        assert path.read_text() == "old" and os.listdir(tmp_path) == ["result.txt"]
    raised(OutputError, r"page\.json: cannot be written", write_report, path, Report(title="x"))
