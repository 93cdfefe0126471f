"""Picture of two clocks put together: pressures of a log beside heights of a camera's frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .style import BLUE, VERMILION, new_figure, quiet, save

Array = NDArray[np.float64]


def plot_clock(path: Path, times: Array, pressures: Array, heights: Array, taken: Array) -> Path:
    """Pressure and height of every frame over time, and one over the other.

    Parameters
    ----------
    times : (frames,) s, by the log's clock. pressures : (frames,) MPa, NaN beyond the log.
    heights : (frames,) mm, of the apex. taken : (n,) MPa, pressures of the frames that are used.
    """
    figure = new_figure(9.6, 3.8)
    left, right = figure.subplots(1, 2)
    kilo = 1e3 * pressures
    (line,) = left.plot(times, kilo, ".-", markersize=3, linewidth=0.8, color=BLUE)
    quiet(left, "time by the log's clock, s", "pressure, kPa", "")
    beside = left.twinx()
    (other,) = beside.plot(times, heights, ".-", markersize=3, linewidth=0.8, color=VERMILION)
    quiet(beside, "", "height of the apex, mm")
    beside.grid(False)
    left.legend([line, other], ["pressure of the log", "height"], loc="upper left", frameon=False)
    right.plot(kilo, heights, ".", markersize=4, color=BLUE, label="all frames")
    known = np.isfinite(pressures)
    nearest = [int(np.argmin(np.where(known, np.abs(pressures - p), np.inf))) for p in taken]
    right.plot(
        kilo[nearest], heights[nearest], "o", color=VERMILION, fillstyle="none", label="taken"
    )
    right.legend(loc="lower right", frameon=False)
    quiet(right, "pressure, kPa", "height of the apex, mm", "")
    return save(figure, path)
