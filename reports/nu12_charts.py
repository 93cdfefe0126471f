"""Charts of the sensitivity to Poisson's ratio."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from .charts import Chart, Charts, line
from .loads import TITLES

#: Of more lines, colours rise from the first to the last.
NAMED = 6


def nu12_charts(
    models: Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]],
    base: float,
    response: str,
    caption: str,
) -> Charts:
    """A chart a model: what `plot_nu12` draws; arguments as its own."""
    charts = []
    label = f"{response} / that at nu12 = {base:g}"
    for name, lines in models.items():
        many = len(lines) > NAMED
        series = [
            line(own, x, y, colour=k, rank=k / (len(lines) - 1) if many else None, marks=True)
            for k, (own, (x, y)) in enumerate(lines.items())
        ]
        title = TITLES.get(name, name)
        ratios = [np.asarray(y, dtype=float) for _, y in lines.values()]
        known = np.concatenate([y[np.isfinite(y)] for y in ratios] or [np.ones(1)])
        told = f"{known.min():.4g} to {known.max():.4g}" if len(known) else "none known"
        alt = f"{title}: {label}: {told}"
        charts.append(Chart(title, "nu12", label, series, alt, level=1.0))
    return Charts("nu12", charts, caption)
