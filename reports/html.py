"""The page: report.html, one file with everything inside, made of the data in page.json."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from dataclasses import fields
from datetime import date
from math import isfinite
from pathlib import Path
from typing import Any

from jinja2 import FileSystemLoader

from ..files import TEMPLATES, environment, replacing
from ..notes import percent as percent
from .chart_svg import chart_svg
from .content import Report
from .embedded import data_uri
from .map_svg import map_svg
from .markup import as_markup
from .page_data import charts_data, maps_data, solid_data
from .page_file import as_written, write_page_data
from .solid_svg import solid_svg

PAGE = "report.html"
#: In the order in which they are read.
SCRIPTS = ("tools", "axes", "charts", "chart_mouse", "maps", "solids", "start")


def write_report(folder: Path | str, report: Report) -> Path:
    """Write `page.json` and, made of it, `report.html` into the output folder.

    Pictures must be there already.

    Raises
    ------
    OutputError : a file cannot be written.
    jinja2.UndefinedError : the template asks for what the report does not have.
    """
    folder = Path(folder)
    (folder / PAGE).unlink(missing_ok=True) if folder.is_dir() else None
    write_page_data(folder, report)
    return write_page(folder, as_written(report))


def write_page(folder: Path, report: Report, path: Path | None = None) -> Path:
    """Write only the page: report.html of the folder, or another file.

    Raises
    ------
    OutputError : it cannot be written.
    """
    path = folder / PAGE if path is None else path
    with replacing(path) as temporary:
        temporary.write_text(page_text(folder, report), encoding="utf-8", newline="")
    return path


def page_text(folder: Path, report: Report, today: date | None = None) -> str:
    """The page as text. folder : of its pictures; today : the day that it names."""
    html = environment(FileSystemLoader(TEMPLATES / "report"), html=True)
    html.filters |= {
        "number": number, "percent": percent, "chart_svg": chart_svg, "map_svg": map_svg,
        "charts_data": charts_data, "maps_data": maps_data, "solid_svg": solid_svg,
        "solid_data": solid_data, "data_link": data_link,
        "data_uri": lambda file: data_uri(folder, file),
    }  # fmt: skip
    style = (TEMPLATES / "report" / "page.css").read_text(encoding="utf-8")
    script = "".join(
        (TEMPLATES / "report" / "scripts" / f"{name}.js").read_text(encoding="utf-8")
        for name in SCRIPTS
    )
    script = f'"use strict";\n{{\n{script}}}\n'
    context: dict[str, Any] = {f.name: getattr(report, f.name) for f in fields(report)}
    context |= {
        "style": as_markup(style), "script": as_markup(script), "today": today or date.today(),
        "policy": policy(style, script),
    }  # fmt: skip
    return html.get_template("report.html.j2").render(context)


def policy(style: str, script: str) -> str:
    """What the page may do: run this script, look as this style says, show what is inside it."""
    allowed: Mapping[str, str] = {
        "default-src": "'none'",
        "script-src": _hash(script),
        "style-src": _hash(style),
        "img-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{name} {value}" for name, value in allowed.items())


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def data_link(text: str) -> str:
    """A link whose target is the text itself."""
    return "data:application/octet-stream;base64," + base64.b64encode(text.encode()).decode()


def number(value: object) -> str:
    """Four significant digits for floats; text, counts and missing values as a reader expects."""
    if value is None:
        return "–"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.4g}" if isfinite(value) else "–"
