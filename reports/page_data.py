"""What the scripts of a page are given beside each figure: plain values, safe within HTML."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

from markupsafe import Markup

from . import map_svg, solid_svg
from .axes import axes_of
from .charts import Charts
from .maps import Maps, Solid
from .markup import as_markup
from .shades import COLOURS


def charts_data(part: Charts) -> Markup:
    """Axes and series of every chart."""
    charts = []
    for chart in part.charts:
        x, y = axes_of(chart)
        charts.append(
            {
                "title": chart.title,
                "labels": [chart.x_label, chart.y_label],
                "names": chart.x_names,
                "axes": [asdict(axis) for axis in (x, y)],
                "series": [
                    {"name": s.name, "x": s.x, "y": s.y, "lower": s.lower, "upper": s.upper}
                    for s in chart.series
                ],
            }
        )
    return as_script({"name": part.name, "charts": charts})


def maps_data(part: Maps) -> Markup:
    """Places and values of every map, packed; and where they are drawn."""
    content = asdict(part)
    every = part.places.values
    low, high = every.min(axis=0), every.max(axis=0)
    content |= {
        "colours": COLOURS,
        "side": map_svg.SIDE,
        "span": float((high - low).max()) or 1.0,
        "middle": (0.5 * (low + high)).tolist(),
    }
    return as_script(content)


def solid_data(part: Solid) -> Markup:
    """Points, faces and shades, packed; and from where they are seen at first."""
    content = asdict(part)
    every = part.points.values
    content |= {
        "colours": COLOURS,
        "scale": solid_svg.scale_of(every),
        "middle": solid_svg.middle_of(every).tolist(),
        "centre": solid_svg.CENTRE,
        "turn": solid_svg.TURN,
        "raise": solid_svg.RAISE,
    }
    return as_script(content)


def as_script(content: Any) -> Markup:
    """JSON that ends no script element, whatever it holds."""
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    safe = text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
    return as_markup(safe)
