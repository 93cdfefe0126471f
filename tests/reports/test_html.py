"""The page as one file of HTML: everything inside, pictures, wide tables, numbers."""

import base64
import hashlib
import os
import re
from html.parser import HTMLParser
from io import BytesIO

import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.reports.content import PageSection, Picture, Report, Table
from bubblefit.reports.html import data_uri, folds, number, percent, write_page, write_report
from bubblefit.storage.writing import replacing
from PIL import Image

from ..builders.pages import drawn
from ..support.refusals import raised


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


def test_page_holds_everything_it_shows(full, tmp_path):
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


@pytest.mark.parametrize(("size", "shrunk"), [((30, 20), (30, 20)), ((60, 30), (40, 20))])
def test_wide_picture_is_shrunk_in_proportion(tmp_path, size, shrunk):
    Image.new("RGB", size, "red").save(tmp_path / "a.png")
    head, data = data_uri(tmp_path, "a.png", max_width=40).split(",")
    assert head == "data:image/png;base64"
    with Image.open(BytesIO(base64.b64decode(data))) as picture:
        assert picture.size == shrunk and picture.convert("RGB").getpixel((9, 9)) == (255, 0, 0)


def test_missing_picture_is_named(tmp_path):
    (tmp_path / "out").mkdir()
    names = ["lost.png", "../figures/sorted optima.png", str(drawn(tmp_path))]
    report = Report("x", sections=[PageSection("s", [Picture(n, "Fig") for n in names])])
    page = write_report(tmp_path / "out", report).read_text()
    assert "<img" not in page
    assert page.count("is not in the folder") == 3


@pytest.mark.parametrize(
    ("columns", "text", "parts"),
    [
        (8, (), [[0, 1, 2, 3, 4, 5, 6, 7]]),
        (24, (), [[0, *range(1, 10)], [0, *range(10, 19)], [0, *range(19, 24)]]),
        # Columns of words right after the first name a row too; others do not.
        (24, (1, 9), [[0, 1, *range(2, 10)], [0, 1, *range(10, 18)], [0, 1, *range(18, 24)]]),
    ],
)
def test_wide_table_is_folded_and_keeps_every_column(columns, text, parts):
    rows = [[f"row {k}", *[-0.12345] * (columns - 1)] for k in range(2)]  # 7 letters a number
    assert folds(Table("t", ["name", *["c"] * (columns - 1)], rows, text=text)) == parts
    assert folds(Table("t", ["name", "said"], [["a", "words " * 99]], text=(1,))) == [[0, 1]]


def test_numbers_of_page_have_four_digits(tmp_path):
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


def test_every_printed_page_has_its_number_and_all_but_the_first_the_title(tmp_path):
    text = write_report(tmp_path, Report('Ti"t}le</style>')).read_text()
    assert 'counter(page) " / " counter(pages)' in text
    assert '@page { @top-left { content: "Ti t le /style "; } }' in text
    assert '@page :first { @top-left { content: ""; } }' in text


def test_letterhead_stands_above_the_title(tmp_path):
    Image.new("RGB", (40, 10), "red").save(tmp_path / "logo.png")
    report = Report("T", about=[("laboratory", "Lab <7>")])
    page = write_page(tmp_path, report, tmp_path / "p.html", tmp_path / "logo.png").read_text()
    head = page.partition("<h1>")[0]
    assert "data:image/png;base64," in head and "<span>Lab &lt;7&gt;</span>" in head
    assert "letterhead" not in write_page(tmp_path, report).read_text().partition("<body>")[2]
    (tmp_path / "no.png").write_text("no picture")
    error = raised(
        InputError, "PNG or JPEG", write_page, tmp_path, report, None, tmp_path / "no.png"
    )
    assert error.field == "letterhead"
