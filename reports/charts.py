"""Charts as plain data: each is declared once, and `vega` draws it on the page and as a file.

At the end those of tangent moduli over strain: fits, bands, and what each test determines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, log10
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..inference.reported import LARGEST_SIGMA

Array = NDArray[np.float64]
Numbers = Sequence[float | None]
#: Colours of values: from nothing to much, or with zero in the middle.
Shades = Literal["from least", "about zero"]
Look = Literal["line", "dots", "band", "faces"]

#: Significant digits of the numbers in a chart.
DIGITS = 6
#: Most points drawn of one series of dots; longer series are thinned evenly.
MOST_POINTS = 400
#: A ratio of values above which a logarithmic axis is easier to read than a linear one.
DECADE = 10.0
#: Free space beyond the data, as a share of their range.
MARGIN = 0.05
#: A smaller share of values of the other sign does not call for colours about zero.
ONE_SIGN = 0.05
#: Titles by name of the direction of a strip; other names stand as they are.
TITLES = {"bias": "45° bias", "bias45": "45° bias"}


@dataclass(frozen=True)
class Series:
    """One curve, band, cloud of points or set of coloured faces of a chart.
    name : in the legend, "" for none. x, y : (n,) in the units of the axes; None where there is no
    value. Faces have their corners one after the other. lower, upper : (n,) ends of a band about a
    curve, or of error bars through dots. look : line, dots, only the band, or faces. colour : index
    of the palette; rank : 0 to 1 along the colours of rising loads instead. dashes : index of the
    dash pattern, 0 for solid. ends : draw a dot at the end of the curve. faint : thin, pale and
    behind the others. marks : draw a dot at every value of a line. values : colours on the chart's
    scale, one for every dot or face. shape : Vega's name of the symbol. wide : a thick pale line
    behind the others. hollow : dots are rings."""

    name: str
    x: Numbers
    y: Numbers = ()
    lower: Numbers = ()
    upper: Numbers = ()
    look: Look = "line"
    colour: int = 0
    rank: float | None = None
    dashes: int = 0
    ends: bool = False
    faint: bool = False
    marks: bool = False
    values: Numbers = ()
    shape: str = "circle"
    wide: bool = False
    hollow: bool = False


@dataclass(frozen=True)
class Chart:
    """One pair of axes; the labels name the units.
    alt : description in words for those who cannot see the chart. from_zero : the y axis begins at
    zero. top : end of the y axis, where a band may be wider than is worth showing; None for that of
    all that is drawn. level : y of a horizontal line. x_names : names at x = 1, 2, ... in place of
    numbers. equal : both axes have the same scale, as a drawing true to scale needs. scale : label
    of the colours of `Series.values`. shades : their kind; ends : values of the first and last
    colour, those of the data by default. x_range, y_range : part that is shown; everything by
    default."""

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    alt: str = ""
    log_y: bool = False
    from_zero: bool = False
    top: float | None = None
    level: float | None = None
    log_x: bool = False
    x_names: Sequence[str] = ()
    equal: bool = False
    scale: str = ""
    shades: Shades = "from least"
    ends: tuple[float, float] | None = None
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True)
class Charts:
    """Charts that belong together, with one caption; columns : in a file, 0 for up to three."""

    name: str
    charts: Sequence[Chart]
    caption: str
    columns: int = 0
    part: Literal["charts"] = "charts"


def numbers(values: ArrayLike) -> list[float | None]:
    """Return (n,) plain numbers of `DIGITS` digits; None for what is not finite."""
    flat = np.asarray(values, dtype=float).ravel().tolist()
    return [float(f"{v:.{DIGITS}g}") if isfinite(v) else None for v in flat]


def line(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    band: tuple[ArrayLike, ArrayLike] | None = None,
    **look: Any,
) -> Series:
    """Return a curve of arrays (n,), with its band; look : further fields of `Series`."""
    lower, upper = ([], []) if band is None else (numbers(band[0]), numbers(band[1]))
    return Series(name, numbers(x), numbers(y), lower, upper, **look)


def band(name: str, x: ArrayLike, lower: ArrayLike, upper: ArrayLike, **look: Any) -> Series:
    """Return only a band between two curves (n,)."""
    return Series(name, numbers(x), (), numbers(lower), numbers(upper), "band", **look)


def dots(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    bars: tuple[ArrayLike, ArrayLike] | None = None,
    most: int = MOST_POINTS,
    values: ArrayLike = (),
    **look: Any,
) -> Series:
    """Return points of arrays (n,), thinned to at most `most`, with the ends of error bars."""
    every = slice(None, None, max(1, -(-np.size(np.asarray(x)) // most)))
    lower, upper = ([], []) if bars is None else (numbers(end)[every] for end in bars)
    across, up, own = (numbers(given)[every] for given in (x, y, values))
    return Series(name, across, up, lower, upper, look="dots", values=own, **look)


def faces(name: str, corners: ArrayLike, values: ArrayLike) -> Series:
    """Return polygons of corners (faces, k, 2), coloured by values (faces,)."""
    at = np.asarray(corners, dtype=float)
    x = numbers(at[..., 0])
    y = numbers(at[..., 1])
    return Series(name, x, y, look="faces", values=numbers(values))


def spans_a_decade(values: ArrayLike) -> bool:
    """Return True where the finite values are all positive and span more than a decade."""
    finite = np.asarray(values, dtype=float).ravel()
    finite = finite[np.isfinite(finite)]
    return bool(len(finite) and finite.min() > 0 and finite.max() > DECADE * finite.min())


def shades_of(values: ArrayLike) -> Shades:
    """Return the kind of colours that values call for: about zero where both signs matter."""
    low = float(np.nanmin(values))
    high = float(np.nanmax(values))
    both = min(-low, high) > ONE_SIGN * max(abs(low), abs(high))
    return "about zero" if both else "from least"


def ends_of(values: Array, shades: Shades) -> tuple[float, float]:
    """Return the values of the first and the last colour."""
    known = values[np.isfinite(values)]
    if not len(known):
        return 0.0, 1.0
    if shades == "about zero":
        most = float(np.abs(known).max()) or 1.0
        return -most, most
    low = float(known.min())
    high = float(known.max())
    return (low, high) if high > low else (low, low + 1.0)


def scale_ends(chart: Chart) -> tuple[float, float]:
    """Return the values of a chart's first and last colour."""
    if chart.ends is not None:
        return chart.ends
    every = [np.array(s.values, dtype=float) for s in chart.series if s.values]
    return ends_of(np.concatenate(every) if every else np.zeros(0), chart.shades)


def looks_of(charts: Sequence[Chart]) -> Mapping[str, Series] | None:
    """Return one series by name; None where charts draw the same name in different looks."""
    found: dict[str, Series] = {}
    for s in (s for chart in charts for s in chart.series if s.name):
        first = found.setdefault(s.name, s)
        if _look(s) != _look(first) and s.look == first.look:
            return None
    return found


def _look(s: Series) -> tuple[object, ...]:
    return s.colour if s.rank is None else s.rank, s.dashes, s.shape, s.hollow


def axis_ends(chart: Chart) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the least and largest value of the x and of the y axis, with a small margin."""
    along = (s.x for s in chart.series)
    up: Iterable[Numbers] = (v for s in chart.series for v in (s.y, s.lower, s.upper))
    if chart.top is not None:
        up = (s.y for s in chart.series)
    level = [] if chart.level is None else [chart.level]
    values = [*_known(up, chart.log_y), *level]
    low, high = _ends(values, chart.log_y, MARGIN)
    if not chart.log_y and not chart.equal and min(values, default=0.0) >= 0:
        low = 0.0 if chart.from_zero or low < 0.25 * high else low
    if chart.top is not None:
        high = max(chart.top, low + 1e-12)
    if chart.x_names:
        return (0.5, len(chart.x_names) + 0.5), chart.y_range or (low, high)
    dotted = any(s.look != "line" or s.marks for s in chart.series)
    x = _ends(_known(along, chart.log_x), chart.log_x, 0.02 if dotted else 0.0)
    return chart.x_range or x, chart.y_range or (low, high)


def _known(several: Iterable[Numbers], log: bool) -> list[float]:
    return [v for own in several for v in own if v is not None and (v > 0 or not log)]


def _ends(values: list[float], log: bool, room: float) -> tuple[float, float]:
    if not values:
        return (1.0, 10.0) if log else (0.0, 1.0)
    low = min(values)
    high = max(values)
    if log:
        share = max((high / low) ** room, 1.0 if high > low else 2.0)
        # An axis of less than a third of a decade has hardly a number to read.
        while log10(high * share / (low / share)) < 0.35:
            share *= 1.2
        return low / share, high * share
    span = high - low
    more = room * span if span > 0 else 0.5 * abs(high) or 0.5
    return low - more, high + more


#: Title and axis of E1, E2 and G12.
PANELS = (
    ("E1, along the warp", "logarithmic strain ε1, %"),
    ("E2, along the fill", "logarithmic strain ε2, %"),
    ("G12, in shear", "shear strain γ12, %"),
)
MODULUS = "tangent modulus, MPa"
#: Deviation (%) below which curves are the same to machine precision, and decades drawn of it.
SAME, DRAWN_DECADES = 1e-10, 7
#: Percent; a modulus known no better than this is not determined.
NOT_DETERMINED = 100 * LARGEST_SIGMA
#: Percent; nothing is known better than this, and a zero has to stand somewhere.
SMALLEST = 1e-3
#: Times what the curves need, to which an axis is stretched for a band.
MOST = 3.0


def moduli_charts(
    strains: Array,
    fits: Array,
    truth: Array | None = None,
    band: Array | None = None,
    caption: str = "",
) -> Charts:
    """Return charts of E1, E2 and G12 (Fig. 4.9), with deviations from a known solution.
    strains : (3, k) logarithmic strain for E1, E2, G12, each from zero to the largest reached.
    fits : (fits, 3, k) MPa, best fit first, in the same order. truth : (3, k) MPa; a second row
    of charts then shows the deviation from it in percent. band : (2, 3, k) MPa, ends of the band
    of the first fit; not drawn where it is not finite."""
    x = 100 * strains
    charts = []
    others: dict[str, Any] = {"name": f"next {len(fits) - 1}", "colour": 6, "faint": True}
    for m, (title, label) in enumerate(PANELS):
        own = None if band is None else (band[0, m], band[1, m])
        dot = band is not None and truth is None
        series = [line("best", x[m], fits[0, m], own, ends=dot)]
        series += [line(x=x[m], y=curve, **others) for curve in fits[1:, m]]
        drawn = [fits[:, m].max()]
        if truth is not None:
            series.append(line("known", x[m], truth[m], colour=1, dashes=1))
            drawn.append(truth[m].max())
        first, *_, last = fits[0, m]
        top, cut = axis_top(1.12 * float(max(drawn)), () if own is None else own[1])
        alt = f"{title}: from {first:.3g} MPa at rest to {last:.3g} MPa at {x[m, -1]:.3g} %"
        charts.append(Chart(f"{title}{cut}", label, MODULUS, series, alt, from_zero=True, top=top))
    if truth is not None:
        percent = np.maximum(100 * np.abs(fits / truth - 1), SAME)
        for m, (title, label) in enumerate(PANELS):
            said = f"best: at most {percent[0, m].max():.2g} %"
            # Dips where curves cross say nothing.
            first, *more = np.maximum(percent[:, m], percent[:, m].max() / 10**DRAWN_DECADES)
            series = [line("best", x[m], first), *(line(x=x[m], y=y, **others) for y in more)]
            up = "deviation from known, %"
            title = f"{title}: {said}"
            charts.append(Chart(title, label, up, series, said, log_y=True))
    return Charts("moduli", charts, caption, columns=3)


def axis_top(curves: float, upper: ArrayLike) -> tuple[float, str]:
    """Return the end of the axis, and words where the band goes beyond `MOST` of the curves'."""
    band = np.asarray(upper, dtype=float)
    high = float(band[np.isfinite(band)].max(initial=0.0))
    if high <= MOST * curves:
        return max(curves, 1.04 * high), ""
    return MOST * curves, f": its band goes to {high:.3g} MPa"


def moduli_together(strains: Array, moduli: Array) -> Charts:
    """Return one chart of all three moduli, each up to its failure strain (Fig. 3.8).
    strains, moduli : (3, k) logarithmic strain from zero to failure, MPa, of E1, E2, G12. The axis
    is logarithmic where the moduli are positive and span more than a decade."""
    x = 100 * strains
    names = ("E1(ε1), warp", "E2(ε2), fill", "G12(γ12), shear")
    series = [line(name, x[m], moduli[m], colour=m, ends=True) for m, name in enumerate(names)]
    log = spans_a_decade(moduli)
    high = float(moduli.max())
    alt = f"moduli from {float(moduli.min()):.3g} to {high:.3g} MPa"
    top = None if log else 1.08 * high
    chart = Chart("", "logarithmic strain, %", MODULUS, series, alt, log, not log, top)
    return Charts("moduli together", [chart], "")


def pinned_charts(strains: ArrayLike, sigma: Mapping[str, ArrayLike], caption: str) -> Charts:
    """Return 1 sigma, % of the modulus, (3, k) by test; triangles where not determined (inf)."""
    x = 100 * np.asarray(strains, dtype=float)
    charts = []
    for m, (title, label) in enumerate(PANELS):
        series: list[Series] = []
        marks: list[Series] = []
        for rank, (name, every) in enumerate(sigma.items()):
            values = np.asarray(every, dtype=float)[m]
            lost = ~(values < NOT_DETERMINED)
            known = np.where(lost, np.nan, np.maximum(values, SMALLEST))
            series.append(line(name, x[m], known, colour=rank, dashes=rank // 8))
            if lost.any():
                # Triangles of several tests stand above each other.
                height = NOT_DETERMINED * 1.4 ** (rank + 1)
                at = dots(
                    f"{name}, not determined",
                    x[m][lost],
                    np.full(lost.sum(), height),
                    most=12,
                    colour=rank,
                    shape="triangle-up",
                )
                marks.append(at)
        level = NOT_DETERMINED if marks else None
        alt = f"uncertainty of {title} by test"
        up = "1 σ, % of the modulus"
        charts.append(Chart(title, label, up, series + marks, alt, log_y=True, level=level))
    words = f"{caption}; from {NOT_DETERMINED:g} % on a modulus is not determined: triangles"
    return Charts("pinned", charts, words)
