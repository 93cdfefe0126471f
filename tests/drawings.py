"""What a figure shows, for the tests: numbers on its axes, words in its legends."""

from __future__ import annotations

import numpy as np
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
