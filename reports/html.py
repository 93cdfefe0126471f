"""Rendering of a report as report.html, one file with everything inside, or as a PDF."""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import fields
from datetime import date
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import Any
from uuid import uuid4

from markupsafe import Markup
from PIL import UnidentifiedImageError

from ..errors import InputError, OutputError
from ..lazy_modules import Image
from ..storage.templates import template_environment
from ..storage.writing import TEMPLATES, replacing, write_text
from ..wording import percent
from . import converter, maps, vega
from .charts import Charts
from .content import Report, Table, round_trip, write_page_data

PAGE = "report.html"
#: Scripts of the page, without their suffix, in the order in which the browser reads them.
SCRIPTS = ("tools", "charts", "maps", "solids", "start")


def write_report(folder: Path | str, report: Report) -> Path:
    """Write page.json and report.html into an output folder, and return the path of the latter.

    An earlier report.html is removed first. Pictures of the report have to lie in the folder.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    folder = Path(folder)
    if folder.is_dir():
        (folder / PAGE).unlink(missing_ok=True)
    write_page_data(folder, report)
    return write_page(folder, round_trip(report))


def write_page(
    folder: Path,
    report: Report,
    path: Path | None = None,
    letterhead: Path | None = None,
) -> Path:
    """Write a report as an HTML page, without page.json.

    Parameters
    ----------
    folder : Path
        Output folder that the paths of pictures are relative to.
    report : Report
        Content of the page.
    path : Path, optional
        File to write; report.html of the folder if omitted.
    letterhead : Path, optional
        Picture (PNG or JPEG), such as a logo, that stands with the laboratory above the title.

    Returns
    -------
    Path
        File that was written.

    Raises
    ------
    InputError
        The letterhead is no picture.
    OutputError
        The page cannot be written.
    """
    path = folder / PAGE if path is None else path
    with converter.background.during_page():
        write_text(path, _rendered(folder, report, letterhead))
    return path


def _rendered(folder: Path, report: Report, letterhead: Path | None) -> str:
    """Return the text of a page; charts are drawn while the rest of it is rendered."""
    from jinja2 import FileSystemLoader

    drawings: dict[str, Callable[[], Markup]] = {}
    if any(part.part == "picture" for part in report.parts):
        converter.background.wait()  # they lie in the folder
    pictures = {
        part.file: converter.background.begin(data_uri, folder, part.file)
        for part in report.parts
        if part.part == "picture"
    }

    def drawn(spec: vega.Spec) -> Markup:
        """Begin to draw a chart, and return the mark that it replaces later."""
        mark = uuid4().hex
        drawings[mark] = converter.background.begin(vega.figure, spec)
        return _trusted(mark)

    html = template_environment(FileSystemLoader(TEMPLATES / "report"), escapes_html=True)
    html.filters |= {
        "number": number,
        "percent": percent,
        "chart_views": chart_views,
        "drawn": drawn,
        "map_views": maps.map_views,
        "maps_data": maps.maps_data,
        "as_script": as_script,
        "solid_view": maps.solid_view,
        "solid_data": maps.solid_data,
        "data_link": data_link,
        "data_uri": lambda file: pictures[file](),
        "folds": folds,
        "long": long,
        "tied": lambda text: TIED.sub("\u00a0", text),
    }
    style = (TEMPLATES / "report" / "page.css").read_text(encoding="utf-8") + vega.dark_style()
    style += running_title(report.title)
    is_interactive = any(part.part in ("charts", "maps") for part in report.parts)
    script = "".join(
        (TEMPLATES / "report" / "scripts" / f"{name}.js").read_text(encoding="utf-8")
        for name in SCRIPTS
    )
    script = f'"use strict";\n{{\n{script}}}\n'
    library = converter.library() if is_interactive else ""
    context = {f.name: getattr(report, f.name) for f in fields(report)}
    context |= {
        "style": _trusted(style),
        "script": _trusted(script),
        "library": _trusted(library),
        "today": date.today(),
        "letterhead": "" if letterhead is None else letterhead_uri(letterhead),
        "laboratory": dict(report.about).get("laboratory", ""),
        "policy": policy(style, script, library),
    }
    text = html.get_template("report.html.j2").render(context)
    return re.sub("|".join(drawings) or "$^", lambda mark: drawings[mark[0]](), text)


def running_title(title: str) -> str:
    """Return the rule of CSS that puts a title above every printed page but the first."""
    plain = re.sub(r"[^\w ,.;:()/+%=-]", " ", title)
    head = f'@page {{ @top-left {{ content: "{plain}"; }} }}'
    return f'{head} @page :first {{ @top-left {{ content: ""; }} }}\n'


def letterhead_uri(path: Path) -> str:
    """Return a data URL that holds a picture for the head of a page; InputError if it is none."""
    try:
        with Image.open(path, formats=["PNG", "JPEG"]) as picture:
            picture.thumbnail((800, 300))
            stream = BytesIO()
            picture.save(stream, "PNG", optimize=True)
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise InputError(path, "letterhead", f"expected a PNG or JPEG picture: {error}") from None
    return png_uri(stream)


def png_uri(stream: BytesIO) -> str:
    """Return a data URL of a picture, in PNG."""
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def chart_views(part: Charts) -> list[dict[str, Any]]:
    """Return Vega's specification of every chart of a figure."""
    width = vega.NARROW if len(part.charts) >= vega.NARROW_COLUMNS else vega.WIDE
    views = [vega.view(chart, width) for chart in part.charts]
    is_fixed = any(chart.equal or chart.y_names or chart.scale for chart in part.charts)
    return views if len(views) < 2 or is_fixed else vega.with_equal_sizes(views)


def policy(style: str, *scripts: str) -> str:
    """Return the content security policy of the page.

    It allows these scripts, this style and embedded pictures, and forbids everything else.
    """
    allowed = {
        "default-src": "'none'",
        "script-src": " ".join(_hash(script) for script in scripts if script),
        "style-src": _hash(style),
        "img-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{name} {value}" for name, value in allowed.items())


def _hash(text: str) -> str:
    """Return the hash by which a content security policy names a script or a style."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _trusted(text: str) -> Markup:
    """Return text that the template puts into the page without escaping it."""
    return Markup(text)  # noqa: S704 - style and scripts are part of the product


def as_script(content: Any) -> Markup:
    """Return content as JSON for a script element of the page, which no text in it can end."""
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    safe = text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
    return Markup(safe)  # noqa: S704 - the three letters that matter in HTML are escaped


def data_link(text: str) -> str:
    """Return a data URL that holds a text, as the target of a download link."""
    return "data:application/octet-stream;base64," + base64.b64encode(text.encode()).decode()


def data_uri(folder: Path, file: str, *, max_width: int = 1600, colours: int = 128) -> str:
    """Return a data URL that holds a PNG file of the output folder, made smaller.

    "" where the folder has no such file, or it is no PNG.

    Parameters
    ----------
    folder : Path
        Output folder.
    file : str
        Path of the file relative to the folder.
    max_width : int
        Width, pixels, to which a wider picture is shrunk.
    colours : int
        Number of colours that are kept: enough for smooth shades, in a third of the bytes.
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
    # Octrees take a seventh of the time of median cuts, for the same picture.
    reduced = small.quantize(colours, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    reduced.save(stream, "PNG")
    return png_uri(stream)


def number(value: object) -> str:
    """Return a value as the page shows it: floats with four digits, a dash for missing values."""
    if value is None:
        return "–"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.4g}" if isfinite(value) else "–"


#: Pattern of the space between a number and its unit, which must not break a line.
TIED = re.compile(r"(?<=\d) (?=(?:%|[kMG]?Pa|mm|k?N|kN/m|N/mm|degrees|times)\b|%)")
#: Number of letters up to which the text of a cell stays on one line.
MAX_UNBROKEN = 26


def long(value: object) -> bool:
    """Return whether the text of a cell is so long that it may be broken between its words."""
    return len(number(value)) > MAX_UNBROKEN


def folds(table: Table, max_width: int = 96) -> list[list[int]]:
    """Split the columns of a wide table into several tables, one below the other.

    Every one of these begins with the columns that name the rows: the first column, and columns
    of text right after it.

    Parameters
    ----------
    table : Table
        The table.
    max_width : int
        Number of letters that fit in a row on paper and on the screen.

    Returns
    -------
    list of lists of int
        Indices of the columns of each table; a single list where the table is not split.
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
    """Return the width of a column in letters, where long cells are broken between their words."""
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
    """Return the path of a browser that can print pages, None where there is none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def browser_command(browser: str, home: Path) -> list[str]:
    """Return the command that starts a browser without a window and without the network.

    Parameters
    ----------
    browser : str
        Path of the browser.
    home : Path
        Folder for the browser's own files.
    """
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
        HTML file to print.
    path : Path
        PDF file to write.
    timeout : float, s
        Time that the browser may take.

    Returns
    -------
    Path
        PDF file that was written.

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
