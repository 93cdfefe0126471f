"""One look for all figures: colours that stay apart for colour-blind readers, quiet axes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..writing import replacing

# Okabe and Ito's palette.
BLUE, VERMILION, GREEN, SKY, GREY, BLACK = (
    "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#8C8C8C", "#222222",
)  # fmt: skip

DOTS_PER_INCH = 150


def new_figure(width: float, height: float) -> Figure:
    """An empty figure (inches), free of pyplot's global state: safe in worker processes."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def quiet(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Label the axes (with units) and take away what does not inform."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title, loc="left", fontsize=10.5, fontweight="bold")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.grid(True, color="#E6E6E6", linewidth=0.7)
    axes.tick_params(labelsize=9, color=GREY)
    axes.set_axisbelow(True)


def pressure_colours(count: int) -> list[Any]:
    """Light to dark with rising pressure; none so light that it fades on paper."""
    return [colormaps["viridis_r"](t) for t in np.linspace(0.12, 1.0, count)]


def save(figure: Figure, path: Path | str) -> Path:
    """Write the figure (format by suffix) whole or not at all."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=DOTS_PER_INCH)
    return Path(path)
