"""Charts of moduli with the percentiles of a bootstrap beside the band of their fit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .charts import Chart, Charts, line
from .moduli_charts import MODULUS, PANELS

Array = NDArray[np.float64]
#: Of the percentiles, which are two curves.
SAMPLES = "percentiles of the samples"


def bootstrap_charts(
    strains: Mapping[str, Array],
    best: Mapping[str, Array],
    samples: Mapping[str, Array],
    fit: Mapping[str, Array],
    caption: str,
) -> Charts:
    """Arguments as those of `plot_bootstrap`: (n,) each, the ends of both bands (2, n)."""
    charts = []
    for (title, label), name in zip(PANELS, strains, strict=True):
        x, low, high = strains[name], samples[name][0], samples[name][1]
        series = [
            line("fit, with its band by the noise", x, best[name], (fit[name][0], fit[name][1])),
            line(SAMPLES, x, low, colour=1, dashes=1),
            line(SAMPLES, x, high, colour=1, dashes=1),
        ]
        top = 1.08 * max(float(best[name].max()), float(high.max()))
        alt = f"{title}: at rest {best[name][0]:.4g} MPa, samples {low[0]:.4g} to {high[0]:.4g} MPa"
        charts.append(Chart(title, label, MODULUS, series, alt, from_zero=True, top=top))
    return Charts("bootstrap", charts, caption)
