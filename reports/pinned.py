"""What each test of a fit pins down: uncertainty of the moduli along strain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator
from numpy.typing import ArrayLike, NDArray

from .moduli import PANELS
from .style import BLACK, GREY, legend_above, named_look, new_figure, quiet, save

Array = NDArray[np.float64]

#: Percent; a modulus known no better than this is not determined.
NOT_DETERMINED = 1000.0
#: Percent; nothing is known better than this, and a zero has to stand somewhere.
SMALLEST = 1e-3
#: Decades between the marks of two tests in the band above, and for the words there.
STEP, WORDS = 0.14, 0.32


def plot_pinned(path: Path | str, strains: ArrayLike, sigma: Mapping[str, ArrayLike]) -> Path:
    """Draw the relative uncertainty of E1, E2 and G12 from each test and from all together.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    strains : (3, k) logarithmic strain for E1, E2, G12.
    sigma : by name ("bubble", "strips", "all together"): (3, k), one standard deviation in percent
        of the modulus. Above `NOT_DETERMINED`, or not finite, it is marked in a band at the top.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    x = np.asarray(strains, dtype=float)
    sets = {name: np.asarray(values, dtype=float) for name, values in sigma.items()}
    lost = {name: ~(values <= NOT_DETERMINED) for name, values in sets.items()}
    clipped = any(mask.any() for mask in lost.values())
    known = np.concatenate([v[~lost[name]] for name, v in sets.items()] or [np.zeros(0)])
    low = np.floor(np.log10(max(known.min(), SMALLEST))) if len(known) else 0.0
    top = np.log10(NOT_DETERMINED)
    figure = new_figure(10.5, 3.8)
    panels = figure.subplots(1, len(PANELS), sharey=True)
    for m, (panel, (title, strain)) in enumerate(zip(panels, PANELS, strict=True)):
        for rank, (name, values) in enumerate(sets.items()):
            line = np.where(lost[name][m], np.nan, np.maximum(values[m], SMALLEST))
            panel.plot(x[m], line, linewidth=1.7, **named_look(rank))
            mark = np.where(lost[name][m], 10 ** (top + STEP * (rank + 0.8)), np.nan)
            panel.plot(
                x[m], mark, linewidth=2.5, marker="^", markersize=4.5,
                markevery=max(1, x.shape[1] // 12), **named_look(rank),
            )  # fmt: skip
        panel.set_yscale("log")
        if clipped:
            _band(panel, top, len(sets), any(mask[m].any() for mask in lost.values()))
        else:
            most = np.ceil(np.log10(known.max(initial=SMALLEST)))
            panel.set_ylim(top=10 ** max(most, low + 1))
        panel.set_ylim(bottom=10**low)
        panel.yaxis.set_major_locator(FixedLocator([10.0**d for d in np.arange(low, top + 0.5)]))
        panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panel.yaxis.set_minor_locator(NullLocator())
        panel.yaxis.set_minor_formatter(NullFormatter())
        quiet(panel, strain, r"1 $\sigma$, % of the modulus" if m == 0 else "", title)
    lines = {
        name: Line2D([], [], linewidth=1.7, **named_look(rank)) for rank, name in enumerate(sets)
    }
    legend_above(figure, lines, 4)
    return save(figure, path)


def _band(axes: Axes, top: float, sets: int, words: bool) -> None:
    """The room above the highest value drawn, for what is not determined."""
    end = top + STEP * (sets + 0.6) + WORDS
    axes.axhspan(10**top, 10**end, color="#EFEFEF", linewidth=0, zorder=0)
    axes.axhline(10**top, color=GREY, linewidth=0.8)
    axes.set_ylim(top=10**end)
    if words:
        axes.text(
            0.98, 10 ** (end - 0.5 * WORDS), f"not determined (over {NOT_DETERMINED:g} %)",
            transform=axes.get_yaxis_transform(), ha="right", va="center", fontsize=8.5,
            color=BLACK,
        )  # fmt: skip
