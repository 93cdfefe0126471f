"""Load curves of strips as they were read, before any fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from .style import named_look, new_figure, quiet, save

#: Specimens that the legend of a panel names; more are drawn without a name.
NAMED = 6


def plot_curves(
    path: Path | str, curves: Mapping[str, Sequence[tuple[str, ArrayLike, ArrayLike]]]
) -> Path:
    """A panel a direction; each curve is a specimen's name, elongations in mm and loads in N."""
    figure = new_figure(4.2 * len(curves), 3.8)
    panels = figure.subplots(1, len(curves), squeeze=False)[0]
    for panel, (direction, specimens) in zip(panels, curves.items(), strict=True):
        for rank, (name, elongation, load) in enumerate(specimens):
            label = name if rank < NAMED else None
            panel.plot(elongation, load, linewidth=1.1, label=label, **named_look(rank))
        quiet(panel, "elongation of the gauge, mm", "load, N", direction)
        if any(name for name, _, _ in specimens[:NAMED]):
            panel.legend(frameon=False, fontsize=8)
    return save(figure, path)
