"""Measured against modelled heights (as Figs 4.7 and 5.5)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .style import BLACK, new_figure, pressure_colours, quiet, save


def plot_heights(
    path: Path | str,
    pressures: ArrayLike,
    measured: Sequence[ArrayLike],
    modelled: Sequence[ArrayLike],
    measured_label: str = "measured",
) -> Path:
    """Draw modelled against measured z, and their difference, at every pressure.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    pressures : (frames,) MPa.
    measured, modelled : for each frame (k,) mm, at the same points.
    measured_label : "known" where the data were computed.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    frames = np.asarray(pressures, dtype=float)
    pairs = [
        (np.asarray(a, dtype=float).ravel(), np.asarray(b, dtype=float).ravel())
        for a, b in zip(measured, modelled, strict=True)
    ]
    seen, computed = (np.concatenate(side) for side in zip(*pairs, strict=True))
    figure = new_figure(10.0, 4.4)
    left, right = figure.subplots(1, 2)
    ends = [min(0.0, seen.min(), computed.min()), 1.03 * max(seen.max(), computed.max())]
    left.plot(ends, ends, color=BLACK, linewidth=0.9, zorder=3)
    right.axhline(0.0, color=BLACK, linewidth=0.9, zorder=3)
    for (z, model), p, colour in zip(pairs, frames, pressure_colours(len(frames)), strict=True):
        dots = {"color": colour, "markersize": 2.6, "linestyle": "", "marker": "o", "alpha": 0.75}
        left.plot(z, model, label=f"{1000 * p:.4g} kPa", **dots)
        right.plot(z, model - z, **dots)
    rms = float(np.sqrt(np.mean((computed - seen) ** 2)))
    spread = float(np.sum((seen - seen.mean()) ** 2))
    fit = 1.0 - float(np.sum((computed - seen) ** 2)) / spread if spread > 0 else float("nan")
    left.set_xlim(ends)
    left.set_ylim(ends)
    left.set_aspect("equal")
    quiet(left, f"{measured_label} z, mm", "modelled z, mm", f"$R^2$ = {_below_one(fit)}")
    quiet(
        right, f"{measured_label} z, mm", f"modelled $-$ {measured_label}, mm", f"RMS {rms:.2g} mm"
    )
    handles, labels = left.get_legend_handles_labels()
    figure.legend(
        handles[::-1], labels[::-1], loc="outside right center", frameon=False,
        fontsize=9, markerscale=2.0,
    )  # fmt: skip
    return save(figure, path)


def _below_one(value: float) -> str:
    """Three decimals, or the distance from 1 where those would hide it."""
    return f"{value:.3f}" if not value > 0.999 else f"1 $-$ {1.0 - value:.1e}"
