"""Sensitivity to Poisson's ratio."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from .loads import TITLES
from .style import BLACK, GREY, NAMED, legend_above, new_figure, pressure_colours, quiet, save


def plot_nu12(
    path: Path | str,
    models: Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]],
    base: float,
    response: str,
) -> Path:
    """Draw responses relative to that at the base nu12, one panel a model.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    models : by name of the model and of the response, nu12 and ratio, (n,) each; a ratio that is
        not finite is a gap.
    base : nu12 where the ratio is one.
    response : what it is, for the axis.

    Raises
    ------
    ValueError : no models. OutputError : the file cannot be written.
    """
    if not models:
        raise ValueError("plot_nu12: no models to draw")
    names = list(dict.fromkeys(name for lines in models.values() for name in lines))
    # A series of pressures goes from light to dark; few lines are told apart by colour.
    shades = pressure_colours(len(names)) if len(names) > len(NAMED) - 2 else list(NAMED)
    colours = dict(zip(names, shades, strict=False))
    figure = new_figure(1.6 + 3.4 * max(len(models), 1.6), 4.2)
    panels = figure.subplots(1, len(models), squeeze=False, sharey=True)[0]
    for column, (axes, (model, lines)) in enumerate(zip(panels, models.items(), strict=True)):
        axes.axhline(1.0, color=GREY, linewidth=0.8)
        for name, (nu12, ratio) in lines.items():
            x, y = np.asarray(nu12, dtype=float), np.asarray(ratio, dtype=float)
            axes.plot(x, y, marker="o", markersize=4.5, linewidth=1.4, color=colours[name])
        axes.plot([base], [1.0], marker="D", markersize=6, color=BLACK, linestyle="", zorder=5)
        label = f"{response} / that at nu12 = {base:g}" if column == 0 else ""
        quiet(axes, "nu12", label, TITLES.get(model, model))
    entries = {
        name: Line2D([], [], marker="o", linewidth=1.4, color=colour)
        for name, colour in colours.items()
    }
    legend_above(figure, entries, 4)
    return save(figure, path)
