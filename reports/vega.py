"""Draw charts with Vega: as files, as figures of the page, and as views that a script moves.

`panel` turns one `Chart` into the data, scales, axes, legends and marks of a Vega group. A file is
a grid of such groups; on the page each is a view of its own. vl-convert runs Vega without a
browser, and carries the scripts that the page holds."""

from __future__ import annotations

import base64
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any
from zlib import crc32

from markupsafe import Markup, escape

from ..errors import InputError, OutputError
from ..storage.folders import cache_folder
from ..storage.writing import replacing
from .charts import Chart, Charts, Series, Shades, axis_ends, looks_of, scale_ends

if TYPE_CHECKING:
    from ..experiments.output import Output

Spec = dict[str, Any]

# Okabe and Ito's palette, and light to dark with rising load: on white, and on a dark screen.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#222222", "#b0578d", "#c98a00", "#56b4e9", "#8c8c8c")
RISING = (
    "#b8d62f",
    "#8ccb3c",
    "#5ec05a",
    "#35b272",
    "#21a386",
    "#1f958b",
    "#26828e",
    "#2f6e8e",
    "#39588c",
    "#433d84",
    "#440f54",
)
DARK_PALETTE = (
    "#56b4e9",
    "#ff8b3d",
    "#2fc9a0",
    "#e6e6e6",
    "#e094c0",
    "#f0b73c",
    "#3d8fc4",
    "#8c8c8d",
)
DARK_RISING = (
    "#5b4a9e",
    "#4f62b0",
    "#4477b5",
    "#3b8bb5",
    "#339db0",
    "#2eaea6",
    "#3bbd93",
    "#5ccb78",
    "#8bd65a",
    "#bfdf3f",
    "#fde725",
)
SOFT, GRID = "#5f5f5f", "#dcdcdc"
#: What a dark screen shows in place of a colour.
DARK = dict(
    zip(
        (*PALETTE, *RISING, SOFT, GRID),
        (*DARK_PALETTE, *DARK_RISING, "#a9adb3", "#3a3f46"),
        strict=True,
    )
)
#: Viridis, and red to blue about white: colours that stay apart for colour-blind readers.
COLOURS: Mapping[Shades, tuple[str, ...]] = {
    "from least": (
        "#440154",
        "#481f70",
        "#443983",
        "#3b528b",
        "#31688e",
        "#287c8e",
        "#21918c",
        "#20a486",
        "#35b779",
        "#5ec962",
        "#90d743",
        "#c8e020",
        "#fde725",
    ),
    "about zero": (
        "#10457e",
        "#266caf",
        "#408fc1",
        "#7bb6d6",
        "#aed3e6",
        "#dae9f2",
        "#f6f7f7",
        "#fce2d2",
        "#f8bda1",
        "#eb9172",
        "#d35a4a",
        "#b72230",
        "#840924",
    ),
}
DASHES: tuple[list[float], ...] = ([], [6, 3], [1.5, 2.5], [7, 2.5, 1.5, 2.5])

#: Pixels of a plot without its axes: alone or two in a row, three in a row, and in height.
WIDE, NARROW, TALL = 386, 266, 210
#: Charts in a row from which on they are narrow.
THREE = 3
#: Pixels of a letter, of one of a title, and of the sample in front of a legend's entry.
LETTER, BOLD, SAMPLE = 6.2, 7.4, 34
#: Dots of a chart of nothing else: up to so many are drawn large.
FEW = 60
#: Characters that XML, and so SVG, cannot hold.
UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
#: Whether the first digit of a tick of a logarithmic axis is 1, 2 or 5.
ROUND = (
    "indexof([1, 2, 5], round(datum.value / pow(10, floor(log(datum.value) / LN10 + 1e-9)))) >= 0"
)
#: Files that can be written, and what notebooks call a specification for Vega.
SUFFIXES, VEGA = (".png", ".svg", ".pdf"), "application/vnd.vega.v6+json"
#: Pixels of a file for each of Vega's.
DOTS = 2.0
CONFIG: Spec = {
    "aria": False,
    "axis": {
        "labelColor": SOFT,
        "titleColor": "#222222",
        "gridColor": GRID,
        "domainColor": GRID,
        "tickColor": GRID,
        "labelFontSize": 11,
        "titleFontSize": 12,
        "titleFontWeight": "normal",
        "grid": True,
        "labelFlush": False,
        "titlePadding": 6,
    },
    "legend": {
        "labelColor": "#222222",
        "labelFontSize": 11.5,
        "titleColor": "#222222",
        "titleFontSize": 11.5,
        "titleFontWeight": "normal",
        "titleLimit": 300,
    },
    "title": {"color": "#222222", "fontSize": 13, "anchor": "start", "frame": "group"},
}


def save(path: Path | str, charts: Charts) -> Path:
    """Write charts as PNG, SVG or PDF by suffix; InputError : another one. OutputError."""
    if not charts.charts:
        raise ValueError(f"{charts.name}: nothing to draw")
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(path, "", f"expected a name that ends in {', '.join(SUFFIXES)}")
    content = rendered(charts, path.suffix.lower())
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return path


def saved(out: Output, name: str, charts: Charts, caption: str) -> tuple[str, str]:
    """Write charts where a test writes; return the file below the folder, and the caption."""
    save(out.path(name), charts)
    return out.name(name), caption


def rendered(charts: Charts, suffix: str) -> bytes:
    """Return charts as the bytes of a file of this suffix."""
    return _drawn(suffix[1:], picture(charts))


@dataclass(frozen=True, eq=False)
class Drawing:
    """Charts that a notebook shows, and a script saves."""

    charts: Charts

    @property
    def spec(self) -> Spec:
        """Return the specification for Vega."""
        return picture(self.charts)

    def save(self, path: Path | str) -> Path:
        """Write as `save`."""
        return save(path, self.charts)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        svg = rendered(self.charts, ".svg").decode()
        said = "; ".join(chart.alt or chart.title for chart in self.charts.charts)
        return {VEGA: self.spec, "image/svg+xml": svg, "text/plain": self.charts.caption or said}


class _Converter:
    """vl-convert in a process beside this one: a fork would leave its thread behind."""

    #: Reads a line of JSON a drawing, writes a line of base64.
    PROGRAM = """
import base64, json, sys
import vl_convert
for line in sys.stdin:
    name, spec, options = json.loads(line)
    made = getattr(vl_convert, name)(spec, **options)
    made = made.encode() if isinstance(made, str) else made
    print(base64.b64encode(made).decode(), flush=True)
"""

    def __init__(self) -> None:
        self.beside: tuple[int, subprocess.Popen[str]] | None = None

    def __call__(self, kind: str, spec: Spec) -> bytes:
        """Return a drawing; kind : "png", "svg" or "pdf". OutputError."""
        line = json.dumps([f"vega_to_{kind}", spec, {"scale": DOTS} if kind == "png" else {}])
        for _ in range(2):  # once more where it was killed, as a machine short of memory may do
            if self.beside is None or self.beside[0] != os.getpid():
                command = [sys.executable, "-c", self.PROGRAM]
                pipe = subprocess.PIPE
                own = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
                self.beside = os.getpid(), own
            program = self.beside[1]
            assert program.stdin is not None and program.stdout is not None
            with suppress(OSError):
                print(line, file=program.stdin, flush=True)
                if answer := program.stdout.readline():
                    return base64.b64decode(answer)
            self.beside = None
        raise OutputError("vl-convert ended before it had drawn a chart")


_drawn = _Converter()


def picture(charts: Charts) -> Spec:
    """Return Vega's specification of all charts beside each other, with one legend if it can."""
    charts = replace(charts, charts=[printable(chart) for chart in charts.charts])
    columns = charts.columns or min(THREE, len(charts.charts))
    width = NARROW if columns >= THREE else WIDE
    looks = looks_of(charts.charts) if len(charts.charts) > 1 else None
    marks = []
    for chart in charts.charts:
        if not (chart.title or chart.series):
            marks.append({"type": "group"})  # a free place
            continue
        group = panel(chart, width, legend=looks is None)
        sizes: Spec = {s["name"]: {"value": s["value"]} for s in group["signals"][:2]}
        group |= {"type": "group", "encode": {"update": sizes}}
        marks.append(group)
    spec = _outline() | {
        "background": "white",
        "layout": {"columns": columns, "padding": {"column": 26, "row": 22}, "bounds": "full"},
        "marks": marks,
    }
    if looks:
        spec |= _legend(list(looks.values()), (width + 60) * min(columns, len(charts.charts)))
    return spec


def view(chart: Chart, width: float = WIDE, dot: float | None = None) -> Spec:
    """Return Vega's specification of one chart of the page; dot : area of its dots."""
    chart = printable(chart)
    group = panel(chart, width, dot=dot)
    for mark in group["marks"]:
        mark["clip"] = True
    width, height = (s["value"] for s in group["signals"][:2])
    group["signals"] = group["signals"][2:]
    group["signals"] += [{"name": "spot", "value": None}, {"name": "box", "value": [0] * 4}]
    group["marks"] += [
        {
            "type": "symbol",
            "interactive": False,
            "encode": {
                "update": {
                    "x": {"signal": "spot ? spot[0] : 0"},
                    "y": {"signal": "spot ? spot[1] : 0"},
                    "size": {"value": 80},
                    "fill": {"value": "transparent"},
                    "stroke": {"value": "#222222"},
                    "opacity": {"signal": "spot ? 1 : 0"},
                }
            },
        },
        {
            "type": "rect",
            "interactive": False,
            "encode": {
                "update": {
                    "x": {"signal": "box[0]"},
                    "y": {"signal": "box[1]"},
                    "x2": {"signal": "box[2]"},
                    "y2": {"signal": "box[3]"},
                    "fill": {"value": PALETTE[0]},
                    "fillOpacity": {"value": 0.2},
                }
            },
        },
    ]
    said = {
        "title": chart.title,
        "labels": [chart.x_label, chart.y_label],
        "names": chart.x_names,
        "scale": chart.scale,
        "series": [s.name for s in chart.series],
        "alt": chart.alt or chart.title,
    }
    return _outline() | {"width": width, "height": height, "usermeta": said, **group}


def figure(spec: Spec) -> Markup:
    """Return a view as SVG that stands in the page: on paper, and until the script takes over."""
    text = _drawn("svg", spec).decode()
    alt = escape(spec["usermeta"]["alt"])
    head = re.match(r'<svg [^>]*?(viewBox="[^"]*")[^>]*>', text)
    assert head is not None
    text = f'<svg class="chart" {head[1]} role="img" aria-label="{alt}">{text[head.end() :]}'
    # Parts that are named must have names of their own in a page of several drawings.
    # Vega counts up over all drawings, and a page made again is to be the same.
    own = f"f{crc32(json.dumps(spec).encode()):x}"
    for number, name in enumerate(
        dict.fromkeys(re.findall(r'id="((?:clip|gradient)[^"]*)"', text))
    ):
        text = re.sub(rf'(id="|#){name}(?=["\)])', rf"\g<1>{own}-{number}", text)
    return Markup(text)  # noqa: S704 - Vega escapes every text of a drawing


def dark_style() -> str:
    """Return the rules by which a dark screen shows drawings that were made for paper."""
    rules = "".join(
        f'svg [{way}="{light}"]{{{way}:{dark}}}'
        for light, dark in DARK.items()
        for way in ("fill", "stroke")
    )
    return f"@media screen and (prefers-color-scheme: dark) {{{rules}}}\n"


@cache
def library() -> str:
    """Return Vega as one script, kept in the cache of the computer; raises OutputError."""
    path = cache_folder() / f"vega-{version('vl-convert-python')}.js"
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        pass
    # In a process of its own: once a version, and also in a forked process.
    call = "import sys, vl_convert; sys.stdout.write(vl_convert.javascript_bundle(sys.argv[1]))"
    command = [sys.executable, "-c", call, "window.vegaEmbed = vegaEmbed;"]
    done = subprocess.run(command, capture_output=True)
    if done.returncode:
        raise OutputError(f"the scripts of vl-convert: {done.stderr.decode()[-300:]}")
    text = done.stdout.decode()
    # Nothing in it may end the element of the page that holds it.
    text = text.replace("</script", "<\\/script").replace("<!--", "<\\!--")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="")
    except (OSError, OutputError):
        pass  # a cache that cannot be written costs two seconds a page
    return text


def panel(chart: Chart, width: float = WIDE, legend: bool = True, dot: float | None = None) -> Spec:
    """Return one chart as a Vega group; its first two signals are its width and height."""
    x, y = axis_ends(chart)
    height: float = TALL
    if chart.equal:
        # Within a box of the plot's width, and of one and a half times that as height.
        unit = min(width / (x[1] - x[0]), 1.5 * width / (y[1] - y[0]))
        width = unit * (x[1] - x[0])
        height = unit * (y[1] - y[0])
    spec: Spec = {
        "signals": [
            {"name": "width", "value": round(width, 2)},
            {"name": "height", "value": round(height, 2)},
            {"name": "xs", "value": x},
            {"name": "ys", "value": y},
        ],
        "data": [],
        "marks": [],
        "legends": [],
        "scales": [_scale("x", "xs", chart.log_x), _scale("y", "ys", chart.log_y)],
        "axes": [_x_axis(chart, width), _axis("left", "y", chart.y_label, height, chart.log_y)],
    }
    if chart.title:
        lines = wrap(chart.title, int((width + 30) / BOLD))
        spec["title"] = {"text": lines if len(lines) > 1 else chart.title, "offset": 6}
    if any(s.values for s in chart.series):
        spec["signals"].append({"name": "ends", "value": scale_ends(chart)})
        colours = {"type": "quantize", "domain": {"signal": "ends"}, "range": COLOURS[chart.shades]}
        spec["scales"].append({"name": "shade", **colours})
        spec["legends"].append(
            {
                "fill": "shade",
                "type": "gradient",
                "orient": "right",
                "title": chart.scale,
                "gradientLength": min(height, 160),
                "format": ".3~g",
                "offset": 18,
                "labelOverlap": "greedy",
                "labelSeparation": 6,
            }
        )
    if chart.level is not None:
        rule = {"x": {"value": 0}, "x2": {"signal": "width"}, "y": _at("y", value=chart.level)}
        spec["marks"].append(_mark("rule", "", {**rule, "stroke": {"value": SOFT}}))
    dotted = all(s.look == "dots" for s in chart.series)
    dot = dot or (70.0 if dotted and sum(len(s.x) for s in chart.series) <= FEW else None)
    layers: list[tuple[int, Spec]] = []
    for number, s in enumerate(chart.series):
        spec["data"].append(_data(f"s{number}", s))
        layers += _marks(f"s{number}", s, chart, dot)
    spec["marks"] += [mark for _, mark in sorted(layers, key=lambda own: own[0])]
    # In a file a clip costs time, and is not needed where the axes hold everything.
    part = chart.x_range is not None or chart.y_range is not None
    for mark in spec["marks"]:
        mark["clip"] = part or (chart.top is not None and mark["type"] in ("area", "line"))
    entries = list({s.name: s for s in reversed(chart.series) if s.name}.values())[::-1]
    if legend and (len(entries) > 1 or any(s.lower for s in entries)):
        own = _legend(entries, width)
        spec["scales"] += own["scales"]
        spec["legends"] += own["legends"]
    return spec


def printable(chart: Chart) -> Chart:
    """Return the chart without characters at which vl-convert ends the whole process."""

    def words(text: str) -> str:
        return UNPRINTABLE.sub("\ufffd", text)

    return replace(
        chart,
        title=words(chart.title),
        x_label=words(chart.x_label),
        alt=words(chart.alt),
        y_label=words(chart.y_label),
        scale=words(chart.scale),
        x_names=tuple(words(name) for name in chart.x_names),
        series=[replace(s, name=words(s.name)) for s in chart.series],
    )


def colour(s: Series) -> str:
    """Return the colour of a series on paper."""
    if s.rank is not None:
        return RISING[round((len(RISING) - 1) * min(max(s.rank, 0.0), 1.0))]
    return PALETTE[s.colour % len(PALETTE)]


def _outline() -> Spec:
    schema = "https://vega.github.io/schema/vega/v6.json"
    return {"$schema": schema, "padding": 5, "autosize": "pad", "config": CONFIG}


def _scale(name: str, domain: str, log: bool) -> Spec:
    kind = "log" if log else "linear"
    along = [0, {"signal": "width"}] if name == "x" else [{"signal": "height"}, 0]
    ends = {"signal": domain}
    return {"name": name, "type": kind, "domain": ends, "range": along, "zero": False}


def _axis(orient: str, scale: str, title: str, length: float, log: bool) -> Spec:
    axis: Spec = {"orient": orient, "scale": scale, "title": title, "labelOverlap": "greedy"}
    axis |= {"tickCount": max(2, round(length / 55)), "format": "~g" if log else ".12~g"}
    if log:
        shown = {"opacity": {"signal": f"{ROUND} ? 1 : 0"}}
        text = {"text": {"signal": f"{ROUND} ? datum.label : ''"}}
        axis["encode"] = {
            "grid": {"update": shown},
            "ticks": {"update": shown},
            "labels": {"update": text},
        }
    return axis


def _x_axis(chart: Chart, width: float) -> Spec:
    axis = _axis("bottom", "x", chart.x_label, width, chart.log_x)
    if not chart.x_names:
        return axis
    names = list(chart.x_names)
    each = width / len(names)
    text = {"signal": f"{json.dumps(names)}[datum.value - 1]"}
    axis |= {
        "values": list(range(1, len(names) + 1)),
        "labelLimit": each,
        "labelOverlap": False,
        "encode": {"labels": {"update": {"text": text}}},
    }
    if max(map(len, names)) * LETTER > each:
        axis |= {"labelAngle": -28, "labelAlign": "right", "labelLimit": 190}
        axis["labelBaseline"] = "top"
    del axis["format"]
    return axis


def _at(scale: str, field: str = "", value: float | None = None) -> Spec:
    return {"scale": scale, **({"field": field} if field else {"value": value})}


def _mark(kind: str, data: str, update: Spec) -> Spec:
    source = {"from": {"data": data}} if data else {}
    return {"type": kind, "interactive": False, **source, "encode": {"update": update}}


def _data(name: str, s: Series) -> Spec:
    """Return the numbers of a series; faces a row each, other series one row that is unrolled."""
    if s.look == "faces":
        k = len(s.x) // max(len(s.values), 1)
        rows = [
            {"x": s.x[k * n : k * n + k], "y": s.y[k * n : k * n + k], "values": value}
            for n, value in enumerate(s.values)
        ]
        return {"name": name, "values": rows}
    own = {f: getattr(s, f) for f in ("x", "y", "lower", "upper", "values") if getattr(s, f)}
    own = own or {"x": []}
    return {"name": name, "values": [own], "transform": [{"type": "flatten", "fields": list(own)}]}


def _valid(chart: Chart, *fields: str) -> str:
    """Return the expression that is true for rows with a place on the chart."""
    log = {"x": chart.log_x, "y": chart.log_y, "lower": chart.log_y, "upper": chart.log_y}
    parts = [f"isValid(datum.{f})" + (f" && datum.{f} > 0" if log[f] else "") for f in fields]
    return " && ".join(parts)


def _marks(data: str, s: Series, chart: Chart, dot: float | None) -> list[tuple[int, Spec]]:
    """Return marks with their layers: what is pale lies beneath bands, dots on top."""
    own = {"value": colour(s)}
    x = _at("x", "x")
    y = _at("y", "y")
    shaded: Spec = {"scale": "shade", "field": "values"} if s.values else own
    marks: list[tuple[int, Spec]] = []
    if s.look == "faces":
        corners = len(s.x) // max(len(s.values), 1)
        path = "'M' + " + " + 'L' + ".join(
            f"scale('x', datum.x[{k}]) + ' ' + scale('y', datum.y[{k}])" for k in range(corners)
        )
        known = [{"test": "!isValid(datum.values)", "value": "#999"}, shaded]
        shape = {"path": {"signal": f"{path} + 'Z'"}, "fill": known, "stroke": known}
        return [(0, _mark("path", data, {**shape, "strokeWidth": {"value": 0.4}}))]
    if s.lower and s.look == "dots":
        ends = {"x": x, "y": _at("y", "lower"), "y2": _at("y", "upper"), "stroke": own}
        shown = {"signal": f"{_valid(chart, 'x', 'lower', 'upper')} ? 1 : 0"}
        marks.append((2, _mark("rule", data, {**ends, "opacity": shown})))
    elif s.lower:
        area = {
            "x": x,
            "y": _at("y", "upper"),
            "y2": _at("y", "lower"),
            "fill": own,
            "fillOpacity": {"value": 0.2},
            "defined": {"signal": _valid(chart, "x", "lower", "upper")},
        }
        marks.append((1, _mark("area", data, area)))
    valid = _valid(chart, "x", "y")
    if s.y and s.look == "line":
        width, pale = (6, 0.4) if s.wide else (1.2, 0.55) if s.faint else (1.8, 1.0)
        curve = {
            "x": x,
            "y": y,
            "stroke": own,
            "strokeWidth": {"value": width},
            "strokeOpacity": {"value": pale},
            "defined": {"signal": valid},
            "strokeDash": {"value": DASHES[s.dashes % 4]},
        }
        marks.append((0 if s.faint or s.wide else 3, _mark("line", data, curve)))
    if s.y and (s.look == "dots" or s.marks):
        plain = s.shape == "circle"
        size = dot or ((12 if len(s.x) > FEW else 18) if s.look == "dots" else 24)
        fill: Spec = {"value": "transparent"} if s.hollow else shaded
        spot = {
            "x": x,
            "y": y,
            "fill": fill,
            "shape": {"value": s.shape},
            "size": {"value": size if plain else 50},
            "opacity": {"signal": f"{valid} ? 1 : 0"},
            "stroke": shaded,
            "strokeWidth": {"value": 0.0 if plain and not s.hollow else 1.2},
        }
        marks.append((4, _mark("symbol", data, spot)))
    last = next(
        (
            (a, b)
            for a, b in zip(s.x[::-1], s.y[::-1], strict=False)
            if a is not None and b is not None
        ),
        None,
    )
    if s.ends and last:
        end = {"x": _at("x", value=last[0]), "y": _at("y", value=last[1]), "fill": own}
        marks.append((4, _mark("symbol", "", {**end, "size": {"value": 50}})))
    return marks


def _legend(entries: Sequence[Series], width: float) -> Spec:
    """Return scales and legend of named series, in as many columns as the width holds."""
    names = [s.name for s in entries]
    ways = {
        "stroke": [colour(s) for s in entries],
        "strokeDash": [DASHES[s.dashes % 4] if s.look == "line" else [] for s in entries],
        "fill": ["transparent" if s.hollow or s.look == "line" else colour(s) for s in entries],
        "shape": [{"line": "stroke", "band": "square"}.get(s.look, s.shape) for s in entries],
        "size": [260 if s.look == "line" else 60 for s in entries],
        "opacity": [0.3 if s.look == "band" else 0.55 if s.faint or s.wide else 1 for s in entries],
    }
    columns = max(1, int(width / (max(map(len, names)) * LETTER + SAMPLE)))
    scales = [
        {"name": f"legend-{way}", "type": "ordinal", "domain": names, "range": values}
        for way, values in ways.items()
    ]
    legend = {
        **{way: f"legend-{way}" for way in ways},
        "orient": "top",
        "direction": "horizontal",
        "columns": columns,
        "symbolStrokeWidth": 2,
        "labelLimit": width - SAMPLE,
        "rowPadding": 2,
        "offset": 8,
    }
    return {"scales": scales, "legends": [legend]}
