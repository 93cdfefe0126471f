"""A page in a browser, alone in a folder and without a network: everything there, and it moves."""

import re
import shutil
from dataclasses import replace

import pytest
from bubblefit.reports.charts import Chart, Charts, line
from bubblefit.reports.content import Listing, PageSection, Report, Table, Words
from bubblefit.reports.html import print_page, write_report
from bubblefit.reports.maps import maps_of, warp_arrow

from ..builders.pages import PLACES, drawn, full_report
from ..support import needs
from ..support.browser import BROWSERS, browser

TICKS = (
    "[...document.querySelectorAll('.charts .view')[0].querySelectorAll('.role-axis text')]"
    ".map(own => own.textContent).sort().join(' ')"
)


SAID = "document.querySelector('.charts output').textContent"


#: What a click would save is caught before it leaves the page.
CATCH = (
    "window.kept = []; URL.createObjectURL = (blob) => { kept.push(blob); return 'data:,'; };"
    "HTMLAnchorElement.prototype.click = function () { kept.push(this.download); };"
    "[...document.querySelectorAll('.charts .tools button')]"
    ".filter(b => ['CSV', 'SVG'].includes(b.textContent)).forEach(b => b.click()),"
    "new Promise(f => setTimeout(f, 500))"
)


TEXTS = "Promise.all(kept.filter(one => one instanceof Blob).map(b => b.text()))"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    drawn(folder)
    alone = tmp_path_factory.mktemp("alone") / "mailed.html"
    return shutil.copy(write_report(folder, full_report()), alone)


@pytest.fixture(scope="module")
def opened(page, tmp_path_factory):
    with browser(tmp_path_factory.mktemp("home")) as one:
        one.open(page)
        yield one


@pytest.fixture(autouse=True)
def no_complaint(opened):
    yield
    assert opened.complaints == []
    urls = [url.partition(":")[0] for url in opened.requests]
    assert set(urls) <= {"file", "data", "blob"} and urls.count("file") == 1


def test_every_figure_is_shown(opened):
    sizes = opened.run(
        "[...document.querySelectorAll('figure img, svg.chart, svg.solid')]"
        ".map(own => [own.getBoundingClientRect().width, own.getBoundingClientRect().height])"
    )
    assert len(sizes) == 1 + 1 + 3 + 1 and all(min(size) > 50 for size in sizes)
    assert opened.run("document.querySelector('img').naturalWidth") > 0
    assert opened.run("document.querySelectorAll('.faces path').length") == 4
    opened.call("Emulation.setEmulatedMedia", media="print")
    hidden = opened.run(
        "[...document.querySelectorAll('figure img, svg.chart, svg.solid, table')]"
        ".filter(own => own.getBoundingClientRect().height === 0).length"
    )
    buttons = opened.run("document.querySelector('.tools').getBoundingClientRect().height")
    opened.call("Emulation.setEmulatedMedia", media="")
    assert (hidden, buttons) == (0, 0)
    paper = "getComputedStyle(document.body).backgroundColor"
    line = "getComputedStyle(document.querySelector('.mark-line path')).stroke"
    light = opened.run(paper), opened.run(line)
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    opened.call("Emulation.setEmulatedMedia", features=dark)
    assert light[0] == "rgb(255, 255, 255)"
    assert opened.run(paper) == "rgb(22, 25, 29)" and opened.run(line) != light[1]
    opened.call("Emulation.setEmulatedMedia", features=[])
    phone = {"width": 360, "height": 700, "deviceScaleFactor": 1, "mobile": True}
    opened.call("Emulation.setDeviceMetricsOverride", **phone)
    assert opened.run("document.documentElement.scrollWidth") <= 360
    opened.call("Emulation.clearDeviceMetricsOverride")


def test_slider_changes_the_maps(opened):
    before, label = opened.look("figure.maps"), ".maps .slider output"
    assert opened.run(f"document.querySelector('{label}').textContent") == "59 kPa"
    opened.press(".maps input", "Home")
    assert opened.run(f"document.querySelector('{label}').textContent") == "22 kPa"
    assert opened.look("figure.maps") != before
    spots = "document.querySelector('.maps .view').querySelectorAll('.mark-symbol path').length"
    assert opened.run(spots) >= len(PLACES)
    # The largest dz of the load shown, at the middle: measured is modelled and a tenth more.
    opened.press(".maps svg", "ArrowRight")
    said = opened.run("document.querySelector('.maps .tools output').textContent")
    assert said == "x −1; y −1; dz, measured 0.1 mm"
    faces = "document.querySelector('.faces').innerHTML"
    opened.run("document.querySelector('svg.solid').focus(), 1")
    before, places = opened.look("svg.solid"), opened.run(faces)
    opened.press("svg.solid", "ArrowLeft")
    assert opened.look("svg.solid") != before and opened.run(faces) != places
    opened.press("svg.solid", "0")
    assert opened.run(faces) == places


def test_chart_shows_its_values_and_zooms(opened):
    opened.press(".charts svg", "ArrowRight")
    assert opened.run(SAID) == "best <1>: strain 0; MPa 300 (250 to 350)"
    tip = "(({hidden, textContent}) => hidden || textContent)(document.querySelector('.tip'))"
    assert opened.run(tip) == opened.run(SAID)  # beside the pointer, too
    whole = opened.run(TICKS)
    opened.press(".charts svg", "+")
    assert opened.run(TICKS) != whole
    opened.press(".charts svg", "0")
    assert opened.run(TICKS) == whole and opened.run(SAID) == ""
    opened.run("document.querySelector('.charts svg').scrollIntoView(), 1")
    x, y, wide, tall = opened.box(".charts svg")
    for kind, at in (("Moved", 0.5), ("Pressed", 0.4), ("Moved", 0.6), ("Released", 0.6)):
        place = {"x": x + at * wide, "y": y + at * tall}
        opened.call("Input.dispatchMouseEvent", type=f"mouse{kind}", button="left", clickCount=1,
                    **place)  # fmt: skip
        if at == 0.5:
            near = ("best <1>: strain 0.05; MPa 250", "measured: strain 0.05; MPa 245")
            assert opened.run(SAID).startswith(near)
    assert opened.run(TICKS) != whole
    opened.press(".charts svg", "0")
    assert opened.run(TICKS) == whole
    opened.wait(CATCH)
    names = opened.run("kept.filter(one => typeof one === 'string')")
    assert sorted(names) == ["moduli-E1.csv", "moduli-E1.svg"]
    table, drawing = sorted(opened.wait(TEXTS), key=lambda text: text.startswith("<svg"))
    assert drawing.startswith("<svg") and "var(" not in drawing and "strain" in drawing
    rows = table.splitlines()
    assert rows[0] == "series,strain,MPa,lower,upper" and rows[1] == "best <1>,0,300,250,350"


BROKEN = """[...document.querySelectorAll('td:not(.long)')].filter((cell) => {
  const range = document.createRange();
  range.selectNodeContents(cell);
  return new Set([...range.getClientRects()].map((own) => Math.round(own.top))).size > 1;
}).length"""


#: By how much tables are wider than their place, how many are, and the height of their bars.
BEYOND = """[...document.querySelectorAll('.scroll')].map((own) =>
  [own.scrollWidth - own.clientWidth,
   parseFloat(getComputedStyle(own, '::-webkit-scrollbar').height),
   getComputedStyle(own).overflowX])"""


#: Pixels of A4 between its margins.
PAPER = 672


def test_tables_keep_their_columns_and_numbers_do_not_break(opened, tmp_path):
    value = "91.9\u00a0(30.3\u00a0to\u00a0418)"
    sides = [
        Table(f"modulus {k}", ["strain", "MPa", "kN/m"], [["5 %", value, value]] * 6, side=True)
        for k in range(3)
    ]
    names = [f"beta_{k}" for k in range(14)]
    wide = Table("Sure", ["unknown", "value", *names], [[n, *[-0.99] * 15] for n in names],
                 closed=True)  # fmt: skip
    words = Table("Notes", ["test", "note"], [["150 mm, 140 kPa", "a note of words " * 20]])
    sections = [
        PageSection("The answer", sides),
        PageSection("Trust", [Words(["mind"], True, True), words]),
        PageSection("How", [wide]),
    ]
    about = [("date", "2026-11-23"), ("fabric", "F, 0.8 mm"), ("laboratory", "L")]
    opened.requests.clear()
    opened.open(write_report(tmp_path, Report("T", "Usable.", sections=sections, about=about)))
    order = opened.run(
        "[...document.querySelectorAll('h1, dt, .summary, .contents a, h2')]"
        ".map(own => own.textContent)"
    )
    titles = ["The answer", "Trust", "How"]
    assert order == ["T", "date", "fabric", "laboratory", "Usable.", *titles, *titles]
    assert opened.run("document.querySelector('details').open") is False
    opened.run("document.querySelector('details').open = true")
    for width, fits in ((1280, True), (390, False)):
        size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 500}
        opened.call("Emulation.setDeviceMetricsOverride", **size)
        tables = opened.run(BEYOND)
        assert len(tables) == 3 + 1 + 2 and opened.run(BROKEN) == 0
        assert opened.run("document.documentElement.scrollWidth") <= width
        assert all(over <= 0 for over, *_ in (tables if fits else tables[:4]))
        assert all(bar >= 8 and how == "auto" for _, bar, how in tables)
    opened.run("document.querySelector('details').open = false")
    size = {"width": PAPER, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
    opened.call("Emulation.setDeviceMetricsOverride", **size)
    opened.call("Emulation.setEmulatedMedia", media="print")
    right = opened.run(
        "[...document.querySelectorAll('table')].filter(own => own.checkVisibility())"
        ".map(own => own.getBoundingClientRect().right)"
    )
    broken = opened.run(BROKEN)
    opened.call("Emulation.setEmulatedMedia", media="")
    opened.call("Emulation.clearDeviceMetricsOverride")
    assert broken == 0 and len(right) == 6
    assert max(right) <= PAPER


def test_surface_of_bubble_marks_its_warp(opened, tmp_path):
    whole = full_report()
    solid = whole.sections[1].parts[1]
    solid = replace(solid, warp=warp_arrow(solid.points.values))
    opened.requests.clear()
    opened.open(write_report(tmp_path, Report("T", sections=[PageSection("Fields", [solid])])))
    at = "document.querySelector('.warp path').getAttribute('d')"
    assert opened.run("document.querySelector('.warp text').textContent") == "warp"
    first = opened.run(at)
    opened.press("svg.solid", "ArrowLeft")
    assert opened.run(at) != first
    opened.press("svg.solid", "0")
    assert opened.run(at) == first
    x, y, wide, tall = opened.box("svg.solid")
    for _ in range(2):
        for part in (".warp path", ".faces", ".scale"):
            left, top, across, up = opened.box(part)
            assert x < left and left + across < x + wide and y < top and top + up < y + tall
        opened.press("svg.solid", "ArrowRight")


#: By how much labels of maps go beyond their picture, pixels.
CUT = """Math.max(...[...document.querySelectorAll('.maps svg')].flatMap((own) => {
  const edge = own.getBoundingClientRect().right;
  return [...own.querySelectorAll('text')].map((t) => t.getBoundingClientRect().right - edge);
}))"""


def test_longer_labels_of_another_load_are_not_cut(tmp_path):
    heights = [scale * (2.0 - (PLACES**2).sum(axis=1)) for scale in (1.23e4, 2.0)]
    rows = [("dz", "mm", heights, heights, [0.1 * h for h in heights])]
    maps = maps_of("b", "pressure", ["1 kPa", "9 kPa"], [PLACES] * 2, rows, ("x", "y"), "M", "m")
    path = write_report(tmp_path, Report("Maps", sections=[PageSection("Both", [maps])]))
    with browser(tmp_path / "home") as phone:
        size = {"width": 390, "height": 700, "deviceScaleFactor": 1, "mobile": True}
        phone.call("Emulation.setDeviceMetricsOverride", **size)
        phone.open(path)
        assert phone.run(CUT) <= 0
        phone.press(".maps input", "Home")
        assert phone.run("document.querySelector('.maps output').textContent") == "1 kPa"
        phone.wait("new Promise(f => setTimeout(f, 300))")
        assert phone.run(CUT) <= 0


def test_page_is_printed_as_pdf(page, tmp_path):
    needs.program(*BROWSERS, package="chromium")
    path = print_page(page, tmp_path / "report.pdf")
    assert path.read_bytes().startswith(b"%PDF") and path.stat().st_size > 10_000


def test_printed_pages_are_filled(tmp_path):
    """Six charts are two rows, and a long listing begins below them: two pages."""
    needs.program(*BROWSERS, package="chromium")
    charts = [Chart(f"E{k}", "strain", "MPa", [line("", [0, 1], [0, k])]) for k in range(1, 7)]
    words = Listing("\n".join(f"line {k}" for k in range(50)))
    page = Report("Filled", sections=[PageSection("Both", [Charts("both", charts, ""), words])])
    path = print_page(write_report(tmp_path, page), tmp_path / "report.pdf")
    assert len(re.findall(rb"/Type\s*/Page\b", path.read_bytes())) == 2
