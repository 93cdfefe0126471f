"""A page in a browser, alone in a folder and without a network: everything there, and it moves."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from bubblefit.reports.html import write_report
from bubblefit.reports.pdf import print_page

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
        "[...document.querySelectorAll('figure img, svg.chart, svg.map, svg.solid')]"
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
    spots = "document.querySelector('.spots').innerHTML.match(/h0/g).length"
    assert opened.run(spots) == len(PLACES)
    # The largest dz of the load shown, at the middle: measured is modelled and a tenth more.
    ends = "[...document.querySelector('svg.map').querySelectorAll('.end')].map(e => e.textContent)"
    assert opened.run(ends) == ["2.1", "1.05", "0"]


def test_the_surface_turns(opened: Browser) -> None:
    faces = "document.querySelector('.faces').innerHTML"
    opened.run("document.querySelector('svg.solid').focus(), 1")
    before, places = opened.look("svg.solid"), opened.run(faces)
    opened.press("svg.solid", "ArrowLeft")
    assert opened.look("svg.solid") != before and opened.run(faces) != places
    opened.press("svg.solid", "0")
    assert opened.run(faces) == places


def test_a_chart_tells_its_values_and_zooms(opened: Browser) -> None:
    plot, said = "document.querySelector('.plot')", "document.querySelector('.charts output')"
    opened.press("svg.chart", "ArrowRight")
    words = opened.run(f"{said}.textContent")
    assert words == "best <1>: strain 0; MPa 300 (250 to 350)"
    whole = opened.run("document.querySelector('.axes').textContent")
    opened.press("svg.chart", "+")
    assert opened.run(f"{plot}.getAttribute('viewBox')").split()[2:] == ["500", "500"]
    assert opened.run("document.querySelector('.axes').textContent") != whole
    opened.press("svg.chart", "0")
    assert opened.run(f"{plot}.getAttribute('viewBox')") == "0 0 1000 1000"
    assert opened.run("document.querySelector('.axes').textContent") == whole


def test_saved_files(opened: Browser) -> None:
    """What a click would save: caught before it leaves the page."""
    opened.run(
        "window.kept = []; URL.createObjectURL = (blob) => { kept.push(blob); return 'data:,'; };"
        "HTMLAnchorElement.prototype.click = function () { kept.push(this.download); }; 1"
    )
    opened.run(
        "[...document.querySelectorAll('.charts .tools button')]"
        ".filter(b => ['CSV', 'SVG'].includes(b.textContent)).forEach(b => b.click()), 1"
    )
    names = opened.run("kept.filter(one => typeof one === 'string')")
    assert names == ["moduli-E1.svg", "moduli-E1.csv"]
    texts = opened.call(
        "Runtime.evaluate", awaitPromise=True, returnByValue=True,
        expression="Promise.all(kept.filter(one => one instanceof Blob).map(b => b.text()))",
    )["result"]["value"]  # fmt: skip
    assert texts[0].startswith("<svg") and "var(" not in texts[0] and "strain" in texts[0]
    rows = texts[1].splitlines()
    assert rows[0] == "series,strain,MPa,lower,upper" and rows[1] == "best <1>,0,300,250,350"


def test_dark_is_dark_and_a_phone_is_wide_enough(opened: Browser) -> None:
    paper = "getComputedStyle(document.body).backgroundColor"
    line = "getComputedStyle(document.querySelector('.line')).stroke"
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
        "[...document.querySelectorAll('figure img, svg.chart, svg.map, svg.solid, table')]"
        ".filter(own => own.getBoundingClientRect().height === 0).length"
    )
    buttons = opened.run("document.querySelector('.tools').getBoundingClientRect().height")
    opened.call("Emulation.setEmulatedMedia", media="")
    assert (hidden, buttons) == (0, 0)


def test_a_pdf(page: Path, tmp_path: Path) -> None:
    needs.program(*BROWSERS, package="chromium")
    path = print_page(page, tmp_path / "report.pdf")
    assert path.read_bytes().startswith(b"%PDF") and path.stat().st_size > 10_000
