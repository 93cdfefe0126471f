"""Charts of strips: load over gauge elongation, measured and modelled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .charts import Chart, Charts, Series, dots, line
from .loads import TITLES, StripCurves


def load_charts(name: str, curves: Sequence[StripCurves], caption: str) -> Charts:
    """A chart a strip: what `plot_loads` draws, without what the models miss."""
    charts = []
    for panel in curves:
        series: list[Series] = []
        if panel.polynomial is not None:
            series.append(line("load polynomial", *panel.polynomial, colour=6, faint=True))
        if panel.points is not None:
            series.append(dots("measured", *panel.points, colour=7))
        for rank, (own, elongation, load) in enumerate(panel.models):
            x, y = np.atleast_1d(elongation), np.atleast_1d(load)
            if len(x) and x[0] > 0:
                x, y = np.concatenate([[0.0], x]), np.concatenate([[0.0], y])
            series.append(line(own, x, y, colour=rank + 1, dashes=rank // 6))
        title = TITLES.get(panel.direction, panel.direction)
        if len(panel.rms) == 1:
            title += f": RMS error {panel.rms[0]:.3g} N"
            if panel.scatter is not None:
                title += f", scatter {panel.scatter:.3g} N"
        alt = f"{title}; load over elongation, measured and modelled"
        charts.append(Chart(title, "gauge elongation, mm", "load, N", series, alt, from_zero=True))
    return Charts(name, charts, caption)
