"""A chart as SVG that stands alone: on paper, without scripts, and as what a script moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from markupsafe import Markup, escape

from .axes import PLACES, Axis, axes_of
from .charts import Chart, Numbers, Series
from .markup import as_markup
from .ticks import written

WIDTH, HEIGHT = 460.0, 260.0
#: From so many charts on they stand three in a row: narrower, so that letters keep their size.
THREE, NARROW = 3, 340.0
LEFT, RIGHT, ABOVE, BELOW = 60.0, 14.0, 8.0, 42.0
#: Of a title, and of a row of the legend.
TITLE, ROW = 22.0, 17.0
#: About so wide is a letter of the legend, and what stands before a name.
LETTER, SAMPLE = 6.4, 30.0
#: Dots of a chart that has nothing else: so many are drawn large.
FEW = 60
#: Classes of rising loads in the style sheet, from 0 to this.
RANKS = 10


def chart_svg(chart: Chart, beside: int = 1) -> Markup:
    """The chart, titles, legend and axes included; beside : charts in its row, itself included."""
    wide = NARROW if beside >= THREE else WIDTH
    few = " few" if _few(chart) else ""
    x, y = axes_of(chart)
    legend, rows = _legend(chart, wide)
    top = ABOVE + (TITLE if chart.title else 0.0) + ROW * rows
    width, height = wide - LEFT - RIGHT, HEIGHT - BELOW - ABOVE
    total = top + height + BELOW
    parts = [
        f'<svg class="chart{few}" viewBox="0 0 {wide:g} {total:g}" role="img" '
        f'aria-label="{escape(chart.alt or chart.title)}">',
        f'<text class="title" x="{LEFT:g}" y="16">{escape(chart.title)}</text>',
        *legend,
        f'<g class="axes">{"".join(_axes(x, y, top, width, height, chart.x_names))}</g>',
        f'<text class="label" x="{LEFT + width / 2:g}" y="{top + height + 36:g}" '
        f'text-anchor="middle">{escape(chart.x_label)}</text>',
        f'<text class="label" transform="translate(13 {top + height / 2:g}) rotate(-90)" '
        f'text-anchor="middle">{escape(chart.y_label)}</text>',
        f'<svg class="plot" x="{LEFT:g}" y="{top:g}" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {PLACES:g} {PLACES:g}" preserveAspectRatio="none">',
    ]
    if chart.level is not None and (level := y.place(chart.level)) is not None:
        parts.append(_path("level", f"M0 {_up(level)}H{PLACES:g}"))
    for look in ("faint", "band", "curve"):
        parts += [mark for s in chart.series for mark in _marks(s, x, y, look)]
    parts += ["</svg>", '<g class="pointer"></g>', "</svg>"]
    return as_markup("".join(parts))


def _few(chart: Chart) -> bool:
    """Whether it is dots alone, and so few that they may be large."""
    dotted = all(s.look == "dots" for s in chart.series)
    return dotted and sum(len(s.x) for s in chart.series) <= FEW


def _up(place: float) -> str:
    return f"{PLACES - place:.2f}".rstrip("0").rstrip(".")


def _path(style: str, d: str, more: str = "") -> str:
    return f'<path class="{style}" vector-effect="non-scaling-stroke" d="{d}"{more}/>'


def colour(series: Series) -> str:
    """The class of its colour."""
    if series.rank is not None:
        return f"r{round(RANKS * min(max(series.rank, 0.0), 1.0))}"
    return f"c{series.colour % 8}"


def _marks(s: Series, x: Axis, y: Axis, look: str) -> Iterator[str]:
    """What of a series belongs to a layer: faint ones below bands, bands below curves."""
    own = colour(s)
    if look == "band" and s.lower:
        upper, lower = _points(s.x, s.upper, x, y), _points(s.x, s.lower, x, y)
        both = [(a, b) for a, b in zip(upper, lower, strict=True) if a and b]
        if both:
            ends = [*(a for a, _ in both), *(b for _, b in reversed(both))]
            yield _path(f"band {own}", "M" + "L".join(ends) + "Z")
    if look == "band" or (look == "faint") != s.faint or not s.y:
        return
    points = _points(s.x, s.y, x, y)
    if s.look == "dots":
        yield _path(f"dot {own}", "".join(f"M{p}h0" for p in points if p))
        return
    known, d = False, ""
    for p in points:
        d += "" if p is None else f"{'L' if known else 'M'}{p}"
        known = p is not None
    style = f"line {own} d{s.dashes % 4}" + (" faint" if s.faint else "")
    yield _path(style, d)
    if s.marks:
        yield _path(f"dot {own}", "".join(f"M{p}h0" for p in points if p))
    last = next((p for p in reversed(points) if p), None)
    if s.ends and last:
        yield _path(f"dot end {own}", f"M{last}h0")


def _points(xs: Numbers, ys: Numbers, x: Axis, y: Axis) -> list[str | None]:
    placed = [(x.place(a), y.place(b)) for a, b in zip(xs, ys, strict=True)]
    return [None if a is None or b is None else f"{_left(a)} {_up(b)}" for a, b in placed]


def _left(place: float) -> str:
    return f"{place:.2f}".rstrip("0").rstrip(".")


def _short(name: str, width: float, count: int) -> str:
    """Of a name, what there is room for beside the others."""
    most = max(3, int(width / count / LETTER) - 1)
    return name if len(name) <= most else f"{name[: most - 1]}…"


def _axes(
    x: Axis, y: Axis, top: float, width: float, height: float, names: Sequence[str]
) -> Iterator[str]:
    """Grid lines and numbers, or names."""
    for k, name in enumerate(names, start=1):
        at = LEFT + width * (x.place(float(k)) or 0.0) / PLACES
        yield f'<path d="M{at:.1f} {top:g}v{height:g}"/>'
        yield (
            f'<text x="{at:.1f}" y="{top + height + 16:g}" text-anchor="middle">'
            f"{escape(_short(name, width, len(names)))}<title>{escape(name)}</title></text>"
        )
    for value in () if names else x.ticks:
        at = LEFT + width * (x.place(value) or 0.0) / PLACES
        yield f'<path d="M{at:.1f} {top:g}v{height:g}"/>'
        yield (
            f'<text x="{at:.1f}" y="{top + height + 16:g}" text-anchor="middle">'
            f"{written(value)}</text>"
        )
    for value in y.ticks:
        at = top + height * (1 - (y.place(value) or 0.0) / PLACES)
        yield f'<path d="M{LEFT:g} {at:.1f}h{width:g}"/>'
        yield (f'<text x="{LEFT - 6:g}" y="{at + 4:.1f}" text-anchor="end">{written(value)}</text>')


def _legend(chart: Chart, width: float) -> tuple[list[str], int]:
    """Its marks, and how many rows they take; names that come again stand once."""
    named = {s.name: s for s in reversed(chart.series) if s.name}
    entries = [named[name] for name in dict.fromkeys(s.name for s in chart.series) if name]
    if len(entries) < 2 and not any(s.lower for s in entries):
        return [], 0
    parts, left, row = [], LEFT, 0
    top = ABOVE + (TITLE if chart.title else 0.0)
    for s in entries:
        wide = SAMPLE + LETTER * len(s.name) + 10
        if left > LEFT and left + wide > width - 4:
            left, row = LEFT, row + 1
        at = top + ROW * row + 4
        parts.append(f'<g class="entry" transform="translate({left:g} {at:g})">{_sample(s)}')
        parts.append(f'<text x="{SAMPLE - 5:g}" y="4">{escape(s.name)}</text></g>')
        left += wide
    return parts, row + 1


def _sample(s: Series) -> str:
    own = colour(s)
    if s.look == "dots":
        return f'<path class="dot {own}" d="M11 0h0"/>'
    band = f'<path class="band {own}" d="M0 -5H22V5H0Z"/>' if s.lower else ""
    if s.look == "band":
        return band
    faint = " faint" if s.faint else ""
    return f'{band}<path class="line {own} d{s.dashes % 4}{faint}" d="M0 0H22"/>'
