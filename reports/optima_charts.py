"""A chart of the optima of a multistart, from worst to best."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .charts import Chart, Charts, dots
from .style import DECADE

#: What a perfect fit (zero) is drawn as on a logarithmic axis.
SMALLEST = 1e-16


def optima_chart(objectives: ArrayLike, caption: str) -> Charts:
    """(starts,) objectives; starts that failed are NaN or infinite and only counted."""
    values = np.atleast_1d(np.asarray(objectives, dtype=float))
    ended = np.maximum(np.sort(values[np.isfinite(values)])[::-1], SMALLEST)
    failed = len(values) - len(ended)
    said = f"{len(values)} start{'s' if len(values) > 1 else ''}"
    said += f", {failed} without a result" if failed else ""
    if len(ended):
        said += f": best {ended[-1]:.3g}, median {np.median(ended):.3g}, worst {ended[0]:.3g}"
    log = bool(len(ended)) and ended[0] > DECADE * ended[-1]
    spots = dots("", 1 + np.arange(len(ended)), ended)
    label = "start, from worst to best"
    chart = Chart("", label, "objective", [spots], said, log_y=log, from_zero=not log)
    return Charts("optima", [chart], f"{caption}. {said[:1].upper()}{said[1:]}.")
