"""The deformed strip with its shear strain (bias test of section 3.3)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike, NDArray

from .style import BLACK, GREY, new_figure, quiet, save, strain_colours

Array = NDArray[np.float64]

#: Height of what is drawn of a grip, as a share of the strip's length.
GRIP = 0.06


def plot_strip(
    path: Path | str,
    points: ArrayLike,
    quads: ArrayLike,
    displacement: ArrayLike,
    shear: ArrayLike,
    gauge: ArrayLike,
    title: str = "",
    grips: bool = True,
) -> Path:
    """Draw a strip pulled along y: true to scale, coloured by shear, over its outline at rest.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    points : (n, 3) or (n, 2) mm, at rest.
    quads : (m, 4) nodes.
    displacement : (n, 3) or (n, 2) mm.
    shear : (m,) gamma12 of each quad, signed or its magnitude.
    gauge : (2,) nodes of the virtual strain gauge.
    grips : whether the ends are held in grips, to be drawn.

    Raises
    ------
    ValueError : not one shear strain a quad.
    OutputError : the file cannot be written.
    """
    rest = np.asarray(points, dtype=float)[:, :2]
    now = rest + np.asarray(displacement, dtype=float)[:, :2]
    cells, gamma = np.asarray(quads, dtype=int), np.asarray(shear, dtype=float)
    if gamma.shape != (len(cells),):
        raise ValueError(f"plot_strip: {gamma.size} shear strains for {len(cells)} quads")
    size = np.ptp(np.vstack([rest, now]), axis=0)
    # As tall as the strip asks for, with room for the colour bar beside and the legend beneath.
    figure = new_figure(3.8, float(np.clip(1.6 + 2.3 * size[1] / size[0], 4.0, 8.5)))
    figure.set_layout_engine("compressed")  # true to scale: the axes are narrower than their room
    axes = figure.subplots()
    colours, norm = strain_colours(gamma)
    faces = PolyCollection(now[cells], array=gamma, cmap=colours, norm=norm, edgecolor="face")
    faces.set_linewidth(0.3)
    axes.add_collection(faces)
    outline = _outline(cells)
    axes.add_collection(
        LineCollection(list(rest[outline]), colors=GREY, linestyles="--", label="at rest", zorder=3)
    )
    axes.add_collection(LineCollection(list(now[outline]), colors=BLACK, linewidths=0.8, zorder=3))
    if grips:
        _grips(axes, rest, now)
    _gauge(axes, rest, now, np.asarray(gauge, dtype=int))
    axes.set_aspect("equal")
    axes.autoscale_view()
    bar = figure.colorbar(faces, ax=axes, shrink=0.8)
    bar.set_label(r"shear strain $\gamma_{12}$")
    bar.ax.tick_params(labelsize=9, color=GREY)
    quiet(axes, "x, mm", "y, mm", title)
    axes.grid(False)
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=8.5)
    return save(figure, path)


def _outline(quads: NDArray[np.intp]) -> NDArray[np.intp]:
    """Edges (k, 2) that belong to one quad only."""
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return unique[count == 1]


def _grips(axes: Axes, rest: Array, now: Array) -> None:
    y, length = rest[:, 1], float(np.ptp(rest[:, 1]))
    height = GRIP * length
    near = 1e-6 * length
    ends = ((y > y.max() - near, 0.0, "grips"), (y < y.min() + near, -height, None))
    for end, below, label in ends:
        x0, x1 = now[end, 0].min(), now[end, 0].max()
        corner = (x0, float(now[end, 1].mean()) + below)
        axes.add_patch(
            Rectangle(
                corner, x1 - x0, height, facecolor="#DDDDDD", edgecolor=GREY, hatch="////",
                linewidth=0.8, label=label,
            )
        )  # fmt: skip


def _gauge(axes: Axes, rest: Array, now: Array, nodes: NDArray[np.intp]) -> None:
    before, after = (float(np.linalg.norm(np.diff(p[nodes], axis=0))) for p in (rest, now))
    for place, fill, label in (
        (rest, "none", f"gauge at rest, {before:.2f} mm"),
        (now, "white", f"gauge, {after:.2f} mm"),
    ):
        axes.plot(
            *place[nodes].T, "o", markersize=6, markerfacecolor=fill, markeredgewidth=1.2,
            color=GREY if place is rest else BLACK, zorder=5, label=label,
        )  # fmt: skip
