"""What the weight between kinds of test does: errors of the tests, and moduli."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from .style import BLUE, DASHES, GREY, NAMED, from_zero, new_figure, quiet, save

#: Of the axis, where the weight is what the project says.
AS_WRITTEN = 1.0


def plot_weights(
    path: Path | str,
    counted: str,
    counts: Sequence[float],
    errors: Mapping[str, Sequence[float]],
    moduli: Mapping[str, Mapping[float, Sequence[float]]],
    sigma: Mapping[str, Sequence[float] | None],
) -> Path:
    """Draw the errors of the tests, and each modulus at some strains, over a weight.

    Parameters
    ----------
    path : PNG, SVG or PDF. counted : whose weight it is. counts : times the project's.
    errors : relative, by test. moduli : MPa, by name and strain. sigma : relative, by
    name, at these strains where the weight is as written; None where it is not known.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    figure = new_figure(8.6, 6.2)
    first, *others = figure.subplots(2, 2, sharex=True).ravel()
    for name, colour in zip(errors, [*NAMED] * len(errors), strict=False):
        values = 100 * np.asarray(errors[name])
        first.plot(counts, values, marker="o", markersize=4, color=colour, label=name)
    quiet(first, "", "relative RMS error, %", "Errors of the tests")
    from_zero(first, [100 * np.asarray(values) for values in errors.values()])
    first.legend(frameon=False, fontsize=8.5)
    for axes, (name, by_strain) in zip(others, moduli.items(), strict=True):
        bars = sigma.get(name) or [0.0] * len(by_strain)
        looks = zip(by_strain.items(), DASHES, bars, strict=False)
        for (strain, moved), dashes, bar in looks:
            look = {"color": BLUE, "linestyle": dashes, "linewidth": 1.4}
            axes.plot(counts, moved, marker="o", markersize=4, label=f"at {strain:.3g}", **look)
            own = float(np.interp(AS_WRITTEN, counts, moved))
            axes.errorbar([AS_WRITTEN], [own], [bar * own], color=GREY, capsize=4, zorder=1)
        quiet(axes, "", "MPa", name)
        from_zero(axes, list(by_strain.values()))
        axes.legend(frameon=False, fontsize=8.5, title="strain", title_fontsize=8.5)
    for axes in (first, *others):
        _weight_axis(axes, counts)
    for axes in others[-2:]:
        axes.set_xlabel(f"weight of {counted}, times that of the project")
    return save(figure, path)


def _weight_axis(axes: Axes, counts: Sequence[float]) -> None:
    """Halves and doubles, with a line where the weight is as written."""
    axes.set_xscale("log", base=2)
    axes.xaxis.set_major_locator(FixedLocator([c for c in counts if _whole(c)] or list(counts)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.axvline(AS_WRITTEN, color=GREY, linewidth=0.8)


def _whole(count: float) -> bool:
    power = float(np.log2(count))
    return abs(power - round(power)) < 1e-9
