"""Profile likelihoods of moduli beside what one standard deviation says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np

from .style import BLUE, GREY, VERMILION, legend_above, new_figure, quiet, save

#: Panels in a row, and of the threshold how far up they reach.
COLUMNS, ROOM = 3, 1.6


@dataclass(frozen=True, eq=False)
class ProfilePanel:
    """One modulus at one strain: MPa, -2 log L; ends None where the curve does not pass the line.

    sigma : MPa, one standard deviation; band : MPa, within the bounds.
    """

    title: str
    values: Sequence[float]
    ratios: Sequence[float]
    best: float
    sigma: float
    ends: tuple[float | None, float | None]
    band: tuple[float, float]


def plot_likelihoods(path: Path | str, panels: Sequence[ProfilePanel], threshold: float) -> Path:
    """Draw -2 log L of every panel over its modulus.

    Raises
    ------
    ValueError : no panels. OutputError : the file cannot be written.
    """
    if not panels:
        raise ValueError("plot_likelihoods: no profiles to draw")
    columns = min(COLUMNS, len(panels))
    lines = ceil(len(panels) / columns)
    figure = new_figure(max(5.2, 3.7 * columns), 0.5 + 3.0 * lines)
    every = figure.subplots(lines, columns, squeeze=False).ravel()
    handles = {}
    for axes in every[len(panels) :]:
        axes.set_visible(False)
    for axes, panel in zip(every, panels, strict=False):
        first, last = min(panel.values), max(panel.values)
        around = np.linspace(first, last, 200)
        (handles["by the 1 sigma of the fit"],) = axes.plot(
            around, ((around - panel.best) / panel.sigma) ** 2, "--", color=VERMILION, linewidth=1.2
        )
        (handles["profile"],) = axes.plot(
            panel.values, panel.ratios, "o-", color=BLUE, linewidth=1.4, markersize=3.5
        )
        handles["threshold"] = axes.axhline(threshold, color=GREY, linewidth=1.0)
        for end in panel.ends:
            if end is not None:
                axes.plot([end, end], [0.0, threshold], ":", color=BLUE, linewidth=1.2)
        axes.set_ylim(min(0.0, min(panel.ratios)), ROOM * threshold)
        quiet(axes, "tangent modulus, MPa", "-2 log L", panel.title)
    legend_above(figure, handles, len(handles))
    return save(figure, path)
