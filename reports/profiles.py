"""Cut-through profiles of the inflated bubble (Figs 4.10 and 4.11)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from .cuts import node_cut, point_cut
from .style import BLACK, new_figure, pressure_colours, quiet, save

AXES = (("cut along x (warp)", "x, mm"), ("cut along y (fill)", "y, mm"))


def plot_profiles(
    path: Path | str,
    pressures: ArrayLike,
    points: ArrayLike,
    displacements: ArrayLike,
    measured: Sequence[tuple[ArrayLike, ArrayLike]] = (),
    measured_label: str = "measured",
) -> Path:
    """Draw the bubble's profile along both axes at every pressure.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    pressures : (frames,) MPa.
    points : (n, 2 or 3) mm, nodes of a full or a quarter mesh.
    displacements : (models, frames, n, 3) mm, best model first; (frames, n, 3) for one model.
    measured : for each frame, points (k, 2) and displacements (k, 3) mm, drawn as dots.
    measured_label : "known solution" where the data were computed.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    frames = np.asarray(pressures, dtype=float)
    models = np.asarray(displacements, dtype=float)
    models = models[None] if models.ndim == 3 else models
    colours = pressure_colours(len(frames))
    figure = new_figure(10.5, 4.4)
    panels = figure.subplots(1, 2, sharey=True)
    for axis, (panel, (title, label)) in enumerate(zip(panels, AXES, strict=True)):
        for f, colour in enumerate(colours):
            for rank, model in enumerate(models):
                cut = node_cut(points, model[f], axis)
                width, opacity = (1.5, 1.0) if rank == 0 else (1.0, 0.45)
                panel.plot(cut.position, cut.height, color=colour, linewidth=width, alpha=opacity)
            if measured:
                dots = point_cut(*measured[f], axis)
                panel.plot(
                    dots.position, dots.height, "o", color=colour, markersize=3.6,
                    markerfacecolor="white", markeredgewidth=0.9,
                )  # fmt: skip
        quiet(panel, label, "height z, mm" if axis == 0 else "", title)
        panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]))
    entries = [
        (Line2D([], [], color=colour, linewidth=3), f"{1000 * p:.4g} kPa")
        for p, colour in zip(frames[::-1], colours[::-1], strict=True)
    ]
    name = "model" if len(models) == 1 else f"model ({len(models)} best)"
    entries.append((Line2D([], [], color=BLACK, linewidth=1.5), name))
    if measured:
        dot = Line2D(
            [], [], color=BLACK, marker="o", linestyle="", markersize=4, markerfacecolor="white"
        )
        entries.append((dot, measured_label))
    handles, labels = zip(*entries, strict=True)
    figure.legend(handles, labels, loc="outside right center", frameon=False, fontsize=9)
    return save(figure, path)
