"""Picture of spheres through points: how far each point lies beyond its sphere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .style import GREY, new_figure, quiet, save

Array = NDArray[np.float64]
#: Title, points, how far off, which were used.
Drawn = tuple[str, Array, Array, NDArray[np.bool_]]

#: Points drawn at most of one frame; frames in one picture.
MOST, FRAMES = 6000, 6


def plot_spheres(path: Path, frames: Sequence[Drawn]) -> Path:
    """A map a frame, of the first few, in one scale of colours.

    frames : title, points (n, 3) mm, how far beyond the sphere (n,) mm, which were used (n,).
    """
    shown = frames[:FRAMES]
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(0.8 + 3.6 * columns, 3.4 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    most = max(float(np.abs(off[used]).max()) for _, _, off, used in shown) or 1.0
    drawn = None
    for axes, (title, points, off, used) in zip(panels, shown, strict=False):
        every = slice(None, None, -(-len(points) // MOST))
        x, y = points[every, :2].T
        inside = used[every]
        drawn = axes.scatter(
            x[inside], y[inside], c=off[every][inside], cmap="RdBu_r", vmin=-most, vmax=most,
            s=float(np.clip(15_000 / len(points), 3.0, 30.0)), linewidths=0,
        )  # fmt: skip
        # However far off they are, the picture stays that of the ball.
        for place, limits in ((points[used, 0], axes.set_xlim), (points[used, 1], axes.set_ylim)):
            edge = 0.05 * float(np.ptp(place))
            limits(float(place.min()) - edge, float(place.max()) + edge)
        axes.scatter(*points[~used, :2].T, s=12.0, c=GREY, marker="x", linewidths=0.7)
        axes.set_aspect("equal")
        quiet(axes, "x, mm", "y, mm", title)
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    assert drawn is not None
    bar = figure.colorbar(drawn, ax=panels.tolist(), shrink=0.8)
    bar.set_label("beyond the sphere, mm (x: left out)")
    return save(figure, path)
