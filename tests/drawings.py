"""What a figure shows, for the tests: numbers on its axes, words in its legends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure


def data(axes: Axes) -> list[np.ndarray]:
    """(2, k) of every line, in the order in which they were drawn."""
    return [np.array(line.get_data(), dtype=float) for line in axes.lines]


def lines(axes: Axes, colour: str) -> list[np.ndarray]:
    """(2, k) of every line of the colour."""
    return [np.array(line.get_data()) for line in axes.lines if line.get_color() == colour]


def legend(figure: Figure) -> list[str]:
    """Words of the figure's legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def titles(figure: Figure) -> list[str]:
    """Of every panel."""
    return [axes.get_title("left") for axes in figure.axes]


def shown(axes: Axes) -> tuple[str, str, str]:
    """Words of the axes, x and y, and the title."""
    return axes.get_xlabel(), axes.get_ylabel(), axes.get_title("left")


def check_convergence(
    figure: Figure, table: pd.DataFrame, what: str, rms: dict[str, Any] | None = None
) -> None:
    """The figure of one model shows what convergence.csv has: changes over size, and the cost.

    rms : "rms_N" of the result, where the model has a load curve.
    """
    (model,) = set(table.model)
    changes, cost = figure.axes
    size = {"elements": "mean edge, mm", "increments": "step, share of the load"}[what]
    assert shown(changes) == (size, "change to the next finer level, %", model)
    assert shown(cost) == ("elements x increments", "seconds", "cost")
    *names, first, second = legend(figure)
    assert [first, second] == ["order 1", "order 2"]
    curves = data(changes)
    assert len(curves) == len(names) + 2
    for name, curve in zip(names, curves, strict=False):
        rows = table[table.quantity == name]
        if name == "RMS along the load curve":
            assert rms is not None
            change = 100 * np.array(rms["to_next_finer"]) / rms["largest_load"]
        else:
            change = 100 * np.abs(np.diff(rows.value) / rows.value.iloc[-1])
        drawn = change > 1e-5  # the solver's tolerance hides the rest
        sizes = np.sort(table["size"].unique())[::-1][:-1]
        np.testing.assert_allclose(curve, [sizes[drawn], change[drawn]])
    assert (rms is not None) == ("RMS along the load curve" in names)
    levels = table.drop_duplicates("factor")
    np.testing.assert_allclose(data(cost)[0], [levels.elements * levels.increments, levels.seconds])
