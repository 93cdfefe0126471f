"""Charts of tangent moduli over strain: best fits, bands, a known solution, uncertainties."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .charts import Chart, Charts, Series, line

Array = NDArray[np.float64]

#: Title and axis of E1, E2 and G12.
PANELS = (
    ("E1, along the warp", "logarithmic strain ε1"),
    ("E2, along the fill", "logarithmic strain ε2"),
    ("G12, in shear", "shear strain γ12"),
)
MODULUS = "tangent modulus, MPa"
#: Percent; a modulus known no better than this is not determined.
NOT_DETERMINED = 1000.0


def moduli_charts(
    strains: Array, moduli: Array, known: Array | None, band: Array | None, caption: str
) -> Charts:
    """Arguments as those of `plot_moduli`: (3, k), (fits, 3, k), (3, k), (2, 3, k)."""
    charts = []
    for m, (title, label) in enumerate(PANELS):
        x, best = strains[m], moduli[0, m]
        own = None if band is None else (band[0, m], band[1, m])
        series: list[Series] = [line("best", x, best, own, ends=known is None)]
        series += [
            line(f"next {len(moduli) - 1}", x, other, colour=6, faint=True)
            for other in moduli[1:, m]
        ]
        if known is not None:
            series.append(line("known", x, known[m], colour=1, dashes=1))
        drawn = np.vstack([moduli[:, m], *([] if known is None else [known[m : m + 1]])])
        # By the curves alone: a band may be as wide as it likes, and is then cut off.
        top = 1.12 * float(drawn.max())
        alt = f"{title}: from {best[0]:.3g} MPa at rest to {best[-1]:.3g} MPa at {x[-1]:.3g}"
        charts.append(Chart(title, label, MODULUS, series, alt, from_zero=True, top=top))
    return Charts("moduli", charts, caption)


def pinned_charts(strains: Array, sigma: Mapping[str, Array], caption: str) -> Charts:
    """One standard deviation (3, k) in percent of the moduli, by name of the test."""
    charts = []
    for m, (title, label) in enumerate(PANELS):
        series = []
        for rank, (name, values) in enumerate(sigma.items()):
            known = np.where(values[m] <= NOT_DETERMINED, values[m], np.nan)
            series.append(line(name, strains[m], known, colour=rank, dashes=rank // 8))
        alt = f"uncertainty of {title} by test"
        charts.append(Chart(title, label, "1 σ, % of the modulus", series, alt, log_y=True))
    words = f"{caption}; above {NOT_DETERMINED:g} % a modulus is not determined, and no line drawn"
    return Charts("pinned", charts, words)
