"""Charts as plain data, which `vega` draws on the page and as files.

Their fields are the layout of page.json: who changes it raises `content.LAYOUT`.
The classes and functions up to `axis_ends` serve charts of any kind; those after it draw tangent
moduli over strain: of fits, with their bands, and with their uncertainty by test.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from math import isfinite, log10
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..inference.reported import LARGEST_SIGMA
from ..materials.forms.base import COMPONENTS, LawForm
from ..materials.forms.symmetry import modulus_labels

Array = NDArray[np.float64]
Numbers = Sequence[float | None]
#: Colour scale of values: from the least to the largest value, or diverging about zero.
Shades = Literal["from least", "about zero"]
Look = Literal["line", "dots", "band", "faces"]

#: Largest number of dots drawn of one series; longer series are thinned evenly.
MAX_POINTS = 400
#: Titles of directions of strips whose name is not their title.
TITLES = {"bias": "45° bias", "bias45": "45° bias"}


@dataclass(frozen=True)
class Series:
    """Hold one curve, band, cloud of points or set of coloured faces of a chart.

    Attributes
    ----------
    name : str
        Name in the legend, "" for no entry.
    x, y : (n,) numbers
        Coordinates in the units of the axes; None where there is no value. Of faces, the corners
        of one after those of the other.
    lower, upper : (n,) numbers
        Ordinates of the ends of a band about a curve, or of error bars through dots.
    look : {"line", "dots", "band", "faces"}
        What is drawn; "band" is a band without a curve, "faces" are filled polygons.
    colour : int
        Index in the palette (`vega.PALETTE`).
    rank : float or None
        Place from 0 to 1 along the colours of rising loads (`vega.RISING`), which then replaces
        `colour`.
    dashes : int
        Index of the dash pattern (`vega.DASHES`), 0 for a solid line.
    ends : bool
        Whether there is a dot at the end of the curve.
    faint : bool
        Whether the curve is thin, pale and behind the others.
    marks : bool
        Whether there is a dot at every value of a line.
    values : (n,) or (faces,) numbers
        Values that colour each dot or face by the chart's colour scale.
    shape : str
        Vega's name of the symbol of a dot.
    wide : bool
        Whether the curve is thick, pale and behind the others.
    hollow : bool
        Whether dots are rings.
    """

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
    """Hold one pair of axes with what is drawn on them.

    Attributes
    ----------
    title, x_label, y_label : str
        Heading, and labels of the axes, which name the units.
    series : sequence of Series
        Curves, bands, dots and faces in the order of the legend.
    alt : str
        Description in words for those who cannot see the chart.
    log_x, log_y : bool
        Whether an axis is logarithmic.
    from_zero : bool
        Whether the y axis begins at zero.
    top : float or None
        Upper end of the y axis, where a band may be wider than is worth showing; None for an axis
        that holds everything drawn.
    level : float or None
        Ordinate of a horizontal line, None for no line.
    y_names : sequence of str
        Names that stand at y = 1, 2, ... from the top down, in place of numbers.
    equal : bool
        Whether both axes have the same scale, as a drawing true to scale needs.
    scale : str
        Label of the colour scale of `Series.values`, with its unit.
    shades : {"from least", "about zero"}
        Kind of the colour scale.
    ends : two floats or None
        Values of the first and the last colour; None for those of the data.
    x_range, y_range : two floats or None
        Ends of an axis; None for an axis that holds all data.
    """

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
    y_names: Sequence[str] = ()
    equal: bool = False
    scale: str = ""
    shades: Shades = "from least"
    ends: tuple[float, float] | None = None
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True)
class Charts:
    """Hold a figure: charts that belong together, with one caption.

    Attributes
    ----------
    name : str
        Name that tells the figure from others of its page, such as "moduli"; pages that are shown
        side by side merge figures of the same name.
    charts : sequence of Chart
        Charts in the order in which they are shown.
    caption : str
        Text below the figure.
    columns : int
        Number of charts in a row of a file; 0 for up to three.
    part : "charts"
        Names the class in page.json.
    """

    name: str
    charts: Sequence[Chart]
    caption: str
    columns: int = 0
    part: Literal["charts"] = "charts"


def numbers(values: ArrayLike) -> list[float | None]:
    """Return values of any shape as a flat list, with six digits; None for what is not finite."""
    flat = np.asarray(values, dtype=float).ravel().tolist()
    return [float(f"{v:.6g}") if isfinite(v) else None for v in flat]


def line(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    band: tuple[ArrayLike, ArrayLike] | None = None,
    **look: Any,
) -> Series:
    """Return a curve.

    Parameters
    ----------
    name : str
        Name in the legend, "" for no entry.
    x, y : (n,) array_like
        Coordinates in the units of the axes.
    band : two (n,) array_like, optional
        Lower and upper ends of a band about the curve.
    **look
        Further fields of `Series`.
    """
    lower = [] if band is None else numbers(band[0])
    upper = [] if band is None else numbers(band[1])
    return Series(name, numbers(x), numbers(y), lower, upper, **look)


def band(name: str, x: ArrayLike, lower: ArrayLike, upper: ArrayLike, **look: Any) -> Series:
    """Return a band without a curve.

    Parameters
    ----------
    name : str
        Name in the legend, "" for no entry.
    x, lower, upper : (n,) array_like
        Abscissae, and ordinates of both ends, in the units of the axes.
    **look
        Further fields of `Series`.
    """
    return Series(name, numbers(x), (), numbers(lower), numbers(upper), "band", **look)


def dots(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    bars: tuple[ArrayLike, ArrayLike] | None = None,
    max_points: int = MAX_POINTS,
    values: ArrayLike = (),
    **look: Any,
) -> Series:
    """Return a series of dots, thinned evenly where there are many.

    Parameters
    ----------
    name : str
        Name in the legend, "" for no entry.
    x, y : (n,) array_like
        Coordinates in the units of the axes.
    bars : two (n,) array_like, optional
        Lower and upper ends of error bars.
    max_points : int
        Largest number of dots that are drawn: of more, every second, third ... is.
    values : (n,) array_like
        Values that colour the dots by the chart's colour scale, none by default.
    **look
        Further fields of `Series`.
    """
    step = max(1, -(-np.size(x) // max_points))
    thinned = slice(None, None, step)
    lower = []
    upper = []
    if bars is not None:
        lower = numbers(bars[0])[thinned]
        upper = numbers(bars[1])[thinned]
    return Series(
        name,
        numbers(x)[thinned],
        numbers(y)[thinned],
        lower,
        upper,
        look="dots",
        values=numbers(values)[thinned],
        **look,
    )


def faces(corners: ArrayLike, values: ArrayLike) -> Series:
    """Return a series of filled polygons that are coloured by values, without an entry in a legend.

    Parameters
    ----------
    corners : (faces, k, 2) array_like
        Corners of each polygon in the units of the axes.
    values : (faces,) array_like
        Value of each polygon on the chart's colour scale.
    """
    points = np.asarray(corners, dtype=float)
    x = numbers(points[..., 0])
    y = numbers(points[..., 1])
    return Series("", x, y, look="faces", values=numbers(values))


def spans_a_decade(values: ArrayLike) -> bool:
    """Return whether the finite values are all positive and span more than a decade.

    A logarithmic axis is then easier to read than a linear one.
    """
    finite = np.asarray(values, dtype=float).ravel()
    finite = finite[np.isfinite(finite)]
    return bool(len(finite) and finite.min() > 0 and finite.max() > 10.0 * finite.min())


def shades_of(values: ArrayLike) -> Shades:
    """Return the kind of colour scale for values: "about zero" where both signs matter.

    They do where the lesser of the largest values of both signs is above 5 % of the greater.
    """
    low = np.nanmin(values)
    high = np.nanmax(values)
    has_both_signs = min(-low, high) > 0.05 * max(abs(low), abs(high))
    return "about zero" if has_both_signs else "from least"


def ends_of(values: Array, shades: Shades) -> tuple[float, float]:
    """Return the least and the largest value of a colour scale that holds all finite values."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0, 1.0
    if shades == "about zero":
        largest = np.abs(finite).max() or 1.0
        return -largest, largest
    low = finite.min()
    high = finite.max()
    return (low, high) if high > low else (low, low + 1.0)


def scale_ends(chart: Chart) -> tuple[float, float]:
    """Return the least and the largest value of a chart's colour scale."""
    if chart.ends is not None:
        return chart.ends
    values = [np.array(s.values, dtype=float) for s in chart.series if s.values]
    return ends_of(np.concatenate(values) if values else np.zeros(0), chart.shades)


def looks_of(charts: Sequence[Chart]) -> Mapping[str, Series] | None:
    """Return the first series of each name, for a legend that several charts share.

    None where two series of one name look different, so that every chart needs its own legend.
    """
    looks: dict[str, Series] = {}
    for s in (s for chart in charts for s in chart.series if s.name):
        first = looks.setdefault(s.name, s)
        if _look(s) != _look(first) and s.look == first.look:
            return None
    return looks


def _look(s: Series) -> tuple[object, ...]:
    """Return colour, dashes and symbol, which tell a series from others in a legend."""
    return s.colour if s.rank is None else s.rank, s.dashes, s.shape, s.hollow


def axis_ends(chart: Chart) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ends of the x and of the y axis, with a small margin about the data."""
    if chart.y_names:
        return _x_ends(chart), (len(chart.y_names) + 0.5, 0.5)
    return _x_ends(chart), chart.y_range or _y_ends(chart)


def _x_ends(chart: Chart) -> tuple[float, float]:
    """Return the ends of an x axis that holds all data, or those that the chart sets."""
    if chart.x_range is not None:
        return chart.x_range
    has_symbols = any(s.look != "line" or s.marks for s in chart.series)
    values = _showable((s.x for s in chart.series), chart.log_x)
    return _ends(values, chart.log_x, 0.02 if has_symbols else 0.0)


def _y_ends(chart: Chart) -> tuple[float, float]:
    """Return the ends of a y axis that holds all data, up to the chart's `top` if it has one."""
    values = _showable((s.y for s in chart.series), chart.log_y)
    if chart.top is None:
        values += _showable((s.lower for s in chart.series), chart.log_y)
        values += _showable((s.upper for s in chart.series), chart.log_y)
    if chart.level is not None:
        values.append(chart.level)
    low, high = _ends(values, chart.log_y, 0.05)
    may_begin_at_zero = not chart.log_y and not chart.equal and min(values, default=0.0) >= 0
    if may_begin_at_zero and (chart.from_zero or low < 0.25 * high):
        low = 0.0
    if chart.top is not None:
        high = max(chart.top, low + 1e-12)
    return low, high


def _showable(columns: Iterable[Numbers], log: bool) -> list[float]:
    """Return the numbers that an axis can show: on a logarithmic one, positive numbers."""
    return [v for column in columns for v in column if v is not None and (v > 0 or not log)]


def _ends(values: list[float], log: bool, margin: float) -> tuple[float, float]:
    """Return the ends of an axis, with a margin beyond the data as a share of their range."""
    if not values:
        return (1.0, 10.0) if log else (0.0, 1.0)
    low = min(values)
    high = max(values)
    if log:
        factor = max((high / low) ** margin, 1.0 if high > low else 2.0)
        # An axis of less than a third of a decade has hardly a number to read.
        while log10(high * factor / (low / factor)) < 0.35:
            factor *= 1.2
        return low / factor, high * factor
    span = high - low
    space = margin * span if span > 0 else 0.5 * abs(high) or 0.5
    return low - space, high + space


#: Titles of the charts of E1, E2 and G12, and labels of their axes of strain.
PANELS = (
    ("E1, along the warp", "logarithmic strain ε1, %"),
    ("E2, along the fill", "logarithmic strain ε2, %"),
    ("G12, in shear", "shear strain γ12, %"),
)
MODULUS = "tangent modulus, MPa"
#: Standard deviation, % of a modulus, from which on it counts as not determined.
NOT_DETERMINED = 100 * LARGEST_SIGMA


def moduli_charts(
    strains: Array,
    fits: Array,
    truth: Array | None = None,
    band: Array | None = None,
    caption: str = "",
) -> Charts:
    """Return charts of E1, E2 and G12 over strain (Fig. 4.9 of the thesis).

    With a known solution a second row of charts shows the deviations from it.

    Parameters
    ----------
    strains : (3, k) array
        Logarithmic strain for E1, E2 and G12, each from zero to the largest reached.
    fits : (fits, 3, k) array, MPa
        E1, E2 and G12 of each fit, the best fit first.
    truth : (3, k) array, MPa, optional
        Known moduli; the deviation from them is drawn in percent.
    band : (2, 3, k) array, MPa, optional
        Lower and upper ends of the band of the best fit; not drawn where it is not finite.
    caption : str
        Caption of the figure.
    """
    x = 100 * strains
    charts = []
    next_fits: dict[str, Any] = {"name": f"next {len(fits) - 1}", "colour": 6, "faint": True}
    for m, (title, label) in enumerate(PANELS):
        ends = None if band is None else (band[0, m], band[1, m])
        has_end = band is not None and truth is None
        series = [line("best", x[m], fits[0, m], ends, ends=has_end)]
        series += [line(x=x[m], y=curve, **next_fits) for curve in fits[1:, m]]
        largest = fits[:, m].max()
        if truth is not None:
            series.append(line("known", x[m], truth[m], colour=1, dashes=1))
            largest = max(largest, truth[m].max())
        first, *_, last = fits[0, m]
        top, cut = axis_top(1.12 * largest, () if ends is None else ends[1])
        alt = f"{title}: from {first:.3g} MPa at rest to {last:.3g} MPa at {x[m, -1]:.3g} %"
        charts.append(Chart(f"{title}{cut}", label, MODULUS, series, alt, from_zero=True, top=top))
    if truth is not None:
        # Zero cannot stand on a logarithmic axis: 1e-10 % is the precision of the machine.
        deviation = np.maximum(100 * np.abs(fits / truth - 1), 1e-10)
        for m, (title, label) in enumerate(PANELS):
            words = f"best: at most {deviation[0, m].max():.2g} %"
            # Dips where curves cross say nothing: seven decades are drawn.
            best, *curves = np.maximum(deviation[:, m], deviation[:, m].max() / 1e7)
            series = [line("best", x[m], best)]
            series += [line(x=x[m], y=curve, **next_fits) for curve in curves]
            axis = "deviation from known, %"
            heading = f"{title.partition(',')[0]}, {words}"
            charts.append(Chart(heading, label, axis, series, words, log_y=True))
    return Charts("moduli", charts, caption, columns=3)


def charts_of_labelled_moduli(charts: Charts, form: LawForm) -> Charts:
    """Return the charts of moduli that follow from no others, titled with their labels.

    Parameters
    ----------
    charts : Charts
        One of each modulus, or several times one of each.
    form : LawForm
    """
    labels = modulus_labels(form)
    shown = []
    for name, chart in zip(cycle(COMPONENTS), charts.charts):
        if name in labels and labels[name] == name:
            shown.append(chart)
        elif name in labels:
            title, alt = (
                re.sub(rf"\b{name}(, along the warp)?", labels[name], words, count=1)
                for words in (chart.title, chart.alt)
            )
            shown.append(replace(chart, title=title, alt=alt))
    return replace(charts, charts=shown, columns=len(labels))


def axis_top(curves: float, upper: ArrayLike) -> tuple[float, str]:
    """Return the upper end of an axis of moduli that a wide band does not stretch too far.

    Parameters
    ----------
    curves : float, MPa
        Upper end that the curves alone need; a band stretches it to three times that at most.
    upper : (k,) array_like, MPa
        Upper end of the band at each strain.

    Returns
    -------
    float, str
        Upper end of the axis, MPa, and words for the chart's title where the band goes beyond
        it, else "".
    """
    band = np.asarray(upper, dtype=float)
    high = band[np.isfinite(band)].max(initial=0.0)
    if high <= 3.0 * curves:
        return max(curves, 1.04 * high), ""
    return 3.0 * curves, f": its band goes to {high:.3g} MPa"


def moduli_together(strains: Array, moduli: Array) -> Charts:
    """Return one chart of all three moduli, each up to its failure strain (Fig. 3.8 of the thesis).

    The axis is logarithmic where the moduli are positive and span more than a decade.

    Parameters
    ----------
    strains : (3, k) array
        Logarithmic strain from zero to failure, for E1, E2 and G12.
    moduli : (3, k) array, MPa
        E1, E2 and G12.
    """
    x = 100 * strains
    names = ("E1(ε1), warp", "E2(ε2), fill", "G12(γ12), shear")
    series = [line(name, x[m], moduli[m], colour=m, ends=True) for m, name in enumerate(names)]
    log = spans_a_decade(moduli)
    high = moduli.max()
    alt = f"moduli from {moduli.min():.3g} to {high:.3g} MPa"
    top = None if log else 1.08 * high
    chart = Chart(
        "",
        "logarithmic strain, %",
        MODULUS,
        series,
        alt,
        log_y=log,
        from_zero=not log,
        top=top,
    )
    return Charts("moduli together", [chart], "")


def pinned_charts(strains: ArrayLike, sigma: Mapping[str, Array], caption: str) -> Charts:
    """Return charts of the uncertainty of E1, E2 and G12 by each test alone, and by all tests.

    Parameters
    ----------
    strains : (3, k) array_like
        Logarithmic strain for E1, E2 and G12.
    sigma : mapping of str to (3, k) array, %
        One standard deviation of E1, E2 and G12 by name of the test; triangles mark where it
        is `NOT_DETERMINED` or more, or not finite.
    caption : str
        Caption of the figure.
    """
    x = 100 * np.asarray(strains, dtype=float)
    charts = []
    for m, (title, label) in enumerate(PANELS):
        curves = []
        triangles = []
        for rank, (name, moduli) in enumerate(sigma.items()):
            values = moduli[m]
            is_unknown = ~(values < NOT_DETERMINED)
            # Nothing is known better than to 0.001 %, and a zero has to stand somewhere.
            drawn_values = np.where(is_unknown, np.nan, np.maximum(values, 1e-3))
            curves.append(line(name, x[m], drawn_values, colour=rank, dashes=rank // 8))
            if is_unknown.any():
                # Triangles of several tests stand above each other, at even distances on the
                # logarithmic axis.
                height = NOT_DETERMINED * 1.4 ** (rank + 1)
                triangle = dots(
                    f"{name}, not determined",
                    x[m][is_unknown],
                    np.full(is_unknown.sum(), height),
                    max_points=12,
                    colour=rank,
                    shape="triangle-up",
                )
                triangles.append(triangle)
        level = NOT_DETERMINED if triangles else None
        alt = f"uncertainty of {title} by test"
        axis = "1 σ, % of the modulus"
        series = curves + triangles
        charts.append(Chart(title, label, axis, series, alt, log_y=True, level=level))
    words = f"{caption}; from {NOT_DETERMINED:g} % on a modulus is not determined: triangles"
    return Charts("pinned", charts, words)
