"""Tests that could be made next, and how certain each would make the moduli."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.ticker import FuncFormatter, NullFormatter

from .style import GREY, NAMED, legend_above, new_figure, quiet, save

#: %, beyond which a modulus is drawn as unknown, at the end of the axis.
MOST = 100.0
MARKS = ("o", "s", "D")
#: Of two dots in one line, so that neither hides the other.
ASIDE = 0.16


def plot_plan(
    path: Path | str, tests: Sequence[str], sigma: Mapping[str, Sequence[float]], now: str
) -> Path:
    """Draw 1 sigma of each modulus, a line a test, best above.

    Parameters
    ----------
    path : PNG, SVG or PDF. tests : titles, that of the present tests alone among them (`now`).
    sigma : % by modulus, one a test; from 100 % on as unknown.

    Raises
    ------
    ValueError : no tests. OutputError : the file cannot be written.
    """
    if not tests:
        raise ValueError("plot_plan: no tests to draw")
    figure = new_figure(8.6, 1.6 + 0.32 * len(tests))
    axes = figure.subplots()
    place = np.arange(len(tests), dtype=float)
    handles, least = {}, MOST
    for rank, (name, values) in enumerate(sigma.items()):
        known = np.asarray(values, dtype=float)
        least = min(least, float(known.min()))
        y = place + ASIDE * (rank - 0.5 * (len(sigma) - 1))
        for open_marks, some in ((False, known < MOST), (True, known >= MOST)):
            (dots,) = axes.plot(
                np.minimum(known[some], MOST), y[some], MARKS[rank % len(MARKS)],
                color=NAMED[rank % len(NAMED)], markersize=7, clip_on=False, zorder=3,
                markerfacecolor="white" if open_marks else None,
            )  # fmt: skip
            if not open_marks:
                handles[name] = dots
    axes.set_xscale("log")
    axes.set_xlim(10 ** np.floor(np.log10(max(least, 1e-3))), MOST)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(len(tests) - 0.4, -0.6)
    quiet(axes, r"1 $\sigma$, % of the modulus (open, at the end: unknown)", "")
    axes.set_yticks(place, tests)
    for label in axes.get_yticklabels():
        label.set_fontweight("bold" if label.get_text() == now else "normal")
    axes.grid(False, axis="y")
    for y in place[1:]:
        axes.axhline(y - 0.5, color=GREY, linewidth=0.3, zorder=0)
    legend_above(figure, handles, len(handles))
    return save(figure, path)
