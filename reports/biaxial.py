"""Loads per width over the strains of both yarns, ratio by ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from .style import GREY, legend_above, named_look, new_figure, quiet, save

#: Panels beside each other.
ACROSS = 3
#: How warp and fill are told apart: dots measured, dashes of models.
DOTS: tuple[dict[str, Any], ...] = (
    {"color": GREY, "marker": "o", "markersize": 3.2, "linestyle": ""},
    {"color": GREY, "marker": "o", "markersize": 3.6, "linestyle": "", "markerfacecolor": "white"},
)
DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)))
YARNS = ("warp", "fill")


@dataclass(frozen=True, eq=False)
class BiaxialPanel:
    """One ratio: the larger load (n,) kN/m and the strains (n, 2) % along warp and fill; models by
    name with loads and strains of their own, best first."""

    ratio: str
    load: ArrayLike
    strain: ArrayLike
    models: Sequence[tuple[str, ArrayLike, ArrayLike]] = ()


def plot_biaxial(path: Path | str, panels: Sequence[BiaxialPanel]) -> Path:
    """Draw a panel a ratio, the larger load over the strains.

    Raises
    ------
    ValueError : no panels.
    OutputError : the file cannot be written.
    """
    if not panels:
        raise ValueError("plot_biaxial: no ratio to draw")
    across = min(ACROSS, len(panels))
    down = ceil(len(panels) / across)
    figure = new_figure(1.0 + 3.2 * max(across, 1.5), 0.8 + 3.0 * down)
    axes = figure.subplots(down, across, squeeze=False).ravel()
    names = list(dict.fromkeys(name for p in panels for name, _, _ in p.models))
    for number, (panel, own) in enumerate(zip(panels, axes, strict=False)):
        strain = np.asarray(panel.strain, dtype=float)
        for yarn in range(2):
            own.plot(strain[:, yarn], panel.load, **DOTS[yarn])
            for name, load, modelled in panel.models:
                look = {**named_look(names.index(name)), "linestyle": DASHES[yarn]}
                own.plot(np.asarray(modelled)[:, yarn], load, linewidth=1.5, **look)
        below = number + across >= len(panels)
        quiet(
            own,
            "strain, %" if below else "",
            "larger load, kN/m" if number % across == 0 else "",
            panel.ratio,
        )
        own.set_ylim(bottom=0.0)
    for own in axes[len(panels) :]:
        own.set_axis_off()
    entries: dict[str, Any] = {
        f"measured {y}": Line2D([], [], **DOTS[k]) for k, y in enumerate(YARNS)
    }
    for rank, name in enumerate(names):
        for k, along in enumerate(YARNS):
            look = {**named_look(rank), "linestyle": DASHES[k]}
            entries[f"{name}, {along}"] = Line2D([], [], linewidth=1.5, **look)
    legend_above(figure, entries, max(2, int(figure.get_figwidth() / 2.3)))
    return save(figure, path)
