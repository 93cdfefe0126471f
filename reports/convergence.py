"""Change under refinement, and its price, in logarithmic axes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike

from .loads import TITLES
from .style import DASHES, GREY, NAMED, legend_above, new_figure, pressure_colours, quiet, save

#: Percent; a smaller change is the solver's tolerance, and would only stretch the axis.
SMALLEST = 1e-5
#: A ratio of the ends of an axis below which 2 and 5 are labelled beside 1.
DENSE = 100.0
#: Quantities at one load or place after the other.
SERIES = r"apex at |load at \d"
SIZES = {"elements": "mean edge, mm", "increments": "step, share of the load"}


@dataclass(frozen=True, eq=False)
class ConvergencePanel:
    """One model.

    Parameters
    ----------
    sizes : (levels,) coarse to fine.
    changes : by quantity, (levels - 1,) percent, from each level to the next finer one.
    work, seconds : (levels,) element-increments and wall clock.
    """

    name: str
    sizes: Sequence[float]
    changes: Mapping[str, Sequence[float]]
    work: Sequence[float]
    seconds: Sequence[float]


def plot_convergence(path: Path | str, models: Sequence[ConvergencePanel], what: str) -> Path:
    """Draw the change from each level to the next against size, one panel a model, and the cost.

    A change that falls like size^p lies on a straight line of slope p; dashes show 1 and 2.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    what : "elements" or "increments".

    Raises
    ------
    ValueError : no models. OutputError : the file cannot be written.
    """
    if not models:
        raise ValueError("plot_convergence: no models to draw")
    names = list(dict.fromkeys(name for model in models for name in model.changes))
    looks = _looks(names)
    figure = new_figure(4.2 + 3.4 * len(models), 4.4)
    drawn = figure.subplots(1, len(models) + 1, squeeze=False)[0]
    for column, (axes, model) in enumerate(zip(drawn, models, strict=False)):
        _changes(axes, model, looks)
        title = TITLES.get(model.name, model.name)
        label = "change to the next finer level, %" if column == 0 else ""
        quiet(axes, SIZES[what], label, title)
    cost = drawn[-1]
    for model, colour in zip(models, cycle(NAMED), strict=False):
        label = TITLES.get(model.name, model.name)
        cost.plot(model.work, model.seconds, "o-", color=colour, label=label)
    _logarithmic(cost)
    quiet(cost, "elements x increments", "seconds", "cost")
    if len(models) > 1:
        cost.legend(frameon=False, fontsize=9)
    entries = {name: Line2D([], [], marker="o", **look) for name, look in looks.items()}
    guides = {f"order {p}": Line2D([], [], **_guide(p)) for p in (1, 2)}
    legend_above(figure, {**entries, **guides}, 2 + len(models))
    return save(figure, path)


def _changes(axes: Axes, model: ConvergencePanel, looks: Mapping[str, dict[str, Any]]) -> None:
    sizes = np.asarray(model.sizes[:-1], dtype=float)
    seen = []
    for name, values in model.changes.items():
        change = np.asarray(values, dtype=float)
        there = change > SMALLEST
        axes.plot(sizes[there], change[there], marker="o", markersize=5, **looks[name])
        seen += [change[there]]
    known = np.concatenate(seen) if seen else np.zeros(0)
    if not len(known):
        words = f"no change above {SMALLEST:g} %"
        axes.text(0.5, 0.5, words, transform=axes.transAxes, ha="center", color=GREY)
        axes.set(xticks=[], yticks=[])
        return
    for p in (1, 2):
        axes.plot(sizes, 1.6 * known.max() * (sizes / sizes.max()) ** p, **_guide(p))
    _logarithmic(axes)


def _guide(order: int) -> dict[str, Any]:
    return {"color": GREY, "linewidth": 1.0, "linestyle": DASHES[1 if order == 1 else 2]}


def _looks(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Light to dark along a series of pressures or deflections, named colours for the rest."""
    series = [name for name in names if re.match(SERIES, name)]
    shades = dict(zip(series, pressure_colours(len(series)), strict=True))
    others = cycle(NAMED)
    return {
        name: {"color": shades[name] if name in shades else next(others), "linewidth": 1.5}
        for name in names
    }


def _logarithmic(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(_plain))
        axis.set_minor_formatter(NullFormatter())
        low, high = axis.get_view_interval()
        if high < DENSE * low:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))


def _plain(value: float, _: ArrayLike) -> str:
    return f"{value:g}"
