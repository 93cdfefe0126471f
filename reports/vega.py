"""Drawing of charts with Vega: as image files, in notebooks, and as views of the report page.

`panel` turns one `Chart` into the data, scales, axes, legends and marks of a Vega group. A file is
a grid of such groups; on the page each chart is a Vega view of its own, whose axes a script moves.

Altair would write Vega-Lite, which has to be compiled to Vega before a script of the page can move
its axes. For a chart of four curves with a band it takes 400 ms and 15.7 kB, after an import of
one second; the specification written here takes 1 ms and 10.9 kB.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any
from zlib import crc32

from markupsafe import Markup, escape

from ..errors import InputError
from ..storage.writing import TEMPLATES, replacing
from .charts import Chart, Charts, Series, Shades, axis_ends, looks_of, scale_ends
from .converter import background, convert

if TYPE_CHECKING:
    from ..experiments.data_files import Output

Spec = dict[str, Any]
#: Number of a layer, in which 0 is the lowest, and a mark of it.
Layer = tuple[int, Spec]

#: Colours and letters of charts. Of colours on white: the palette of Okabe and Ito, those of rising
#: loads from light to dark, and those of labels and grids, each with its colour on a dark screen.
THEME: Spec = json.loads((TEMPLATES / "report" / "theme.json").read_text(encoding="utf-8"))
PALETTE = list(THEME["palette"])
RISING = list(THEME["rising"])
SOFT = next(iter(THEME["lines"]))
DARK = THEME["palette"] | THEME["rising"] | THEME["lines"]
#: Viridis, and red to blue about white: colours that stay apart for colour-blind readers.
COLOURS: Mapping[Shades, Sequence[str]] = THEME["values"]
DASHES: tuple[list[float], ...] = ([], [6, 3], [1.5, 2.5], [7, 2.5, 1.5, 2.5])

#: Width, pixels, of a plot without its axes: alone or two in a row, and three in a row.
WIDE = 386
NARROW = 266
#: Width of a drawing true to scale that has a row of its own, and its largest height, pixels.
FULL = 780
FULL_HEIGHT = 560
#: Number of charts in a row from which on they are narrow.
NARROW_COLUMNS = 3
#: Width, pixels, of a letter, of a letter of a title, and of the sample before a legend's entry.
LETTER_WIDTH = 6.2
TITLE_LETTER_WIDTH = 7.4
SAMPLE_WIDTH = 34
#: Number of dots of a series up to which they are drawn large.
MAX_LARGE_DOTS = 60
#: Characters that XML, and so SVG, cannot hold.
UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
#: Exponent and first digit of a tick of a logarithmic axis; whether that is 1, 2 or 5; its label,
#: a number or, far from one, a power of ten.
EXPONENT = "floor(log(datum.value) / LN10 + 1e-9)"
FIRST_DIGIT = f"round(datum.value / pow(10, {EXPONENT}))"
ROUND_TICK = f"indexof([1, 2, 5], {FIRST_DIGIT}) >= 0"
POWERS = [
    str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")) for power in range(-20, 21)
]
TICK_LABEL = (
    f"datum.value >= 0.001 && datum.value < 1e5 ? format(datum.value, '~g') : "
    f"({FIRST_DIGIT} == 1 ? '' : {FIRST_DIGIT} + '·') + '10' + {POWERS}[{EXPONENT} + 20]"
)
#: Format of the numbers beside a colour scale: few digits, and powers of ten of small ones.
SCALE_FORMAT = "max(abs(ends[0]), abs(ends[1])) < 0.001 ? '.1~e' : '.3~g'"
#: Room, pixels, of a line of a title or a legend, of an x axis, and of a y axis.
LINE_HEIGHT = 17
AXIS_HEIGHT = 64
AXIS_WIDTH = 62
#: Height, pixels, of a row of a chart with names from the top down, and width of their room.
ROW_HEIGHT = 19
NAMES_WIDTH = 250
#: Suffixes of the files that can be written.
SUFFIXES = (".png", ".svg", ".pdf")


def save(path: Path | str, charts: Charts) -> Path:
    """Write charts as PNG, SVG or PDF; while a page is put together, beside that.

    Parameters
    ----------
    path : path
        File to write; its suffix names the format.
    charts : Charts
        Figure to draw, with one chart at least.

    Returns
    -------
    Path
        File that was written.

    Raises
    ------
    InputError
        The suffix is none of .png, .svg and .pdf.
    OutputError
        The file cannot be written, or vl-convert fails.
    """
    if not charts.charts:
        raise ValueError(f"{charts.name}: nothing to draw")
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(path, "", f"expected a name that ends in {', '.join(SUFFIXES)}")
    background.begin(_write_drawing, path, charts)
    background.files.add(path)
    return path


def _write_drawing(path: Path, charts: Charts) -> None:
    """Draw charts and write them to a file, in the format of its suffix."""
    content = rendered(charts, path.suffix.lower())
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def saved(out: Output, name: str, charts: Charts, caption: str) -> tuple[str, str]:
    """Write charts among the files of a test; return name and caption for its exhibit.

    Parameters
    ----------
    out : Output
        Place of the test's files.
    name : str
        Name of the file, before the prefix of the test.
    charts : Charts
        Figure to draw.
    caption : str
        Caption or description, which is returned as it is.
    """
    save(out.path(name), charts)
    return out.name(name), caption


def rendered(charts: Charts, suffix: str) -> bytes:
    """Return the content of an image file of a figure, in the format of a suffix like ".png"."""
    return convert(suffix[1:], picture(charts))


@dataclass(frozen=True, eq=False)
class Drawing:
    """Figure that a notebook shows as the value of a cell, and that `save` writes to a file."""

    charts: Charts

    @property
    def spec(self) -> Spec:
        """Return Vega's specification of the figure."""
        return picture(self.charts)

    def save(self, path: Path | str) -> Path:
        """Write the figure as PNG, SVG or PDF, as the suffix says; see `vega.save`."""
        return save(path, self.charts)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        """Return the drawing as Vega, as SVG and as text, for notebooks."""
        svg = rendered(self.charts, ".svg").decode()
        words = "; ".join(chart.alt or chart.title for chart in self.charts.charts)
        return {
            "application/vnd.vega.v6+json": self.spec,
            "image/svg+xml": svg,
            "text/plain": self.charts.caption or words,
        }


def picture(charts: Charts) -> Spec:
    """Return Vega's specification of a figure as one image: a grid of its charts.

    The charts share one legend where names look the same in all of them.
    """
    charts = replace(charts, charts=[printable(chart) for chart in charts.charts])
    columns = charts.columns or min(NARROW_COLUMNS, len(charts.charts))
    width = NARROW if columns >= NARROW_COLUMNS else WIDE
    if charts.columns == 1 and any(chart.equal for chart in charts.charts):
        width = FULL
    looks = looks_of(charts.charts) if len(charts.charts) > 1 else None
    marks = [_place(chart, width, legend=looks is None) for chart in charts.charts]
    spec = _outline() | {
        "background": "white",
        "layout": {"columns": columns, "padding": {"column": 26, "row": 22}, "bounds": "full"},
        "marks": marks,
    }
    if looks:
        spec |= _legend(list(looks.values()), (width + 60) * min(columns, len(charts.charts)))
    return spec


def _place(chart: Chart, width: float, legend: bool) -> Spec:
    """Return the group of a chart at its place in a grid; an empty one where there is no chart."""
    if not (chart.title or chart.series):
        return {"type": "group"}
    group = panel(chart, width, legend=legend)
    sizes = {s["name"]: {"value": s["value"]} for s in group["signals"][:2]}
    return group | {"type": "group", "encode": {"update": sizes}}


def view(chart: Chart, width: float = WIDE, dot_area: float | None = None) -> Spec:
    """Return Vega's specification of one chart of the page, whose axes a script can move.

    Parameters
    ----------
    chart : Chart
        Chart to draw.
    width : float, pixels
        Width of the plot, without its axes.
    dot_area : float or None, square pixels
        Area of the dots; None for that of files.
    """
    chart = printable(chart)
    group = panel(chart, width, dot_area=dot_area)
    for mark in group["marks"]:
        mark["clip"] = True
    width, height = (s["value"] for s in group["signals"][:2])
    group["signals"] = group["signals"][2:]
    group["signals"] += [{"name": "spot", "value": None}, {"name": "box", "value": [0] * 4}]
    spot = {
        "x": {"signal": "spot ? spot[0] : 0"},
        "y": {"signal": "spot ? spot[1] : 0"},
        "size": {"value": 80},
        "fill": {"value": "transparent"},
        "stroke": {"value": "#222222"},
        "opacity": {"signal": "spot ? 1 : 0"},
    }
    box = {
        "x": {"signal": "box[0]"},
        "y": {"signal": "box[1]"},
        "x2": {"signal": "box[2]"},
        "y2": {"signal": "box[3]"},
        "fill": {"value": PALETTE[0]},
        "fillOpacity": {"value": 0.2},
    }
    group["marks"] += [_mark("symbol", "", spot), _mark("rect", "", box)]
    meta = {
        "title": chart.title,
        "labels": [chart.x_label, chart.y_label],
        "y_names": chart.y_names,
        "scale": chart.scale,
        "series": [s.name for s in chart.series],
        "alt": chart.alt or chart.title,
    }
    return _outline() | {"width": width, "height": height, "usermeta": meta, **group}


def with_equal_sizes(specs: Sequence[Spec]) -> list[Spec]:
    """Return views of one figure with equal sizes, their titles, legends and axes included.

    The plots shrink by what their labels need, so that a row of charts has one height.
    """
    heights = []
    for spec in specs:
        title = spec.get("title", {}).get("text", [])
        lines = 1 if isinstance(title, str) else len(title)
        rows = 0
        for legend in spec["legends"]:
            names = next(s["domain"] for s in spec["scales"] if s["name"] == legend.get("shape"))
            rows += -(-len(names) // legend["columns"])
        heights.append(spec["height"] + LINE_HEIGHT * (lines + rows) + AXIS_HEIGHT)
    size = {
        "width": specs[0]["width"] + AXIS_WIDTH,
        "height": max(heights),
        "autosize": {"type": "fit", "contains": "padding"},
    }
    return [{**spec, **size} for spec in specs]


def figure(spec: Spec) -> Markup:
    """Return the SVG of a view, which the page shows on paper and until its script runs."""
    text = convert("svg", spec).decode()
    alt = escape(spec["usermeta"]["alt"])
    head = re.match(r'<svg [^>]*?(viewBox="[^"]*")[^>]*>', text)
    assert head is not None
    text = f'<svg class="chart" {head[1]} role="img" aria-label="{alt}">{text[head.end() :]}'
    # Clips and gradients are renamed after the content of the drawing: names must be unique in the
    # page, and Vega's own, which it numbers over all drawings, would differ when a page is made
    # again.
    prefix = f"f{crc32(json.dumps(spec).encode()):x}"
    names = dict.fromkeys(re.findall(r'id="((?:clip|gradient)[^"]*)"', text))
    for number, name in enumerate(names):
        text = re.sub(rf'(id="|#){name}(?=["\)])', rf"\g<1>{prefix}-{number}", text)
    return Markup(text)  # noqa: S704 - Vega escapes every text of a drawing


def dark_style() -> str:
    """Return the rules of CSS that give drawings other colours on a dark screen."""
    rules = "".join(
        f'svg [{attribute}="{light}"]{{{attribute}:{dark}}}'
        for light, dark in DARK.items()
        for attribute in ("fill", "stroke")
    )
    return f"@media screen and (prefers-color-scheme: dark) {{{rules}}}\n"


def panel(
    chart: Chart, width: float = WIDE, *, legend: bool = True, dot_area: float | None = None
) -> Spec:
    """Return Vega's specification of one chart as a group of data, scales, axes and marks.

    Parameters
    ----------
    chart : Chart
        Chart to draw.
    width : float, pixels
        Width of the plot, without its axes; of a chart true to scale, the largest width.
    legend : bool
        Whether the chart has a legend of its own.
    dot_area : float or None, square pixels
        Area of the dots; None for the usual one.

    Returns
    -------
    dict
        The group, whose first two signals are its width and its height.
    """
    x, y = axis_ends(chart)
    width, height = _plot_size(chart, x, y, width)
    spec = {
        "signals": [
            {"name": "width", "value": round(width, 2)},
            {"name": "height", "value": round(height, 2)},
            {"name": "xs", "value": x},
            {"name": "ys", "value": y},
        ],
        "data": [_data(f"s{number}", series) for number, series in enumerate(chart.series)],
        "marks": _chart_marks(chart, dot_area),
        "legends": [],
        "scales": [_scale("x", "xs", chart.log_x), _scale("y", "ys", chart.log_y)],
        "axes": [_x_axis(chart, width), _y_axis(chart, height)],
    }
    if chart.title:
        lines = wrap(chart.title, int((width + 30) / TITLE_LETTER_WIDTH))
        spec["title"] = {"text": lines if len(lines) > 1 else chart.title, "offset": 6}
    if any(series.values for series in chart.series):
        _add_shades(spec, chart, height)
    named = {series.name: series for series in reversed(chart.series) if series.name}
    entries = list(named.values())[::-1]
    if legend and (len(entries) > 1 or any(series.lower for series in entries)):
        of_series = _legend(entries, width)
        spec["scales"] += of_series["scales"]
        spec["legends"] += of_series["legends"]
    return spec


def _plot_size(
    chart: Chart, x: tuple[float, float], y: tuple[float, float], width: float
) -> tuple[float, float]:
    """Return width and height, pixels, of a plot whose axes have the ends x and y."""
    if chart.y_names:
        return width, ROW_HEIGHT * len(chart.y_names)
    if not chart.equal:
        return width, 210
    # Within a box of the plot's width, and of one and a half times that as height at most.
    span = x[1] - x[0]
    rise = y[1] - y[0]
    largest_height = min(1.5 * width, FULL_HEIGHT)
    unit = min(width / span, largest_height / rise)
    return unit * span, unit * rise


def _add_shades(spec: Spec, chart: Chart, height: float) -> None:
    """Add the colour scale of values, and its legend, to the specification of a chart."""
    spec["signals"].append({"name": "ends", "value": scale_ends(chart)})
    scale = {"type": "quantize", "domain": {"signal": "ends"}, "range": COLOURS[chart.shades]}
    spec["scales"].append({"name": "shade", **scale})
    spec["legends"].append(
        {
            "fill": "shade",
            "type": "gradient",
            "orient": "right",
            "title": chart.scale,
            "gradientLength": min(height, 160),
            "format": {"signal": SCALE_FORMAT},
            "offset": 18,
            "labelOverlap": "greedy",
            "labelSeparation": 6,
        }
    )


def _chart_marks(chart: Chart, dot_area: float | None) -> list[Spec]:
    """Return the marks of a chart, the lowest layer first."""
    marks = []
    if chart.level is not None:
        rule = {"x": {"value": 0}, "x2": {"signal": "width"}, "y": _at("y", value=chart.level)}
        marks.append(_mark("rule", "", {**rule, "stroke": {"value": SOFT}}))
    area = dot_area or _usual_dot_area(chart)
    layers = []
    for number, series in enumerate(chart.series):
        layers += SeriesMarks(f"s{number}", series, chart, area).layers()
    marks += [mark for _, mark in sorted(layers, key=lambda layer: layer[0])]
    # In a file a clip costs time, and is not needed where the axes hold everything.
    is_part = chart.x_range is not None or chart.y_range is not None
    for mark in marks:
        mark["clip"] = is_part or (chart.top is not None and mark["type"] in ("area", "line"))
    return marks


def _usual_dot_area(chart: Chart) -> float | None:
    """Return the area of dots, square pixels, for a chart of few dots alone, else None."""
    is_of_dots = all(series.look == "dots" for series in chart.series)
    is_small = sum(len(series.x) for series in chart.series) <= MAX_LARGE_DOTS
    return 70.0 if is_of_dots and is_small else None


def printable(chart: Chart) -> Chart:
    """Return the chart without the characters that would make vl-convert end its process."""

    def words(text: str) -> str:
        return UNPRINTABLE.sub("\ufffd", text)

    return replace(
        chart,
        title=words(chart.title),
        x_label=words(chart.x_label),
        alt=words(chart.alt),
        y_label=words(chart.y_label),
        scale=words(chart.scale),
        y_names=tuple(words(name) for name in chart.y_names),
        series=[replace(s, name=words(s.name)) for s in chart.series],
    )


def colour(series: Series) -> str:
    """Return the colour of a series on a white background."""
    if series.rank is not None:
        return RISING[round((len(RISING) - 1) * min(max(series.rank, 0.0), 1.0))]
    return PALETTE[series.colour % len(PALETTE)]


def _outline() -> Spec:
    """Return the entries that every specification begins with."""
    schema = "https://vega.github.io/schema/vega/v6.json"
    return {"$schema": schema, "padding": 5, "autosize": "pad", "config": THEME["config"]}


def _scale(name: str, ends: str, log: bool) -> Spec:
    """Return the scale of an axis; `ends` is the name of the signal that holds its ends."""
    return {
        "name": name,
        "type": "log" if log else "linear",
        "domain": {"signal": ends},
        "range": [0, {"signal": "width"}] if name == "x" else [{"signal": "height"}, 0],
        "zero": False,
    }


def _axis(orient: str, scale: str, title: str, length: float, log: bool) -> Spec:
    """Return an axis of this length, pixels, with round numbers at its ticks."""
    axis: Spec = {"orient": orient, "scale": scale, "title": title, "labelOverlap": "greedy"}
    axis |= {"tickCount": max(2, round(length / 55)), "format": "~g" if log else ".12~g"}
    if log:
        at_round = {"opacity": {"signal": f"{ROUND_TICK} ? 1 : 0"}}
        text = {"text": {"signal": f"{ROUND_TICK} ? {TICK_LABEL} : ''"}}
        axis["encode"] = {
            "grid": {"update": at_round},
            "ticks": {"update": at_round},
            "labels": {"update": text},
        }
    return axis


def _x_axis(chart: Chart, width: float) -> Spec:
    """Return the x axis, without ticks between the numbers of a chart that counts."""
    axis = _axis("bottom", "x", chart.x_label, width, chart.log_x)
    numbers = sorted({x for series in chart.series for x in series.x if x is not None})
    if len(numbers) > 1 and numbers == list(range(1, 1 + len(numbers))):
        axis["tickMinStep"] = 1
    return axis


def _y_axis(chart: Chart, height: float) -> Spec:
    """Return the y axis, with names in place of numbers where the chart has them."""
    axis = _axis("left", "y", chart.y_label, height, chart.log_y)
    if not chart.y_names:
        return axis
    names = list(chart.y_names)
    text = {"signal": f"{json.dumps(names)}[datum.value - 1]"}
    axis |= {
        "values": list(range(1, len(names) + 1)),
        "labelLimit": NAMES_WIDTH,
        "labelOverlap": False,
        "encode": {"labels": {"update": {"text": text}}},
    }
    # Names need no title, but room for a viewer's wider font, which a blank one keeps; and Vega
    # leaves out given values beyond the count of ticks.
    room = min(NAMES_WIDTH, LETTER_WIDTH * max(map(len, names)))
    axis |= {"title": "\u2003", "minExtent": round(room)}
    del axis["format"], axis["tickCount"]
    return axis


def _at(scale: str, field: str = "", value: float | None = None) -> Spec:
    """Return the position of a field of the data, or else of a value, on the axis of a scale."""
    return {"scale": scale, **({"field": field} if field else {"value": value})}


def _mark(kind: str, data: str, update: Spec) -> Spec:
    """Return a mark of a kind, such as "line", drawn from the data of this name ("" for none)."""
    source = {"from": {"data": data}} if data else {}
    return {"type": kind, "interactive": False, **source, "encode": {"update": update}}


def _data(name: str, series: Series) -> Spec:
    """Return a series as Vega's data: a row for each face; else one row, which Vega unrolls."""
    if series.look == "faces":
        k = len(series.x) // max(len(series.values), 1)
        faces = [slice(k * n, k * n + k) for n in range(len(series.values))]
        rows = [
            {"x": series.x[face], "y": series.y[face], "values": value}
            for face, value in zip(faces, series.values, strict=True)
        ]
        return {"name": name, "values": rows}
    columns = {}
    for field in ("x", "y", "lower", "upper", "values"):
        if numbers := getattr(series, field):
            columns[field] = numbers
    columns = columns or {"x": []}
    unrolled = [{"type": "flatten", "fields": list(columns)}]
    return {"name": name, "values": [columns], "transform": unrolled}


def _valid(chart: Chart, *fields: str) -> str:
    """Return Vega's expression for whether a row of data has a place on the axes."""
    log = {"x": chart.log_x, "y": chart.log_y, "lower": chart.log_y, "upper": chart.log_y}
    parts = [f"isValid(datum.{f})" + (f" && datum.{f} > 0" if log[f] else "") for f in fields]
    return " && ".join(parts)


@dataclass(frozen=True)
class SeriesMarks:
    """Turn a series into Vega's marks, each with its layer.

    Layers from the lowest: 0 faces and pale curves, 1 bands, 2 error bars, 3 curves, 4 dots.

    Attributes
    ----------
    data : str
        Name of the series' data in the specification.
    series : Series
        Series to draw.
    chart : Chart
        Chart on whose axes it is drawn.
    dot_area : float or None, square pixels
        Area of dots, None for the usual one.
    """

    data: str
    series: Series
    chart: Chart
    dot_area: float | None

    def layers(self) -> list[Layer]:
        """Return the marks of the series with their layers."""
        series = self.series
        if series.look == "faces":
            return [self._faces()]
        layers = []
        if series.lower:
            layers.append(self._bars() if series.look == "dots" else self._band())
        if series.y and series.look == "line":
            layers.append(self._curve())
        if series.y and (series.look == "dots" or series.marks):
            layers.append(self._dots())
        return [*layers, *self._end()]

    @property
    def _colour(self) -> Spec:
        return {"value": colour(self.series)}

    @property
    def _shade(self) -> Spec:
        """Return the colour of each value, or that of the series."""
        if self.series.values:
            return {"scale": "shade", "field": "values"}
        return self._colour

    def _opacity(self, *fields: str) -> Spec:
        """Return the opacity that hides a datum if one of the fields is not a number."""
        return {"signal": f"{_valid(self.chart, *fields)} ? 1 : 0"}

    def _faces(self) -> Layer:
        """Return filled polygons, one a value of the series, at the bottom of the drawing."""
        corners = len(self.series.x) // max(len(self.series.values), 1)
        path = "'M' + " + " + 'L' + ".join(
            f"scale('x', datum.x[{k}]) + ' ' + scale('y', datum.y[{k}])" for k in range(corners)
        )
        fill = [{"test": "!isValid(datum.values)", "value": "#999"}, self._shade]
        face = {
            "path": {"signal": f"{path} + 'Z'"},
            "fill": fill,
            "stroke": fill,
            "strokeWidth": {"value": 0.4},
        }
        return 0, _mark("path", self.data, face)

    def _bars(self) -> Layer:
        """Return error bars from `lower` to `upper`."""
        bar = {
            "x": _at("x", "x"),
            "y": _at("y", "lower"),
            "y2": _at("y", "upper"),
            "stroke": self._colour,
            "opacity": self._opacity("x", "lower", "upper"),
        }
        return 2, _mark("rule", self.data, bar)

    def _band(self) -> Layer:
        """Return the area between `lower` and `upper`."""
        area = {
            "x": _at("x", "x"),
            "y": _at("y", "upper"),
            "y2": _at("y", "lower"),
            "fill": self._colour,
            "fillOpacity": {"value": 0.2},
            "defined": {"signal": _valid(self.chart, "x", "lower", "upper")},
        }
        return 1, _mark("area", self.data, area)

    def _curve(self) -> Layer:
        """Return a line, wide or faint where the series says so."""
        series = self.series
        width = 1.8
        opacity = 1.0
        if series.wide:
            width = 6
            opacity = 0.4
        elif series.faint:
            width = 1.2
            opacity = 0.55
        curve = {
            "x": _at("x", "x"),
            "y": _at("y", "y"),
            "stroke": self._colour,
            "strokeWidth": {"value": width},
            "strokeOpacity": {"value": opacity},
            "defined": {"signal": _valid(self.chart, "x", "y")},
            "strokeDash": {"value": DASHES[series.dashes % 4]},
        }
        return (0 if series.faint or series.wide else 3), _mark("line", self.data, curve)

    def _dots(self) -> Layer:
        """Return symbols, smaller where there are many."""
        series = self.series
        is_circle = series.shape == "circle"
        area = 24
        if series.look == "dots":
            area = 12 if len(series.x) > MAX_LARGE_DOTS else 18
        symbol = {
            "x": _at("x", "x"),
            "y": _at("y", "y"),
            "fill": {"value": "transparent"} if series.hollow else self._shade,
            "shape": {"value": series.shape},
            "size": {"value": (self.dot_area or area) if is_circle else 50},
            "opacity": self._opacity("x", "y"),
            "stroke": self._shade,
            "strokeWidth": {"value": 0.0 if is_circle and not series.hollow else 1.2},
        }
        return 4, _mark("symbol", self.data, symbol)

    def _end(self) -> list[Layer]:
        """Return the dot at the last value of a curve, if the series asks for one."""
        if not self.series.ends:
            return []
        for x, y in zip(self.series.x[::-1], self.series.y[::-1], strict=False):
            if x is not None and y is not None:
                place = {"x": _at("x", value=x), "y": _at("y", value=y)}
                dot = {**place, "fill": self._colour, "size": {"value": 50}}
                return [(4, _mark("symbol", "", dot))]
        return []


def _legend(entries: Sequence[Series], width: float) -> Spec:
    """Return the legend of named series and its scales, in as many columns as the width holds."""
    names = [series.name for series in entries]
    columns = max(1, int(width / (max(map(len, names)) * LETTER_WIDTH + SAMPLE_WIDTH)))
    samples = [_sample(series) for series in entries]
    channels = list(samples[0])
    scales = [
        {
            "name": f"legend-{channel}",
            "type": "ordinal",
            "domain": names,
            "range": [sample[channel] for sample in samples],
        }
        for channel in channels
    ]
    legend = {
        **{channel: f"legend-{channel}" for channel in channels},
        "orient": "top",
        "direction": "horizontal",
        "columns": columns,
        "symbolStrokeWidth": 2,
        "labelLimit": width - SAMPLE_WIDTH,
        "rowPadding": 2,
        "columnPadding": 24,  # a viewer's font may be wider than that of the layout
        "offset": 8,
    }
    return {"scales": scales, "legends": [legend]}


def _sample(series: Series) -> Spec:
    """Return the properties of the sample of a series in the legend."""
    is_line = series.look == "line"
    opacity = 0.55 if series.faint or series.wide else 1
    if series.look == "band":
        opacity = 0.3
    return {
        "stroke": colour(series),
        "strokeDash": DASHES[series.dashes % 4] if is_line else [],
        "fill": "transparent" if series.hollow or is_line else colour(series),
        "shape": {"line": "stroke", "band": "square"}.get(series.look, series.shape),
        "size": 260 if is_line else 60,
        "opacity": opacity,
    }
