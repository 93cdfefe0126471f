"""Rise of a bubble's centre against pressure, as measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .style import BLUE, new_figure, quiet, save


def plot_rises(path: Path | str, pressures: ArrayLike, rises: ArrayLike) -> Path:
    """Draw the rises (frames,) mm over pressures (frames,) MPa, from an unloaded flat sheet on."""
    figure = new_figure(5.4, 4.0)
    axes = figure.subplots()
    axes.plot(1e3 * np.asarray(pressures), rises, "o-", color=BLUE, markersize=4, linewidth=1.2)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=min(0.0, float(np.min(rises))))
    quiet(axes, "pressure, kPa", "rise about the centre, mm")
    return save(figure, path)
