"""Sizes of pages, and whether a browser complains of them: bench_pages.py FOLDER [FOLDER ...]"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bubblefit.reports.html import PAGE
from bubblefit.reports.pdf import find_browser

FIGURES = "figure img, svg.chart, svg.map, svg.solid"


def complaints(page: Path) -> tuple[str, str]:
    """Number of figures that are seen, and of complaints; "-" without a browser."""
    if find_browser() is None:
        return "-", "-"
    from tests.browser import browser

    with tempfile.TemporaryDirectory() as home, browser(Path(home)) as one:
        one.open(page)
        seen = one.run(
            f"[...document.querySelectorAll({FIGURES!r})]"
            ".filter(own => own.getBoundingClientRect().height > 0).length"
        )
        return str(seen), str(len(one.complaints))


def main(folders: list[str]) -> None:
    """Print a row a folder."""
    print("| page | report.html, kB | figures | complaints |\n|---|---|---|---|")
    for name in folders:
        page = Path(name) / PAGE
        row = (name, f"{page.stat().st_size / 1024:.0f}", *complaints(page))
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main(sys.argv[1:])
