"""Optima of a multistart, sorted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from .style import BLUE, VERMILION, new_figure, quiet, save

#: What a perfect fit (zero) is drawn as on the logarithmic axis.
SMALLEST = 1e-16


def plot_optima(
    path: Path | str,
    objectives: ArrayLike,
    label: str = "objective",
    references: Mapping[str, float] | None = None,
) -> Path:
    """Draw the optimum of every start, sorted from worst to best.

    The axis is logarithmic where the values span more than a decade.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    objectives : (starts,); starts that failed are NaN or infinite and only counted.
    label : of the objective, with its unit where it has one.
    references : lines to compare with, by name: published ones.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    values = np.atleast_1d(np.asarray(objectives, dtype=float))
    ended = np.sort(values[np.isfinite(values)])[::-1]
    drawn = np.maximum(ended, SMALLEST)
    figure = new_figure(10.0, 4.2)
    axes = figure.subplots()
    axes.plot(np.arange(1, len(drawn) + 1), drawn, "o", color=BLUE, markersize=5, clip_on=False)
    right = max(len(values), 2) + 0.5
    for name, value in (references or {}).items():
        axes.axhline(value, color=VERMILION, linewidth=1, linestyle=(0, (5, 3)))
        axes.annotate(
            f"published {name} {value:g}",
            (right, value),
            xytext=(-2, 2 if name != "best" else -3),
            textcoords="offset points",
            ha="right",
            va="bottom" if name != "best" else "top",
            fontsize=8.5,
            color=VERMILION,
        )
    levels = [*drawn, *(references or {}).values()] or [1.0]
    low, high = np.log10(min(levels)), np.log10(max(levels))
    if high - low > 1.0:
        axes.set_yscale("log")
        room = max(0.06 * (high - low), 0.3)
        axes.set_ylim(10 ** (low - room), 10 ** (high + room))
    else:  # a logarithmic axis without a full decade on it cannot be read
        axes.set_ylim(0.0, 1.15 * max(levels))
    axes.set_xlim(0.5, right)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    failed = len(values) - len(ended)
    plural = "s" if len(values) > 1 else ""
    title = f"Optima of {len(values)} start{plural}" + (
        f", {failed} without a result" if failed else ""
    )
    if len(ended):
        title += f": best {ended[-1]:.3g}, median {np.median(ended):.3g}, worst {ended[0]:.3g}"
    quiet(axes, "start, sorted from worst to best", label, title)
    return save(figure, path)
