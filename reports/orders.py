"""Orders of the load polynomials compared, by fit and by leaving points out (section 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from .loads import TITLES
from .style import (
    BLUE,
    VERMILION,
    from_zero,
    legend_above,
    logarithmic,
    new_figure,
    quiet,
    save,
    spans_a_decade,
)

LINES = (("RMSE of the fit", BLUE, "o"), ("leave-one-out error", VERMILION, "s"))


@dataclass(frozen=True, eq=False)
class OrderErrors:
    """One direction's load polynomials: orders (k,), rmse and left_out (k,) N, and the choice.

    `left_out` is the root mean square of the errors at points left out of the fit one by one.
    """

    direction: str
    orders: Sequence[int]
    rmse: ArrayLike
    left_out: ArrayLike
    chosen: int


def plot_orders(path: Path | str, directions: Sequence[OrderErrors]) -> Path:
    """Draw RMSE and leave-one-out error against the polynomial order, one panel a direction.

    A pale bar marks the chosen order. An axis is logarithmic where its errors span a decade.

    Parameters
    ----------
    path : PNG, SVG or PDF.

    Raises
    ------
    ValueError : no directions.
    OutputError : the file cannot be written.
    """
    if not directions:
        raise ValueError("plot_orders: no directions to draw")
    figure = new_figure(1.0 + 3.2 * max(len(directions), 1.5), 3.8)
    panels = figure.subplots(1, len(directions), squeeze=False)[0]
    for column, (axes, row) in enumerate(zip(panels, directions, strict=True)):
        errors = [np.asarray(values, dtype=float) for values in (row.rmse, row.left_out)]
        axes.axvspan(row.chosen - 0.3, row.chosen + 0.3, color="#E0E0E0", linewidth=0, zorder=0)
        for (_, colour, marker), values in zip(LINES, errors, strict=True):
            axes.plot(row.orders, values, color=colour, marker=marker, markersize=5, linewidth=1.3)
        if spans_a_decade(errors):
            logarithmic(axes)
        else:
            from_zero(axes, errors)
        axes.set_xlim(min(row.orders) - 0.5, max(row.orders) + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        title = f"{TITLES.get(row.direction, row.direction)}: order {row.chosen}"
        quiet(axes, "order of the polynomial", "error of the load, N" if column == 0 else "", title)
    entries = {
        name: Line2D([], [], color=colour, marker=marker, linewidth=1.3)
        for name, colour, marker in LINES
    }
    legend_above(figure, {**entries, "chosen order": Patch(color="#E0E0E0")}, 3)
    return save(figure, path)
