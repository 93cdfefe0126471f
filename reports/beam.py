"""The bent cylinder with supports and collar: from the side, cut at mid-span."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Circle, Rectangle
from numpy.typing import ArrayLike, NDArray

from .style import BLACK, BLUE, GREY, new_figure, quiet, save, strain_colours

Array = NDArray[np.float64]

#: mm of the collar's wall, which the model does not have: only for the eye.
WALL = 12.0
#: Beside the collar, in its lengths: how far the close view goes.
CLOSE = 2.2


@dataclass(frozen=True)
class BeamBodies:
    """Where the rigid bodies are at the end, mm.

    supports : (z, y) of both axes and the radius. collar : y of its axis, inner radius, length.
    """

    supports: tuple[tuple[float, float], ...]
    support_radius: float
    collar_height: float
    collar_radius: float
    collar_length: float


def plot_beam(
    path: Path | str,
    bent: ArrayLike,
    quads: ArrayLike,
    strain: ArrayLike,
    outline: ArrayLike,
    section: tuple[ArrayLike, ArrayLike],
    bodies: BeamBodies,
    title: str = "",
) -> Path:
    """Draw a whole beam true to scale, coloured by its strain along the axis.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    bent : (n, 3) mm, positions; z along the axis, y up.
    quads : (m, 4). strain : (m,) log strain along the axis when bent.
    outline : (k, 2) mm, the inflated beam from the side as a closed line (z, y).
    section : (k, 2) mm, the mid-span ring as a closed line (x, y), inflated and bent.
    bodies : supports and collar when bent.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    now, before = np.asarray(bent, dtype=float), np.asarray(outline, dtype=float)
    cells, colour = np.asarray(quads, dtype=int), np.asarray(strain, dtype=float)
    figure = new_figure(11.0, 6.2)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.0, 1.25], width_ratios=[2.3, 1.0])
    whole, close = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0])
    cut = figure.add_subplot(grid[1, 1])
    # Wrinkles take up many times the strain that the fabric carries: all of them one colour.
    most = max(float(colour.max()), 1e-6)
    colours, norm = strain_colours(np.clip(colour, -most, most))
    # Of the two halves the eye sees one; what is nearer hides what is behind.
    seen = np.flatnonzero(now[cells, 0].mean(axis=1) >= 0)
    seen = seen[np.argsort(now[cells[seen], 0].mean(axis=1))]
    look: dict[str, Any] = {"cmap": colours, "norm": norm, "edgecolor": "face", "linewidth": 0.3}
    for axes in (whole, close):
        faces = PolyCollection(now[cells[seen]][:, :, [2, 1]], array=colour[seen], **look)
        axes.add_collection(faces)
        axes.plot(*before.T, color=GREY, linewidth=1.0, linestyle="--", zorder=2)
        _supports(axes, bodies)
        _collar_from_the_side(axes, bodies)
        axes.set_aspect("equal")
    ring = bodies.collar_radius + WALL
    feet = [y - bodies.support_radius for _, y in bodies.supports]
    low = min(float(now[:, 1].min()), bodies.collar_height - ring, *feet)
    high = max(float(now[:, 1].max()), float(before[:, 1].max()), bodies.collar_height + ring)
    ends = float(np.abs(now[:, 2]).max())
    whole.set(xlim=(-1.03 * ends, 1.03 * ends), ylim=(low - 20, high + 20))
    reach, middle = CLOSE * bodies.collar_length, bodies.collar_height
    tall = bodies.collar_radius + 4 * WALL
    close.set(xlim=(-reach, reach), ylim=(middle - tall, middle + tall))
    quiet(whole, "", "y, mm", title)
    quiet(close, "z, mm", "y, mm", "at the collar")
    _cut(cut, section, bodies)
    for axes in (whole, close, cut):
        axes.grid(False)
    wrinkles = "min" if colour.min() < -most else "neither"
    bar = figure.colorbar(faces, ax=[whole], shrink=0.9, pad=0.01, extend=wrinkles)
    bar.set_label("log strain along the axis", fontsize=9)
    bar.ax.tick_params(labelsize=8.5, color=GREY)
    return save(figure, path)


def _supports(axes: Axes, bodies: BeamBodies) -> None:
    for z, y in bodies.supports:
        axes.add_patch(
            Circle(
                (z, y), bodies.support_radius, facecolor="#DDDDDD", edgecolor=GREY, hatch="////",
                linewidth=0.8, zorder=4,
            )
        )  # fmt: skip


def _collar_from_the_side(axes: Axes, bodies: BeamBodies) -> None:
    half, r = 0.5 * bodies.collar_length, bodies.collar_radius
    axes.add_patch(
        Rectangle(
            (-half, bodies.collar_height - r - WALL), 2 * half, 2 * (r + WALL),
            facecolor=BLUE, alpha=0.13, linewidth=0, zorder=3,
        )
    )  # fmt: skip
    for y in (bodies.collar_height - r - WALL, bodies.collar_height + r):
        axes.add_patch(
            Rectangle((-half, y), 2 * half, WALL, facecolor=BLUE, alpha=0.75, linewidth=0, zorder=5)
        )


def _cut(axes: Axes, section: tuple[ArrayLike, ArrayLike], bodies: BeamBodies) -> None:
    before, now = (np.asarray(ring, dtype=float) for ring in section)
    axes.add_patch(
        Circle(
            (0.0, bodies.collar_height), bodies.collar_radius + 0.5 * WALL, fill=False,
            edgecolor=BLUE, alpha=0.75, linewidth=3.5,
        )
    )  # fmt: skip
    axes.plot(*before.T, color=GREY, linewidth=1.0, linestyle="--", label="inflated")
    axes.plot(*now.T, color=BLACK, linewidth=1.6, label="bent")
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8.5)
    quiet(axes, "x, mm", "y, mm", "cut at mid-span")
