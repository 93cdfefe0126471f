"""One look for all figures: colours that stay apart for colour-blind readers, quiet axes."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike

from ..files import replacing

# Okabe and Ito's palette.
BLUE, VERMILION, GREEN, SKY, GREY, BLACK = (
    "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#8C8C8C", "#222222",
)  # fmt: skip
ORANGE, PURPLE = "#E69F00", "#CC79A7"
#: Named lines in their order; where the colours run out they come again with other dashes.
NAMED = (VERMILION, BLUE, GREEN, BLACK, PURPLE, ORANGE)
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))

DOTS_PER_INCH = 150
#: A ratio of values above which a logarithmic axis is easier to read than a linear one.
DECADE = 10.0
#: Strain of the other sign below this share is not worth a map with two ends.
ONE_SIGN = 0.05


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


def named_look(rank: int) -> dict[str, Any]:
    """Colour, dashes and layer of the named line of this rank: the best, 0, lies on top."""
    dashes = DASHES[rank // len(NAMED) % len(DASHES)]
    return {"color": NAMED[rank % len(NAMED)], "linestyle": dashes, "zorder": 4 - 0.01 * rank}


def spans_a_decade(values: ArrayLike) -> bool:
    """Whether the finite values are all positive and call for a logarithmic axis."""
    finite = np.asarray(values, dtype=float).ravel()
    finite = finite[np.isfinite(finite)]
    return bool(len(finite) and finite.min() > 0 and finite.max() > DECADE * finite.min())


def logarithmic(axes: Axes) -> None:
    """A logarithmic y axis with plain numbers, labelled at 1, 2 and 5."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def from_zero(axes: Axes, values: ArrayLike) -> None:
    """A linear y axis from zero with room above the largest finite value."""
    flat = np.asarray(values, dtype=float).ravel()
    largest = float(np.max(flat, where=np.isfinite(flat), initial=0.0))
    axes.set_ylim(0.0, 1.1 * largest or 1.0)


def legend_above(figure: Figure, entries: Mapping[str, Any], columns: int) -> None:
    """One legend for all panels, above them, in the order of the entries (label: handle)."""
    if entries:
        rows = ceil(len(entries) / columns)
        figure.legend(
            list(entries.values()), list(entries), loc="outside upper center",
            ncols=ceil(len(entries) / rows), frameon=False, fontsize=9,
        )  # fmt: skip


def pressure_colours(count: int) -> list[Any]:
    """Light to dark with rising pressure; none so light that it fades on paper."""
    return [colormaps["viridis_r"](t) for t in np.linspace(0.12, 1.0, count)]


def strain_colours(strain: ArrayLike) -> tuple[str, Normalize]:
    """Dark is large; zero is in the middle where both signs matter, else at one end."""
    low, high = float(np.nanmin(strain)), float(np.nanmax(strain))
    most = max(abs(low), abs(high))
    if min(-low, high) > ONE_SIGN * most:
        return "PuOr", Normalize(-most, most)
    if high >= -low:
        return "viridis_r", Normalize(min(low, 0.0), high or 1.0)
    return "viridis", Normalize(low, max(high, 0.0))


def save(figure: Figure, path: Path | str) -> Path:
    """Write the figure (format by suffix) whole or not at all."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=DOTS_PER_INCH)
    return Path(path)
