"""A chart over names in a browser: they are told, looked into and saved."""

from __future__ import annotations

from pathlib import Path

from bubblefit.reports.content import Report, Section
from bubblefit.reports.html import write_report
from bubblefit.reports.named_charts import plan_charts

from ..browser import browser

NAMES = ["none", "one & a name that is far too long", "three", "four", "five", "six"]


def test_names_in_place_of_numbers(tmp_path: Path) -> None:
    charts = plan_charts(NAMES, {"E1": [1.0, 2, 3, 4, 5, 6]}, "Which next")
    page = write_report(tmp_path, Report("Plan", sections=[Section("Next", [charts])]))
    axes = "document.querySelector('.axes').textContent"
    with browser(tmp_path / "home") as opened:
        opened.open(page)
        whole = opened.run(axes)
        assert all(name in whole for name in NAMES)
        for _ in range(2):
            opened.press("svg.chart", "ArrowRight")
        said = opened.run("document.querySelector('.charts output').textContent")
        assert said == f"E1: test {NAMES[1]}; 1 σ, % of the modulus 2"
        opened.press("svg.chart", "+")
        closer = opened.run(axes)
        assert NAMES[1] in closer and "six" not in closer
        opened.press("svg.chart", "0")
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
