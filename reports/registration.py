"""Picture of a registration: measured points in the test's coordinates, the rim, warp and fill."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .style import BLACK, new_figure, quiet, save

Array = NDArray[np.float64]

#: Points drawn at most of one frame.
MOST = 6000


def plot_registration(
    path: Path, points: Array, maps: Sequence[tuple[str, Array]], edge: Array
) -> Path:
    """A map a quantity over the points (n, 2) mm, with rim and directions.

    maps : title with its unit, and values (n,). edge : (m, 2) mm, the rim once around.
    """
    every = slice(None, None, -(-len(points) // MOST))
    figure = new_figure(5.2 * len(maps), 4.6)
    panels = figure.subplots(1, len(maps), squeeze=False)[0]
    arrow = 0.5 * float(np.hypot(*edge.T).min())
    for axes, (title, values) in zip(panels, maps, strict=True):
        drawn = axes.scatter(
            *points[every].T, c=values[every],
            s=float(np.clip(15_000 / len(points), 3.0, 30.0)), linewidths=0,
        )  # fmt: skip
        figure.colorbar(drawn, ax=axes, shrink=0.8)
        axes.plot(*edge.T, color=BLACK, linewidth=1)
        for name, (x, y) in (("warp", (1.0, 0.0)), ("fill", (0.0, 1.0))):
            end = (arrow * x, arrow * y)
            axes.annotate("", xy=end, xytext=(0, 0), arrowprops={"arrowstyle": "->"})
            axes.annotate(name, xy=end, xytext=(4, 4), textcoords="offset points")
        axes.set_aspect("equal")
        quiet(axes, "x, mm", "y, mm", title)
    return save(figure, path)
