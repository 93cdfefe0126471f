"""Charts of biaxial tests: strains of both yarns over the larger load, ratio by ratio."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .biaxial import YARNS, BiaxialPanel
from .charts import Chart, Charts, Series, dots, line


def biaxial_charts(name: str, panels: Sequence[BiaxialPanel], caption: str) -> Charts:
    """A chart a ratio: what `plot_biaxial` draws, with the load across."""
    charts = []
    for panel in panels:
        series: list[Series] = []
        for k, yarn in enumerate(YARNS):
            measured = np.asarray(panel.strain)[:, k]
            series.append(dots(f"{yarn}, measured", panel.load, measured, colour=k))
        for rank, (model, load, strain) in enumerate(panel.models):
            for k, yarn in enumerate(YARNS):
                own = np.asarray(strain)[:, k]
                series.append(line(f"{yarn}, {model}", load, own, colour=k, dashes=rank))
        alt = f"ratio {panel.ratio}: strains along warp and fill over the larger load"
        charts.append(Chart(f"ratio {panel.ratio}", "larger load, kN/m", "strain, %", series, alt))
    return Charts(name, charts, caption)
