"""Charts of what the weight between tests does: errors of the tests, and moduli."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .charts import Chart, Charts, Series, line
from .weights import AS_WRITTEN


def weights_charts(
    counted: str,
    counts: Sequence[float],
    errors: Mapping[str, Sequence[float]],
    moduli: Mapping[str, Mapping[float, Sequence[float]]],
    sigma: Mapping[str, Sequence[float] | None],
) -> list[Charts]:
    """The errors, then the moduli; arguments as those of `plot_weights`."""
    across = f"weight of {counted}, times that of the project"
    drawn = [
        line(name, counts, 100 * np.asarray(values), colour=rank, marks=True)
        for rank, (name, values) in enumerate(errors.items())
    ]
    label = "relative RMS error, %"
    alt = f"{label} of {', '.join(errors)} over the weight of {counted}"
    first = Chart("Errors of the tests", across, label, drawn, alt, from_zero=True, log_x=True)
    others = []
    for name, by_strain in moduli.items():
        bars = sigma.get(name) or [0.0] * len(by_strain)
        series: list[Series] = []
        for rank, ((strain, moved), bar) in enumerate(zip(by_strain.items(), bars, strict=True)):
            own = float(np.interp(AS_WRITTEN, counts, moved))
            series.append(line(f"at {strain:.3g}", counts, moved, dashes=rank, marks=True))
            if bar:
                ends = [own * (1 - bar), own * (1 + bar)]
                series.append(line("1 sigma", [AS_WRITTEN, AS_WRITTEN], ends, colour=7))
        alt = f"{name} at {len(by_strain)} strains over the weight of {counted}"
        others.append(Chart(name, across, "MPa", series, alt, from_zero=True, log_x=True))
    return [
        Charts("errors", [first], "Errors of the tests over the weight."),
        Charts("moduli", others, "Moduli over the weight, with 1 sigma where it is as written."),
    ]
