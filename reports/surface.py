"""Pictures of values over the disk: the sheet's reference surface, a field that is constant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from .style import BLACK, new_figure, quiet, save

Array = NDArray[np.float64]
LEVELS = 21


def plot_disk(path: Path, maps: Sequence[tuple[str, Array, Array]], edge: Array) -> Path:
    """A map a quantity, coloured by its value, zero in the middle of the colours.

    maps : title with its unit, places (n, 2) mm, and values (n,). edge : (m, 2) mm, the rim once
        around.
    """
    figure = new_figure(5.2 * len(maps), 4.6)
    panels = figure.subplots(1, len(maps), squeeze=False)[0]
    for axes, (title, places, values) in zip(panels, maps, strict=True):
        most = max(float(np.abs(values).max()), 1e-9)
        drawn = axes.tricontourf(
            Triangulation(*places.T), values, np.linspace(-most, most, LEVELS), cmap="RdBu_r"
        )
        figure.colorbar(drawn, ax=axes, shrink=0.8, ticks=MaxNLocator(9))
        axes.plot(*edge.T, color=BLACK, linewidth=1)
        axes.set_aspect("equal")
        quiet(axes, "x (warp), mm", "y (fill), mm", title)
    return save(figure, path)
