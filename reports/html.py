"""Make the page: report.html, one file with everything inside, and report.pdf by a browser."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import fields
from datetime import date
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import Any

from jinja2 import FileSystemLoader
from markupsafe import Markup
from PIL import Image, UnidentifiedImageError

from ..errors import OutputError
from ..storage.folders import TEMPLATES
from ..storage.templates import template_environment
from ..storage.writing import replacing, write_text
from ..wording import percent
from . import converter, maps, vega
from .charts import Charts
from .content import Report, Table, round_trip, write_page_data

PAGE = "report.html"
#: In the order in which they are read.
SCRIPTS = ("tools", "charts", "maps", "solids", "start")


def write_report(folder: Path | str, report: Report) -> Path:
    """Write page.json and report.html, made of it and the folder's pictures; raises OutputError."""
    folder = Path(folder)
    (folder / PAGE).unlink(missing_ok=True) if folder.is_dir() else None
    write_page_data(folder, report)
    return write_page(folder, round_trip(report))


def write_page(folder: Path, report: Report, path: Path | None = None) -> Path:
    """Write only the page.

    Parameters
    ----------
    folder : Path
        Where its pictures are.
    report : Report
        Its content.
    path : Path, optional
        The file; report.html of the folder if omitted.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    path = folder / PAGE if path is None else path
    html = template_environment(FileSystemLoader(TEMPLATES / "report"), escapes_html=True)
    html.filters |= {
        "number": number,
        "percent": percent,
        "chart_views": chart_views,
        "drawn": vega.figure,
        "map_views": maps.map_views,
        "maps_data": maps.maps_data,
        "as_script": as_script,
        "solid_view": maps.solid_view,
        "solid_data": maps.solid_data,
        "data_link": data_link,
        "data_uri": lambda file: data_uri(folder, file),
        "folds": folds,
        "long": long,
        "tied": lambda text: TIED.sub("\u00a0", text),
    }
    style = (TEMPLATES / "report" / "page.css").read_text(encoding="utf-8") + vega.dark_style()
    moving = any(part.part in ("charts", "maps") for part in report.parts)
    script = "".join(
        (TEMPLATES / "report" / "scripts" / f"{name}.js").read_text(encoding="utf-8")
        for name in SCRIPTS
    )
    script = f'"use strict";\n{{\n{script}}}\n'
    library = converter.library() if moving else ""
    context: dict[str, Any] = {f.name: getattr(report, f.name) for f in fields(report)}
    context |= {
        "style": _trusted(style),
        "script": _trusted(script),
        "library": _trusted(library),
        "today": date.today(),
        "policy": policy(style, script, library),
    }
    write_text(path, html.get_template("report.html.j2").render(context))
    return path


def chart_views(part: Charts) -> list[dict[str, Any]]:
    """Return Vega's specification of every chart of a figure."""
    width = vega.NARROW if len(part.charts) >= vega.NARROW_COLUMNS else vega.WIDE
    return [vega.view(chart, width) for chart in part.charts]


def policy(style: str, *scripts: str) -> str:
    """Return what the page may do: run these scripts, look as this style says, show itself."""
    allowed: Mapping[str, str] = {
        "default-src": "'none'",
        "script-src": " ".join(_hash(script) for script in scripts if script),
        "style-src": _hash(style),
        "img-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{name} {value}" for name, value in allowed.items())


def _hash(text: str) -> str:
    """Return a script, or a style, as a policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _trusted(text: str) -> Markup:
    """Return text that stands in the page as it is."""
    return Markup(text)  # noqa: S704 - style and scripts are part of the product


def as_script(content: Any) -> Markup:
    """Return JSON that ends no script element, whatever it holds."""
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    safe = text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
    return Markup(safe)  # noqa: S704 - the three letters that matter in HTML are escaped


def data_link(text: str) -> str:
    """Return a link whose target is the text itself."""
    return "data:application/octet-stream;base64," + base64.b64encode(text.encode()).decode()


def data_uri(folder: Path, file: str, *, max_width: int = 1600, colours: int = 128) -> str:
    """Return a PNG of the folder as a link; "" where there is none within it.

    Parameters
    ----------
    folder : Path
        Of the page.
    file : str
        Below the folder.
    max_width : int
        Pixels to which a wider picture is shrunk.
    colours : int
        Colours that are kept: enough for the shades, a third of the bytes.
    """
    path = (folder / file).resolve()
    if not path.is_relative_to(folder.resolve()):
        return ""
    try:
        with Image.open(path, formats=["PNG"]) as picture:
            small = picture.convert("RGB")
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError):
        return ""
    if small.width > max_width:
        small = small.resize((max_width, round(small.height * max_width / small.width)))
    stream = BytesIO()
    small.quantize(colours, dither=Image.Dither.NONE).save(stream, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def number(value: object) -> str:
    """Return four significant digits of floats; text, counts and missing values as expected."""
    if value is None:
        return "–"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.4g}" if isfinite(value) else "–"


#: A space between a number and its unit.
TIED = re.compile(r"(?<=\d) (?=(?:%|[kMG]?Pa|mm|k?N|kN/m|N/mm|degrees|times)\b|%)")
#: Letters of a cell that stay on one line.
MAX_UNBROKEN = 26


def long(value: object) -> bool:
    """Return whether a cell may be broken between its words."""
    return len(number(value)) > MAX_UNBROKEN


def folds(table: Table, max_width: int = 96) -> list[list[int]]:
    """Return the columns of a table in rows that are narrow enough, each with those that name it.

    Columns that name a row are the first and those of words right after it.

    Parameters
    ----------
    table : Table
        The table.
    max_width : int
        Letters of a row that paper and screen hold.
    """
    count = len(table.header)
    names = next((k for k in range(1, count) if k not in table.text), count)
    widths = [_column_width(table, k) for k in range(count)]
    if sum(widths) <= max_width or 2 * sum(widths[:names]) > max_width:
        return [list(range(count))]
    parts: list[list[int]] = [[]]
    for k in range(names, count):
        if parts[-1] and sum(widths[j] for j in (*range(names), *parts[-1], k)) > max_width:
            parts.append([])
        parts[-1].append(k)
    return [[*range(names), *part] for part in parts]


def _column_width(table: Table, column: int) -> int:
    """Return the letters that a column needs, where long cells are broken between their words."""
    words = str(table.header[column]).split()
    for row in table.rows:
        text = number(row[column])
        words += text.split() if long(text) else [text]
    return max((min(len(word), MAX_UNBROKEN) for word in words), default=0) + 2


#: Programs that print pages, in the order in which they are looked for.
BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
)


def find_browser() -> str | None:
    """Return the path of a browser, None where there is none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def browser_command(browser: str, home: Path) -> list[str]:
    """Return how every call of a browser begins: no window, no network, a home of its own."""
    # As root, as in a container, it starts only without its sandbox; the page is our own.
    bare = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    return [
        browser,
        "--headless=new",
        "--disable-gpu",
        *bare,
        f"--user-data-dir={home}",
        # A container's shared memory may be too small for a page.
        "--disable-dev-shm-usage",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        "--virtual-time-budget=10000",  # milliseconds for the page's script
    ]


def print_page(page: Path, path: Path, *, timeout: float = 180.0) -> Path:
    """Print a page on A4 as PDF.

    Parameters
    ----------
    page : Path
        The page.
    path : Path
        The PDF.
    timeout : float, s
        Time that a browser may take.

    Returns
    -------
    Path
        The PDF.

    Raises
    ------
    OutputError
        There is no browser, it fails, or the file cannot be written.
    """
    browser = find_browser()
    if browser is None:
        problem = f"needs a browser to print with, and there is none of {', '.join(BROWSERS)}"
        raise OutputError(f"{path}: {problem}; install chromium, or print {page} from any browser")
    with replacing(path) as temporary, tempfile.TemporaryDirectory() as home:
        command = browser_command(browser, Path(home))
        command += ["--no-pdf-header-footer", f"--print-to-pdf={temporary.resolve()}"]
        try:
            process = subprocess.run(
                [*command, page.resolve().as_uri()], capture_output=True, timeout=timeout
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise OutputError(f"{path}: {browser} failed: {error}") from None
        if process.returncode or not temporary.exists():
            last = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
            raise OutputError(f"{path}: {browser} printed nothing: {' '.join(last)}")
    return path
