"""Charts of strip, cyclic and biaxial tests: load curves, polynomial orders, the deformed strip."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .charts import (
    TITLES,
    Array,
    Chart,
    Charts,
    Series,
    band,
    dots,
    faces,
    line,
    shades_of,
    spans_a_decade,
)

Curve = tuple[ArrayLike, ArrayLike]
Cells = NDArray[np.intp]

ELONGATION = "gauge elongation, mm"
YARNS = ("warp", "fill")


@dataclass(frozen=True, eq=False)
class StripCurves:
    """Hold the load curves of one direction: elongations of the gauge (mm) and loads (N).

    Attributes
    ----------
    direction : str
        "warp", "fill", "bias" (or "bias45").
    models : sequence of (str, (n,) array, (n,) array)
        Name, elongations and loads of each modelled curve, the best first. The curves may end at
        different elongations; before its first elongation a curve begins unloaded at zero.
    points : curve or None
        Measured elongations and loads, of any number of specimens, in any order.
    polynomial : curve or None
        Polynomial fitted to the points, at increasing elongations.
    scatter : float or None, N
        Standard deviation of the specimens' loads about the polynomial.
    rms : sequence of float or None, N
        RMS error of the load of each model in turn (Eqs 3.4 to 3.6 of the thesis), as far as
        known.
    """

    direction: str
    models: Sequence[tuple[str, ArrayLike, ArrayLike]] = ()
    points: Curve | None = None
    polynomial: Curve | None = None
    scatter: float | None = None
    rms: Sequence[float | None] = ()


def load_charts(name: str, curves: Sequence[StripCurves], caption: str = "") -> Charts:
    """Return charts of load over elongation, then of the differences from what was measured.

    Differences are from the polynomial of a direction, or from its points without a polynomial.

    Parameters
    ----------
    name : str
        Name of the figure.
    curves : sequence of StripCurves
        Curves of each direction.
    caption : str
        Caption of the figure.
    """
    # The same model has the same colour in every chart.
    names = list(dict.fromkeys(model for c in curves for model, _, _ in c.models))
    compared = [c for c in curves if c.models and (c.polynomial or c.points)]
    charts = [_loads(c, names) for c in curves] + [_differences(c, names) for c in compared]
    columns = len(curves) if len(compared) in (0, len(curves)) else 0
    return Charts(name, charts, caption, columns)


def _loads(strip: StripCurves, names: Sequence[str]) -> Chart:
    """Return a chart of load over elongation; the place of a model in `names` sets its colour."""
    series = []
    if strip.polynomial is not None:
        series.append(line("load polynomial", *strip.polynomial, colour=6, wide=True))
    if strip.points is not None:
        series.append(dots("measured", *strip.points, colour=7))
    for name, elongation, load in strip.models:
        rank = names.index(name)
        curve = _from_zero(elongation, load)
        series.append(line(name, *curve, colour=(rank + 1) % 6, dashes=rank // 6))
    title = TITLES.get(strip.direction, strip.direction)
    alt = f"{title}; load over elongation, measured and modelled"
    if len(strip.rms) == 1 and strip.rms[0] is not None:
        title += f": RMS error {strip.rms[0]:.3g} N"
        if strip.scatter is not None:
            title += f", scatter {strip.scatter:.3g} N"
    return Chart(title, ELONGATION, "load, N", series, alt, from_zero=True)


def _differences(strip: StripCurves, names: Sequence[str]) -> Chart:
    """Return a chart of the models' differences from the polynomial, or else from the points."""
    points = None if strip.points is None else _from_zero(*strip.points)
    series = []
    if strip.scatter is not None:
        elongations = np.concatenate([np.ravel(x) for _, x, _ in strip.models])
        scatter = np.full(2, strip.scatter)
        ends = [0.0, elongations.max()]
        series.append(band("scatter of specimens (±)", ends, -scatter, scatter, colour=7))
    if strip.polynomial is not None and points is not None:
        difference = points[1] - _at(strip.polynomial, points[0])
        series.append(dots("measured", points[0], difference, colour=7))
    for name, *curve in strip.models:
        rank = names.index(name)
        x, y = _from_zero(*curve)
        if strip.polynomial is not None:
            difference = y - _at(strip.polynomial, x)
            series.append(line(name, x, difference, colour=(rank + 1) % 6, dashes=rank // 6))
        elif points is not None:
            difference = _at((x, y), points[0]) - points[1]
            series.append(dots(name, points[0], difference, colour=(rank + 1) % 6))
    title = f"{TITLES.get(strip.direction, strip.direction)}{_errors(strip)}"
    label = "difference, N"
    return Chart(title, ELONGATION, label, series, f"{title}: {label}", level=0.0)


def _errors(strip: StripCurves) -> str:
    """Return the RMS errors of several models in words, "" where none is known."""
    models = zip(strip.models, strip.rms, strict=False)
    errors = [f"{name} {rms:.3g} N" for (name, *_), rms in models if rms is not None]
    return f": RMS error {', '.join(errors)}" if errors and len(strip.rms) > 1 else ""


def _from_zero(elongation: ArrayLike, load: ArrayLike) -> tuple[Array, Array]:
    """Return a curve in the order of elongation, begun at zero elongation without load."""
    x = np.array(elongation, dtype=float, ndmin=1)
    order = np.argsort(x, kind="stable")
    x = x[order]
    y = np.array(load, dtype=float, ndmin=1)[order]
    if len(x) and x[0] > 0:
        return np.r_[0.0, x], np.r_[0.0, y]
    return x, y


def _at(curve: Curve, elongation: Array) -> Array:
    """Return the load, N, of a curve at elongations, NaN beyond its end.

    Parameters
    ----------
    elongation : (n,) array, mm
    """
    return np.interp(elongation, *_from_zero(*curve), left=np.nan, right=np.nan)


def specimen_charts(
    curves: Mapping[str, Sequence[tuple[str, ArrayLike, ArrayLike]]],
) -> Charts:
    """Return charts of load curves as they were read, one chart for each direction.

    Parameters
    ----------
    curves : mapping of str to sequence of (str, (n,), (n,))
        By direction: name of a specimen, elongations, mm, and loads, N.
    """
    charts = []
    for direction, specimens in curves.items():
        series = [
            # The legend names six.
            line(name if rank < 6 else "", x, y, colour=rank, dashes=rank // 8)
            for rank, (name, x, y) in enumerate(specimens)
        ]
        alt = f"{direction}: loads of {len(series)} specimens"
        charts.append(Chart(direction, "elongation of the gauge, mm", "load, N", series, alt))
    return Charts("curves", charts, "")


def order_chart(
    direction: str, orders: Sequence[int], rmse: ArrayLike, left_out: ArrayLike, chosen: int
) -> Chart:
    """Return a chart of the errors of load polynomials over their order.

    Parameters
    ----------
    direction : str
        Direction of the strip.
    orders : sequence of int
        Orders of the polynomials.
    rmse : (orders,) array_like, N
        RMS error of each polynomial at the points it was fitted to.
    left_out : (orders,) array_like, N
        Error at points, or specimens, that were left out of the fit in turn.
    chosen : int
        Order that is used; a ring marks it.
    """
    errors = [np.asarray(values, dtype=float) for values in (rmse, left_out)]
    words = ("RMSE of the fit", "leave-one-out error")
    log = spans_a_decade(errors)
    series = [
        line(name, orders, values, colour=k, marks=True)
        for k, (name, values) in enumerate(zip(words, errors, strict=True))
    ]
    if chosen in orders:
        errors_there = [values[list(orders).index(chosen)] for values in errors]
        series.append(dots("chosen order", [chosen] * 2, errors_there, colour=3, hollow=True))
    title = f"{TITLES.get(direction, direction)}: order {chosen}"
    axes = "order of the polynomial", "error of the load, N"
    return Chart(title, *axes, series, title, log_y=log, from_zero=not log)


def strip_charts(
    points: Array, cells: Cells, displacement: Array, gamma: Array, ends: Cells
) -> Charts:
    """Return a drawing of a strip that is pulled along y, coloured by its shear strain.

    The drawing is true to scale, and shows the outline at rest, the grips and the gauge.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array, mm
        Nodes at rest.
    cells : (m, 4) array of int
        Indices of the nodes of each quad.
    displacement : (n, 2) or (n, 3) array, mm
        Displacement of the nodes.
    gamma : (m,) array
        Shear strain gamma12 of each quad between warp and fill, signed or its magnitude.
    ends : (2,) array of int
        Indices of the nodes at the ends of the virtual strain gauge.
    """
    initial = points[:, :2]
    deformed = initial + displacement[:, :2]
    following = np.roll(cells, -1, axis=1)
    edges = np.stack([cells, following], axis=-1).reshape(-1, 2)
    unique, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    outline = unique[count == 1]  # an edge within the strip belongs to two quads
    series = [
        faces(deformed[cells], 100 * gamma),
        line("at rest", *_segments(initial[outline]), colour=7, dashes=1),
        line("", *_segments(deformed[outline]), colour=3),
        *_grips(initial, deformed),
    ]
    for place, colour, words in ((initial, 7, "gauge at rest"), (deformed, 3, "gauge")):
        length = np.linalg.norm(np.diff(place[ends], axis=0))
        series.append(dots(f"{words}, {length:.2f} mm", *place[ends].T, colour=colour, hollow=True))
    extent = f"{100 * gamma.min():.3g} to {100 * gamma.max():.3g} %"
    alt = f"the strip, its shear strain from {extent}"
    chart = Chart(
        "",
        "x, mm",
        "y, mm",
        series,
        alt,
        equal=True,
        scale="shear strain γ12, %",
        shades=shades_of(gamma),
    )
    return Charts("strip", [chart], "")


def _segments(edges: Array) -> tuple[Array, Array]:
    """Return x and y of the end points of edges (k, 2, 2), with NaN between the edges."""
    gaps = np.full((len(edges), 1, 2), np.nan)
    flat = np.concatenate([edges, gaps], axis=1).reshape(-1, 2)
    return flat[:, 0], flat[:, 1]


def _grips(initial: Array, deformed: Array) -> list[Series]:
    """Return the outlines of the two grips, each as high as 6 % of the strip's length.

    Parameters
    ----------
    initial, deformed : (nodes, 2) array, mm
        Positions of the nodes before and under the load.
    """
    y = initial[:, 1]
    length = np.ptp(y)
    is_top = y > y.max() - 1e-6 * length
    is_bottom = y < y.min() + 1e-6 * length
    series = []
    for is_at_end, height in ((is_top, 0.06 * length), (is_bottom, -0.06 * length)):
        left = deformed[is_at_end, 0].min()
        right = deformed[is_at_end, 0].max()
        edge = deformed[is_at_end, 1].mean()
        back = edge + height
        x = [left, left, right, right, left]
        series.append(line("grips", x, [edge, back, back, edge, edge], colour=0))
    return series


#: Name, loads, N, strains, indices of begin, largest load and end of each cycle, and strains and
#: loads of a model.
CyclicCurve = tuple[str, Array, Array, Sequence[tuple[int, int, int]], Curve | None]


def cycle_charts(histories: Sequence[CyclicCurve]) -> Charts:
    """Return charts of load over strain of cyclic tests, one for each history of loads.

    Unloading is dashed.

    Parameters
    ----------
    histories : sequence of tuples
        Name, loads (n,), N, and strains (n,); for each cycle the indices at which it begins, has
        its largest load and ends; and strains and loads, N, of a model, or None.
    """
    charts = []
    for name, load, strain, cycles, model in histories:
        series = []
        if model is not None:
            series.append(line("model", 100 * np.asarray(model[0]), model[1], colour=7, wide=True))
        for number, (start, peak, end) in enumerate(cycles):
            loading = slice(start, peak + 1)
            unloading = slice(peak, end + 1)
            colour = number % 6
            label = f"cycle {number + 1}"
            series.append(line(label, 100 * strain[loading], load[loading], colour=colour))
            series.append(
                line("", 100 * strain[unloading], load[unloading], colour=colour, dashes=1)
            )
        alt = f"{name}: load over strain, cycle by cycle; unloading dashed"
        charts.append(Chart(name, "strain, %", "load, N", series, alt, from_zero=True))
    return Charts("cycles", charts, "Load over strain; unloading dashed")


def ratio_chart(
    ratio: str, load: Array, strain: Array, models: Sequence[tuple[str, Array, Array]] = ()
) -> Chart:
    """Return a chart of the strains along warp and fill in a biaxial test at one load ratio.

    Parameters
    ----------
    ratio : str
        Ratio of the loads along warp and fill, such as 1:2.
    load : (n,) array, kN/m
        The larger of both loads.
    strain : (n, 2) array, %
        Measured strains along warp and fill.
    models : sequence of (str, (k,) array, (k, 2) array)
        Name, larger loads, kN/m, and strains, %, of each model, the best first.
    """
    series = [
        dots(f"{yarn}, measured", load, strain[:, k], colour=k) for k, yarn in enumerate(YARNS)
    ]
    series += [
        line(f"{yarn}, {name}", loads, strains[:, k], colour=k, dashes=rank)
        for rank, (name, loads, strains) in enumerate(models)
        for k, yarn in enumerate(YARNS)
    ]
    alt = f"ratio {ratio}: strains along warp and fill over the larger load"
    return Chart(f"ratio {ratio}", "larger load, kN/m", "strain, %", series, alt)
