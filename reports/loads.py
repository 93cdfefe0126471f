"""Load against gauge elongation of strip tests (Fig. 3.7; Figs 5.10-5.12 with several cards)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from .style import BLACK, GREY, SKY, legend_above, named_look, new_figure, quiet, save

Array = NDArray[np.float64]
Curve = tuple[ArrayLike, ArrayLike]

#: Titles of the panels by name of the direction; others stand as they are.
TITLES = {"bias": "45° bias", "bias45": "45° bias"}
#: What the errors of a panel are of.
ERROR_OF = {"bias45": "bias"}
DOTS: dict[str, Any] = {
    "color": GREY,
    "marker": "o",
    "markersize": 3.2,
    "linestyle": "",
    "alpha": 0.8,
}
POLYNOMIAL: dict[str, Any] = {"color": SKY, "linewidth": 6, "alpha": 0.5}


@dataclass(frozen=True, eq=False)
class StripCurves:
    """What one panel of `plot_loads` shows; a curve is a pair of elongation (mm) and load (N).

    Parameters
    ----------
    direction : "warp", "fill", "bias" (or "bias45").
    models : (name, elongation, load), best first; each may end where it likes. Where it starts
        above zero it is taken to have started unloaded at zero elongation.
    points : measured, of any number of specimens, in any order.
    polynomial : the load curve fitted to them, on increasing elongations.
    scatter : N, of the specimens about their curve.
    rms : N, of each model in turn (Eqs 3.4-3.6), as far as known.
    """

    direction: str
    models: Sequence[tuple[str, ArrayLike, ArrayLike]] = ()
    points: Curve | None = None
    polynomial: Curve | None = None
    scatter: float | None = None
    rms: Sequence[float] = ()


def plot_loads(path: Path | str, curves: Sequence[StripCurves]) -> Path:
    """Draw the loads of each strip, and beneath them what the models miss.

    The lower row is the difference from the polynomial, with the measured points' own differences
    as dots; from the points where there is no polynomial. It is left out where no strip has
    either, and ends where model or target end.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    curves : one a panel.

    Raises
    ------
    ValueError : no curves.
    OutputError : the file cannot be written.
    """
    if not curves:
        raise ValueError("plot_loads: no strips to draw")
    rows = 2 if any(c.polynomial or c.points for c in curves) else 1
    figure = new_figure(1.0 + 3.6 * max(len(curves), 1.4), 3.8 if rows == 1 else 5.8)
    panels = figure.subplots(
        rows, len(curves), squeeze=False, sharex="col", height_ratios=[1.8, 1.0][:rows]
    )
    # The same model has the same colour in every panel.
    names = list(dict.fromkeys(name for c in curves for name, _, _ in c.models))
    for column, strip in enumerate(curves):
        first, bare = column == 0, rows == 1 or not (strip.polynomial or strip.points)
        looks = [named_look(names.index(name)) for name, _, _ in strip.models]
        top = panels[0, column]
        _loads(top, strip, looks)
        along = "gauge elongation, mm"
        title = TITLES.get(strip.direction, strip.direction)
        quiet(top, along if bare else "", "load, N" if first else "", title)
        top.tick_params(labelbottom=bare)
        if rows == 2 and bare:
            panels[1, column].set_axis_off()
        elif rows == 2:
            _differences(panels[1, column], strip, looks)
            beside = "difference, N" if first else ""
            quiet(panels[1, column], along, beside)
    legend_above(figure, _entries(curves, names), max(2, int(figure.get_figwidth() / 2.3)))
    return save(figure, path)


def _loads(axes: Axes, strip: StripCurves, looks: Sequence[dict[str, Any]]) -> None:
    if strip.points:
        axes.plot(*strip.points, **DOTS)
    if strip.polynomial:
        axes.plot(*strip.polynomial, **POLYNOMIAL)
    lines = [
        axes.plot(*_from_zero(elongation, load), linewidth=1.5, **look)[0]
        for (_, elongation, load), look in zip(strip.models, looks, strict=True)
    ]
    # From zero, unless a machine's slack was recorded before it.
    before = np.min(np.asarray(strip.points[0], dtype=float), initial=0.0) if strip.points else 0.0
    axes.set_xlim(left=float(before))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    if len(strip.rms):
        of = ERROR_OF.get(strip.direction, strip.direction)
        values = [f"{e:.3g} N" for e in strip.rms]
        # A legend finds the place that the curves leave free.
        axes.legend(
            lines[: len(values)], values, title=f"RMS error, {of}",
            title_fontsize=9, fontsize=9, framealpha=0.85, edgecolor="none",
        )  # fmt: skip


def _differences(axes: Axes, strip: StripCurves, looks: Sequence[dict[str, Any]]) -> None:
    if strip.scatter is not None:
        axes.axhspan(-strip.scatter, strip.scatter, color="#E0E0E0", linewidth=0, zorder=0)
    axes.axhline(0.0, color=BLACK, linewidth=0.8, zorder=1)
    if strip.polynomial and strip.points:
        elongation, load = _from_zero(*strip.points)
        axes.plot(elongation, load - _at(strip.polynomial, elongation), **DOTS)
    for (_, *model), look in zip(strip.models, looks, strict=True):
        curve = _from_zero(*model)
        if strip.polynomial:
            elongation, load = curve
            axes.plot(elongation, load - _at(strip.polynomial, elongation), linewidth=1.5, **look)
        elif strip.points:
            elongation, load = _from_zero(*strip.points)
            dots = {**DOTS, "color": look["color"], "zorder": look["zorder"]}
            axes.plot(elongation, _at(curve, elongation) - load, **dots)


def _from_zero(elongation: ArrayLike, load: ArrayLike) -> tuple[Array, Array]:
    """In rising order, from the unloaded strip on."""
    x, y = np.asarray(elongation, dtype=float), np.asarray(load, dtype=float)
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    return (np.r_[0.0, x], np.r_[0.0, y]) if len(x) and x[0] > 0 else (x, y)


def _at(curve: Curve, elongation: Array) -> Array:
    """Load (N) of the curve there; NaN, which is not drawn, beyond its end."""
    x, y = _from_zero(*curve)
    return np.interp(elongation, x, y, left=np.nan, right=np.nan)


def _entries(curves: Sequence[StripCurves], names: Sequence[str]) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    if any(c.points for c in curves):
        entries["measured"] = Line2D([], [], **DOTS)
    if any(c.polynomial for c in curves):
        entries["polynomial"] = Line2D([], [], **POLYNOMIAL)
    for rank, name in enumerate(names):
        entries[name] = Line2D([], [], linewidth=1.5, **named_look(rank))
    if any(c.scatter is not None and (c.polynomial or c.points) for c in curves):
        entries["scatter of specimens (±)"] = Patch(color="#E0E0E0")
    return entries
