"""Moduli of the best fits beside the known solution (Fig. 4.9), or of several named laws."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike, NDArray

from ..inference.posterior import LEVEL
from .style import BLACK, SKY, VERMILION, named_look, new_figure, quiet, save

Array = NDArray[np.float64]

PANELS = (
    ("$E_1$ (warp)", r"warp strain $\varepsilon_1$"),
    ("$E_2$ (fill)", r"fill strain $\varepsilon_2$"),
    ("$G_{12}$ (shear)", r"shear strain $\gamma_{12}$"),
)
#: Deviation (%) below which curves are the same to machine precision.
SMALLEST = 1e-10
BAND = f"{100 * LEVEL:.0f} % band"


def plot_moduli(
    path: Path | str,
    strains: ArrayLike,
    moduli: ArrayLike,
    known: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    band: ArrayLike | None = None,
) -> Path:
    """Draw E1, E2 and G12 over the strain range reached.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    strains : (3, k) logarithmic strain for E1, E2, G12, each from zero to the largest reached;
        (fits, 3, k) where every law has a range of its own.
    moduli : (fits, 3, k) MPa, best fit first, in the same order.
    known : (3, k) MPa; a second row of panels then shows the deviation from it in percent.
    names : of the fits, where they are laws to be told apart and not one's best and the next.
    band : (2, 3, k) MPa, lower and upper end of the band of the first fit; left out where they
        are not finite. A dot then ends each of its curves, and the band with it.

    Raises
    ------
    ValueError : not one name a fit, or strains of each law's own together with a known solution.
    OutputError : the file cannot be written.
    """
    fits = np.asarray(moduli, dtype=float)
    given = np.asarray(strains, dtype=float)
    x = np.broadcast_to(given, fits.shape)
    truth = None if known is None else np.asarray(known, dtype=float)
    if names is not None and len(names) != len(fits):
        raise ValueError(f"plot_moduli: {len(names)} names for {len(fits)} fits")
    if truth is not None and given.ndim == 3:
        raise ValueError("plot_moduli: beside a known solution all fits need the same strains")
    rows = 1 if truth is None else 2
    figure = new_figure(10.5, 3.6 if rows == 1 else 5.6)
    axes = figure.subplots(rows, 3, squeeze=False, height_ratios=[1.6, 1.0][:rows], sharex="col")
    looks = _looks(len(fits), names)
    for m, (name, strain) in enumerate(PANELS):
        top = axes[0, m]
        if truth is not None:
            # Wide and pale beneath, so that a fit that lies on it is seen to do so.
            top.plot(given[m], truth[m], color=VERMILION, linewidth=6, alpha=0.45, label="known")
        if band is not None:
            lower, upper = np.asarray(band, dtype=float)[:, m]
            top.fill_between(
                x[0, m], lower, upper, where=np.isfinite(lower) & np.isfinite(upper),
                color=looks[0]["color"], alpha=0.18, linewidth=0, label=BAND,
            )  # fmt: skip
        for i in range(len(fits) - 1, -1, -1):
            top.plot(x[i, m], fits[i, m], **looks[i])
        if band is not None:
            top.plot(x[0, m, -1:], fits[0, m, -1:], "o", color=looks[0]["color"], markersize=4.5)
        drawn = fits[:, m] if truth is None else np.vstack([fits[:, m], truth[m : m + 1]])
        # By the curves alone: a band may be as wide as it likes, and is then cut off.
        top.set_ylim(min(0.0, float(drawn.min())), 1.08 * float(drawn.max()))
        label = "tangent modulus, MPa" if m == 0 else ""
        quiet(top, strain if rows == 1 else "", label, name)
        if truth is not None:
            _deviation(axes[1, m], given[m], fits[:, m], truth[m], strain, looks, first=m == 0)
    lines = dict(zip(*axes[0, 0].get_legend_handles_labels()[::-1], strict=True))
    order = [look["label"] for look in looks]
    shown = {n: lines[n] for n in dict.fromkeys([*order, "known", BAND]) if n in lines}
    figure.legend(
        list(shown.values()), list(shown), loc="outside upper right", ncols=4, frameon=False
    )
    return save(figure, path)


def _looks(fits: int, names: Sequence[str] | None) -> list[dict[str, Any]]:
    """Of every fit: told apart by name, or the best before all others."""
    if names is not None:
        return [
            {"linewidth": 1.5, **named_look(rank), "label": name} for rank, name in enumerate(names)
        ]
    best = {"color": BLACK, "linewidth": 1.4, "label": "best"}
    return [best, *[{"color": SKY, "linewidth": 1.2, "label": f"next {fits - 1}"}] * (fits - 1)]


def _deviation(
    axes: Axes, x: Array, fits: Array, truth: Array, strain: str, looks: Sequence[dict[str, Any]],
    first: bool,
) -> None:  # fmt: skip
    percent = np.maximum(100 * np.abs(fits / truth - 1), SMALLEST)
    for line, look in zip(percent[::-1], looks[::-1], strict=True):
        axes.plot(x, line, **look)
    # Whole decades with room for the text above; dips where curves cross say nothing.
    high = np.ceil(np.log10(percent.max())) + 1
    low = np.floor(max(np.log10(percent.min()), high - 7))
    axes.set_yscale("log")
    axes.set_ylim(10.0**low, 10.0**high)
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_locator(NullLocator())
    quiet(axes, strain, "deviation from known, %" if first else "")
    worst = f"{looks[0]['label']}: at most {percent[0].max():.2g} %"
    axes.text(
        0.98, 0.97, worst, transform=axes.transAxes,
        ha="right", va="top", fontsize=8.5, color=BLACK,
    )  # fmt: skip
