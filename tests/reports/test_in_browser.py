"""A page in a browser, alone in a folder and without a network: everything there, and it moves."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from bubblefit.reports.content import Report, Section
from bubblefit.reports.html import print_page, write_report
from bubblefit.reports.studies import plan_charts

from .. import needs
from ..browser import BROWSERS, Browser, browser
from .test_html import PLACES, drawn, full_report


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with a part of every sort, alone in a folder."""
    folder = tmp_path_factory.mktemp("written")
    drawn(folder)
    alone = tmp_path_factory.mktemp("alone") / "mailed.html"
    return Path(shutil.copy(write_report(folder, full_report()), alone))


@pytest.fixture(scope="module")
def opened(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("home")) as one:
        one.open(page)
        yield one


@pytest.fixture(autouse=True)
def no_complaint(opened: Browser) -> Iterator[None]:
    """Nothing is complained of, and nothing asked for but the file itself."""
    yield
    assert opened.complaints == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in opened.requests)
    assert sum(url.startswith("file:") for url in opened.requests) == 1


def test_every_figure_is_there(opened: Browser) -> None:
    sizes = opened.run(
        "[...document.querySelectorAll('figure img, svg.chart, svg.solid')]"
        ".map(own => [own.getBoundingClientRect().width, own.getBoundingClientRect().height])"
    )
    assert len(sizes) == 1 + 1 + 3 + 1 and all(min(size) > 50 for size in sizes)
    assert opened.run("document.querySelector('img').naturalWidth") > 0
    assert opened.run("document.querySelectorAll('.faces path').length") == 4


def test_the_slider_changes_the_maps(opened: Browser) -> None:
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


def test_the_surface_turns(opened: Browser) -> None:
    faces = "document.querySelector('.faces').innerHTML"
    opened.run("document.querySelector('svg.solid').focus(), 1")
    before, places = opened.look("svg.solid"), opened.run(faces)
    opened.press("svg.solid", "ArrowLeft")
    assert opened.look("svg.solid") != before and opened.run(faces) != places
    opened.press("svg.solid", "0")
    assert opened.run(faces) == places


def test_a_chart_tells_its_values_and_zooms(opened: Browser) -> None:
    said = "document.querySelector('.charts output').textContent"
    axes = TICKS
    opened.press(".charts svg", "ArrowRight")
    assert opened.run(said) == "best <1>: strain 0; MPa 300 (250 to 350)"
    whole = opened.run(axes)
    opened.press(".charts svg", "+")
    assert opened.run(axes) != whole
    opened.press(".charts svg", "0")
    assert opened.run(axes) == whole and opened.run(said) == ""


def test_the_value_under_the_mouse_and_a_part_dragged(opened: Browser) -> None:
    axes = TICKS
    opened.run("document.querySelector('.charts svg').scrollIntoView(), 1")
    box = opened.run(
        "(({x, y, width, height}) => [x, y, width, height])"
        "(document.querySelector('.charts svg').getBoundingClientRect())"
    )
    x, y, wide, tall = box
    whole = opened.run(axes)

    def mouse(kind: str, a: float, b: float) -> None:
        place = {"x": x + a * wide, "y": y + b * tall}
        opened.call("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **place)

    mouse("mouseMoved", 0.5, 0.5)
    said = opened.run("document.querySelector('.charts output').textContent")
    assert said.startswith(("best <1>: strain 0.05; MPa 250", "measured: strain 0.05; MPa 245"))
    mouse("mousePressed", 0.4, 0.4)
    mouse("mouseMoved", 0.6, 0.6)
    mouse("mouseReleased", 0.6, 0.6)
    assert opened.run(axes) != whole
    opened.press(".charts svg", "0")
    assert opened.run(axes) == whole


def test_saved_files(opened: Browser) -> None:
    """What a click would save: caught before it leaves the page."""
    opened.run(
        "window.kept = []; URL.createObjectURL = (blob) => { kept.push(blob); return 'data:,'; };"
        "HTMLAnchorElement.prototype.click = function () { kept.push(this.download); }; 1"
    )
    opened.call(
        "Runtime.evaluate", awaitPromise=True,
        expression="[...document.querySelectorAll('.charts .tools button')]"
        ".filter(b => ['CSV', 'SVG'].includes(b.textContent)).forEach(b => b.click()),"
        "new Promise(f => setTimeout(f, 500))",
    )  # fmt: skip
    names = opened.run("kept.filter(one => typeof one === 'string')")
    assert sorted(names) == ["moduli-E1.csv", "moduli-E1.svg"]
    texts = opened.call(
        "Runtime.evaluate", awaitPromise=True, returnByValue=True,
        expression="Promise.all(kept.filter(one => one instanceof Blob).map(b => b.text()))",
    )["result"]["value"]  # fmt: skip
    table, drawing = sorted(texts, key=lambda text: text.startswith("<svg"))
    assert drawing.startswith("<svg") and "var(" not in drawing and "strain" in drawing
    rows = table.splitlines()
    assert rows[0] == "series,strain,MPa,lower,upper" and rows[1] == "best <1>,0,300,250,350"


def test_dark_is_dark_and_a_phone_is_wide_enough(opened: Browser) -> None:
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


def test_on_paper_nothing_is_left_out(opened: Browser) -> None:
    opened.call("Emulation.setEmulatedMedia", media="print")
    hidden = opened.run(
        "[...document.querySelectorAll('figure img, svg.chart, svg.solid, table')]"
        ".filter(own => own.getBoundingClientRect().height === 0).length"
    )
    buttons = opened.run("document.querySelector('.tools').getBoundingClientRect().height")
    opened.call("Emulation.setEmulatedMedia", media="")
    assert (hidden, buttons) == (0, 0)


def test_a_pdf(page: Path, tmp_path: Path) -> None:
    needs.program(*BROWSERS, package="chromium")
    path = print_page(page, tmp_path / "report.pdf")
    assert path.read_bytes().startswith(b"%PDF") and path.stat().st_size > 10_000


#: Words of the axes of the first chart, in the order of the alphabet.
TICKS = (
    "[...document.querySelectorAll('.charts .view')[0].querySelectorAll('.role-axis text')]"
    ".map(own => own.textContent).sort().join(' ')"
)
NAMES = ["none", "one & a name that is far too long", "three", "four", "five", "six"]


def test_names_in_place_of_numbers(tmp_path: Path) -> None:
    charts = plan_charts(NAMES, {"E1": [1.0, 2, 3, 4, 5, 6]}, "Which next")
    page = write_report(tmp_path, Report("Plan", sections=[Section("Next", [charts])]))
    axes = TICKS
    with browser(tmp_path / "home") as opened:
        opened.open(page)
        whole = opened.run(axes)
        assert all(name[:14] in whole for name in NAMES)
        for _ in range(2):
            opened.press(".charts svg", "ArrowRight")
        said = opened.run("document.querySelector('.charts output').textContent")
        assert said == f"E1: test {NAMES[1]}; 1 σ, % of the modulus 2"
        opened.press(".charts svg", "+")
        closer = opened.run(axes)
        assert NAMES[1] in closer and "six" not in closer
        opened.press(".charts svg", "0")
        assert opened.run(axes) == whole
        opened.run(
            "URL.createObjectURL = (blob) => { window.kept = blob; return 'data:,'; };"
            "HTMLAnchorElement.prototype.click = () => {};"
            "[...document.querySelectorAll('.tools button')].at(-1).click(), 1"
        )
        saved = opened.call(
            "Runtime.evaluate", awaitPromise=True, returnByValue=True, expression="kept.text()"
        )  # fmt: skip
        assert saved["result"]["value"].splitlines()[2] == f"E1,{NAMES[1]},2,,"
        assert opened.complaints == []
