"""Charts of bent cylinders: load over deflection, with what it may be off by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .bending import BendPanel
from .charts import Chart, Charts, Series, dots, line


def bending_charts(panels: Sequence[BendPanel], caption: str) -> Charts:
    """A chart a case: what `plot_bending` draws; a band is that of the card's certainty.

    The other end of the solver's band is a dashed curve of the card's colour.
    """
    return Charts("loads", [_chart(panel) for panel in panels if panel.lines], caption)


def _chart(panel: BendPanel) -> Chart:
    series: list[Series] = []
    if panel.measured is not None:
        for elongation, load in panel.measured.readings:
            series.append(dots("measured", elongation, load, colour=7))
    for own in panel.lines:
        load = np.asarray(own.load, dtype=float)
        band = None if own.off is None else (load - np.asarray(own.off), load + np.asarray(own.off))
        colour = 1 + own.rank % 6
        series.append(line(own.name, own.deflection, load, band, colour=colour))
        if own.other is not None:
            deflection, other = own.other
            name = f"{own.name}, other end"
            series.append(line(name, deflection, other, colour=colour, dashes=1))
    highest = max(float(np.max(np.asarray(own.load))) for own in panel.lines)
    alt = f"{panel.title}: load over deflection, up to {highest:.4g} N"
    return Chart(
        panel.title, "deflection of the collar, mm", "load, N", series, alt, from_zero=True
    )
