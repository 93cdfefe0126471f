"""The page as text: everything shown, escaped, in one file, made again from its data; VTU files."""

import base64
import hashlib
import json
import os
import re
from html.parser import HTMLParser

import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.files import replacing
from bubblefit.meshes.mesh import Mesh
from bubblefit.reports import content
from bubblefit.reports.charts import Chart, Charts, dots, line
from bubblefit.reports.content import Picture, Report, Section, Table, read_page_data, round_trip
from bubblefit.reports.html import folds, number, percent, write_page, write_report
from bubblefit.reports.maps import Shade, Solid, maps_of, pack, write_vtu
from PIL import Image

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
    shade = Shade("height", "mm", pack([h[QUADS].mean(axis=1) for h in HEIGHTS]))
    solid = Solid("dome", LOADS, "pressure", pack(points), pack(QUADS), [shade], "Dome", "a dome")
    return Report(
        "Test <1> & more", "Good.", [("objective e", 3.1234567e-12), ("method", "lm")],
        ["beta_0 <is> on its bound"],
        [
            Section("Curves", [
                Charts("moduli", [chart], "Tangent moduli"),
                Picture("figures/sorted optima.png", "Optima"),
            ]),
            Section("Fields", [maps, solid]),
            Section("Nothing", []),
            Section("Tables", [Table("Surfaces", ["kPa", "R²"], [[22, 0.99971]], "Table 4.1")]),
            Section("More", [
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
    text = (full / "report.html").read_text(encoding="utf-8")
    rules = re.search(r'Security-Policy" content="(.*?)"', text)
    allowed = dict(rule.split(" ", 1) for rule in rules[1].replace("&#39;", "'").split("; "))
    assert allowed["default-src"] == "'none'" and allowed["img-src"] == "data:"
    for tag, rule, count in (("script", "script-src", 2), ("style", "style-src", 1)):
        every = re.findall(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL)
        hashes = [hashlib.sha256(own.encode()).digest() for own in every]
        digests = {f"'sha256-{base64.b64encode(own).decode()}'" for own in hashes}
        assert set(allowed[rule].split()) == digests and len(every) == count
    page = (full / "report.html").read_text(encoding="utf-8")
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
    outside = drawn(tmp_path)
    names = ["lost.png", "../figures/sorted optima.png", str(outside)]
    report = Report("x", sections=[Section("s", [Picture(n, "Fig") for n in names])])
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
    with pytest.raises(InputError, match=re.escape(said)):
        read_page_data(tmp_path)
    with pytest.raises(InputError, match=r"page\.json.*cannot be read"):
        read_page_data(tmp_path / "none")


def test_data_are_strict_json(full, tmp_path):
    chart = Chart("a", "x", "y", [line("b", [0, 1, np.nan], [np.inf, 2, 3])])
    table = Table("t", ["a"], [[np.float64("nan")], [np.int64(3)]])
    report = Report("x", sections=[Section("s", [Charts("c", [chart], ""), table])])
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
    with pytest.raises(OutputError, match=r"page\.json: cannot be written"):
        write_report(path, Report(title="x"))
