"""Charts of a study of refinement: change to the next finer level over size, and the cost."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from .charts import Chart, Charts, Series, line
from .convergence import SERIES, SIZES, SMALLEST, ConvergencePanel
from .loads import TITLES


def convergence_charts(models: Sequence[ConvergencePanel], what: str, caption: str) -> Charts:
    """A chart a model, and one of the cost: what `plot_convergence` draws.

    what : "elements" or "increments".
    """
    charts = [_changes(model, SIZES[what]) for model in models]
    cost = [
        line(TITLES.get(m.name, m.name), m.work, m.seconds, colour=rank, marks=True)
        for rank, m in enumerate(models)
    ]
    across = "elements × increments"
    alt = "wall clock over elements times increments"
    charts.append(Chart("cost", across, "seconds", cost, alt, log_y=True, log_x=True))
    words = f"{caption}. Grey: what falls with the first and the second power of the size"
    return Charts("convergence", charts, f"{words}; changes below {SMALLEST:g} % are not drawn.")


def _changes(model: ConvergencePanel, size: str) -> Chart:
    sizes = np.asarray(model.sizes[:-1], dtype=float)
    loads = [name for name in model.changes if re.match(SERIES, name)]
    rising = dict(zip(loads, np.linspace(0.0, 1.0, max(2, len(loads))).tolist(), strict=False))
    drawn: dict[str, np.ndarray] = {}
    for name, values in model.changes.items():
        change = np.asarray(values, dtype=float)
        drawn[name] = np.where(change > SMALLEST, change, np.nan)
    series: list[Series] = [
        line(name, sizes, change, colour=rank, rank=rising.get(name), marks=True)
        for rank, (name, change) in enumerate(drawn.items())
    ]
    seen = np.concatenate([c[np.isfinite(c)] for c in drawn.values()] or [np.zeros(0)])
    if len(seen):
        series += [
            line(f"order {p}", sizes, 1.6 * seen.max() * (sizes / sizes.max()) ** p,
                 colour=7, dashes=p, faint=True)
            for p in (1, 2)
        ]  # fmt: skip
    title = TITLES.get(model.name, model.name)
    told = f"largest {seen.max():.3g} %, least {seen.min():.3g} %" if len(seen) else "none"
    label = "change to the next finer level, %"
    return Chart(title, size, label, series, f"{title}: {label}: {told}", log_y=True, log_x=True)
