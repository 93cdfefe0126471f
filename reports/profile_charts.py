"""Charts of profile likelihoods: -2 log L over a modulus, with the threshold and the ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .charts import Chart, Charts, Series, line
from .likelihoods import ROOM, ProfilePanel

#: Of the parabola of the fit's standard deviation.
POINTS = 81


def profile_charts(panels: Sequence[ProfilePanel], threshold: float, caption: str) -> Charts:
    """A chart a modulus: what `plot_likelihoods` draws."""
    return Charts("profiles", [_chart(panel, threshold) for panel in panels], caption)


def _chart(panel: ProfilePanel, threshold: float) -> Chart:
    x = np.linspace(min(panel.values), max(panel.values), POINTS)
    parabola = ((x - panel.best) / panel.sigma) ** 2
    inside = np.where(parabola <= ROOM * threshold, parabola, np.nan)
    series: list[Series] = [
        line("profile", panel.values, panel.ratios, marks=True),
        line("by the 1 sigma of the fit", x, inside, colour=1, dashes=1),
    ]
    series += [
        line("ends", [end, end], [0.0, threshold], dashes=2)
        for end in panel.ends
        if end is not None
    ]
    low, high = ("not closed" if end is None else f"{end:.4g} MPa" for end in panel.ends)
    alt = f"{panel.title}: best {panel.best:.4g} MPa, lower end {low}, upper end {high}"
    top = ROOM * threshold
    return Chart(
        panel.title, "tangent modulus, MPa", "-2 log L", series, alt, from_zero=True, top=top,
        level=threshold,
    )  # fmt: skip
