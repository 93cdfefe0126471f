"""Moduli with the percentiles of a bootstrap beside the band of their fit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .moduli import PANELS
from .style import BLACK, BLUE, VERMILION, legend_above, new_figure, quiet, save

Array = NDArray[np.float64]


def plot_bootstrap(
    path: Path | str,
    strains: Mapping[str, Array],
    best: Mapping[str, Array],
    samples: Mapping[str, Array],
    fit: Mapping[str, Array],
) -> Path:
    """Draw E1, E2 and G12 (MPa) over their strains, in this order.

    Parameters
    ----------
    best : (n,). samples, fit : (2, n), lower and upper ends, of the percentiles and of the fit.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    figure = new_figure(10.5, 3.8)
    handles = {}
    every = zip(figure.subplots(1, 3), PANELS, strains, strict=True)
    for m, (axes, (title, words), name) in enumerate(every):
        x = strains[name]
        handles["band of the fit, noise alone"] = axes.fill_between(
            x, *fit[name], color=BLUE, alpha=0.18, linewidth=0
        )
        for end in samples[name]:
            (handles["percentiles of the samples"],) = axes.plot(
                x, end, "--", color=VERMILION, linewidth=1.3
            )
        (handles["fit"],) = axes.plot(x, best[name], color=BLACK, linewidth=1.4)
        high = max(float(best[name].max()), float(samples[name][1].max()))
        axes.set_ylim(min(0.0, float(samples[name][0].min())), 1.08 * high)
        quiet(axes, words, "tangent modulus, MPa" if m == 0 else "", title)
    legend_above(figure, handles, len(handles))
    return save(figure, path)
