"""Charts of strip and biaxial tests: loads, orders of polynomials, the deformed strip."""

from __future__ import annotations

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
    """Hold the loads of one direction; a curve is a pair of elongation (mm) and load (N).

    Attributes
    ----------
    direction : str
        "warp", "fill", "bias" (or "bias45").
    models : sequence of (str, (n,), (n,))
        Name, elongation and load, best first; each may end where it likes. Where it starts above
        zero it is taken to have started unloaded at zero elongation.
    points : curve or None
        Measured, of any number of specimens, in any order.
    polynomial : curve or None
        The load curve fitted to them, on increasing elongations.
    scatter : float or None, N
        Of the specimens about their curve.
    rms : sequence of float, N
        Of each model in turn (Eqs 3.4-3.6), as far as known.
    """

    direction: str
    models: Sequence[tuple[str, ArrayLike, ArrayLike]] = ()
    points: Curve | None = None
    polynomial: Curve | None = None
    scatter: float | None = None
    rms: Sequence[float] = ()


def load_charts(name: str, curves: Sequence[StripCurves], caption: str = "") -> Charts:
    """Return loads over elongation, and differences from the polynomial, else the points."""
    # The same model has the same colour in every chart.
    names = list(dict.fromkeys(model for c in curves for model, _, _ in c.models))
    compared = [c for c in curves if c.models and (c.polynomial or c.points)]
    charts = [_loads(c, names) for c in curves] + [_differences(c, names) for c in compared]
    columns = len(curves) if len(compared) in (0, len(curves)) else 0
    return Charts(name, charts, caption, columns)


def _loads(strip: StripCurves, names: Sequence[str]) -> Chart:
    """Return loads over elongation, models in the colours of their rank among `names`."""
    series: list[Series] = []
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
    if len(strip.rms) == 1:
        title += f": RMS error {strip.rms[0]:.3g} N"
        if strip.scatter is not None:
            title += f", scatter {strip.scatter:.3g} N"
    return Chart(title, ELONGATION, "load, N", series, alt, from_zero=True)


def _differences(strip: StripCurves, names: Sequence[str]) -> Chart:
    """Return differences from the polynomial, else from the points, over elongation."""
    points = None if strip.points is None else _from_zero(*strip.points)
    series: list[Series] = []
    if strip.scatter is not None:
        elongations = np.concatenate([np.ravel(x) for _, x, _ in strip.models])
        scatter = np.full(2, strip.scatter)
        ends = [0.0, float(elongations.max())]
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
    """Return the errors of the models, "" where fewer than two are known."""
    models = zip(strip.models, strip.rms, strict=False)
    errors = [f"{name} {rms:.3g} N" for (name, *_), rms in models]
    return f": RMS error {', '.join(errors)}" if len(errors) > 1 else ""


def _from_zero(elongation: ArrayLike, load: ArrayLike) -> tuple[Array, Array]:
    """Return a curve in rising order, from the unloaded strip on."""
    x = np.atleast_1d(np.asarray(elongation, dtype=float))
    order = np.argsort(x, kind="stable")
    x = x[order]
    y = np.atleast_1d(np.asarray(load, dtype=float))[order]
    return (np.r_[0.0, x], np.r_[0.0, y]) if len(x) and x[0] > 0 else (x, y)


def _at(curve: Curve, elongation: Array) -> Array:
    """Return the load (N) of the curve there; NaN, which is not drawn, beyond its end."""
    return np.interp(elongation, *_from_zero(*curve), left=np.nan, right=np.nan)


def specimen_charts(
    curves: Mapping[str, Sequence[tuple[str, ArrayLike, ArrayLike]]],
) -> Charts:
    """Return load curves as they were read, a chart a direction: name, mm and N of specimens."""
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
    """Return RMSE and leave-one-out error (k,) N over the order; a ring is the chosen one."""
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
    """Return a strip pulled along y: true to scale, coloured by shear, over its outline at rest.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array, mm
        At rest.
    cells : (m, 4) array
        Nodes of the quads.
    displacement : (n, 2) or (n, 3) array, mm
        Of the nodes.
    gamma : (m,) array
        gamma12 of each quad, signed or its magnitude.
    ends : (2,) array
        Nodes of the virtual strain gauge.
    """
    initial = points[:, :2]
    deformed = initial + displacement[:, :2]
    edges = np.sort(np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    outline = unique[count == 1]
    series = [
        faces("", deformed[cells], gamma),
        line("at rest", *_segments(initial[outline]), colour=7, dashes=1),
        line("", *_segments(deformed[outline]), colour=3),
        *_grips(initial, deformed),
    ]
    for place, colour, words in ((initial, 7, "gauge at rest"), (deformed, 3, "gauge")):
        length = float(np.linalg.norm(np.diff(place[ends], axis=0)))
        series.append(dots(f"{words}, {length:.2f} mm", *place[ends].T, colour=colour, hollow=True))
    alt = f"the strip, its shear strain from {gamma.min():.3g} to {gamma.max():.3g}"
    chart = Chart(
        "",
        "x, mm",
        "y, mm",
        series,
        alt,
        equal=True,
        scale="shear strain γ12",
        shades=shades_of(gamma),
    )
    return Charts("strip", [chart], "")


def _segments(edges: Array) -> tuple[Array, Array]:
    """Return x and y of edges (k, 2, 2), with a gap after each."""
    gaps = np.full((len(edges), 1, 2), np.nan)
    flat = np.concatenate([edges, gaps], axis=1).reshape(-1, 2)
    return flat[:, 0], flat[:, 1]


def _grips(initial: Array, deformed: Array) -> list[Series]:
    """Return the outlines of the grips, 6 % of the strip's length in height."""
    y = initial[:, 1]
    length = float(np.ptp(y))
    top = y > y.max() - 1e-6 * length
    bottom = y < y.min() + 1e-6 * length
    series = []
    for end, height in ((top, 0.06 * length), (bottom, -0.06 * length)):
        left = deformed[end, 0].min()
        right = deformed[end, 0].max()
        edge = float(deformed[end, 1].mean())
        back = edge + height
        x = [left, left, right, right, left]
        series.append(line("grips", x, [edge, back, back, edge, edge], colour=0))
    return series


def cycle_charts(
    histories: Sequence[tuple[str, Array, Array, Sequence[tuple[int, int, int]], Curve | None]],
) -> Charts:
    """Return load over strain of histories, unloading dashed.

    Parameters
    ----------
    histories : sequence of tuples
        Name, load (n,) N, strain (n,), the rows at which each cycle begins, is highest and ends,
        and strains and loads of a model, or None.
    """
    charts = []
    for name, load, strain, rows, model in histories:
        series = []
        if model is not None:
            series.append(line("model", 100 * np.asarray(model[0]), model[1], colour=7, wide=True))
        for number, (start, peak, end) in enumerate(rows):
            up = slice(start, peak + 1)
            down = slice(peak, end + 1)
            colour = number % 6
            label = f"cycle {number + 1}"
            series.append(line(label, 100 * strain[up], load[up], colour=colour))
            series.append(line("", 100 * strain[down], load[down], colour=colour, dashes=1))
        alt = f"{name}: load over strain, cycle by cycle; unloading dashed"
        charts.append(Chart(name, "strain, %", "load, N", series, alt, from_zero=True))
    return Charts("cycles", charts, "Load over strain; unloading dashed")


def ratio_chart(
    ratio: str, load: Array, strain: Array, models: Sequence[tuple[str, Array, Array]] = ()
) -> Chart:
    """Return the strains along warp and fill over the larger load of a ratio.

    Parameters
    ----------
    ratio : str
        Such as 1:2.
    load : (n,) array, kN/m
        The larger load.
    strain : (n, 2) array, %
        Along warp and fill.
    models : sequence of (str, array, array)
        Name, loads and strains, best first.
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
