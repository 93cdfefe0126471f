"""Moduli of the best fits beside the known solution (Fig. 4.9)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike, NDArray

from .style import BLACK, SKY, VERMILION, new_figure, quiet, save

Array = NDArray[np.float64]

PANELS = (
    ("$E_1$ (warp)", r"warp strain $\varepsilon_1$"),
    ("$E_2$ (fill)", r"fill strain $\varepsilon_2$"),
    ("$G_{12}$ (shear)", r"shear strain $\gamma_{12}$"),
)
#: Deviation (%) below which curves are the same to machine precision.
SMALLEST = 1e-10


def plot_moduli(
    path: Path | str,
    strains: ArrayLike,
    moduli: ArrayLike,
    known: ArrayLike | None = None,
) -> Path:
    """Draw E1, E2 and G12 over the strain range reached.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    strains : (3, k) logarithmic strain for E1, E2, G12, each from zero to the largest reached.
    moduli : (fits, 3, k) MPa, best fit first, in the same order.
    known : (3, k) MPa; a second row of panels then shows the deviation from it in percent.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    x, fits = np.asarray(strains, dtype=float), np.asarray(moduli, dtype=float)
    truth = None if known is None else np.asarray(known, dtype=float)
    rows = 1 if truth is None else 2
    figure = new_figure(10.5, 3.6 if rows == 1 else 5.6)
    heights = [1.0] if rows == 1 else [1.6, 1.0]
    axes = figure.subplots(rows, 3, squeeze=False, height_ratios=heights, sharex="col")
    for m, (name, strain) in enumerate(PANELS):
        top = axes[0, m]
        if truth is not None:
            # Wide and pale beneath, so that a fit that lies on it is seen to do so.
            top.plot(x[m], truth[m], color=VERMILION, linewidth=6, alpha=0.45, label="known")
        for fit in fits[:0:-1]:
            top.plot(x[m], fit[m], color=SKY, linewidth=1.2, label=f"next {len(fits) - 1}")
        top.plot(x[m], fits[0, m], color=BLACK, linewidth=1.4, label="best")
        drawn = fits[:, m] if truth is None else np.vstack([fits[:, m], truth[m : m + 1]])
        top.set_ylim(min(0.0, float(drawn.min())), 1.08 * float(drawn.max()))
        label = "tangent modulus, MPa" if m == 0 else ""
        quiet(top, strain if rows == 1 else "", label, name)
        if truth is not None:
            _deviation(axes[1, m], x[m], fits[:, m], truth[m], strain, first=m == 0)
    lines = dict(zip(*axes[0, 0].get_legend_handles_labels()[::-1], strict=True))
    order = [n for n in ("best", f"next {len(fits) - 1}", "known") if n in lines]
    figure.legend(
        [lines[n] for n in order], order, loc="outside upper right", ncols=3, frameon=False
    )
    return save(figure, path)


def _deviation(axes: Axes, x: Array, fits: Array, truth: Array, strain: str, first: bool) -> None:
    percent = np.maximum(100 * np.abs(fits / truth - 1), SMALLEST)
    for line in percent[:0:-1]:
        axes.plot(x, line, color=SKY, linewidth=1.0)
    axes.plot(x, percent[0], color=BLACK, linewidth=1.4)
    # Whole decades with room for the text above; dips where curves cross say nothing.
    high = np.ceil(np.log10(percent.max())) + 1
    low = np.floor(max(np.log10(percent.min()), high - 7))
    axes.set_yscale("log")
    axes.set_ylim(10.0**low, 10.0**high)
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_locator(NullLocator())
    quiet(axes, strain, "deviation from known, %" if first else "")
    axes.text(
        0.98, 0.97, f"best: at most {percent[0].max():.2g} %", transform=axes.transAxes,
        ha="right", va="top", fontsize=8.5, color=BLACK,
    )  # fmt: skip
