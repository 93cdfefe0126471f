"""The three moduli of one law in one figure, each up to its failure strain (Fig. 3.8)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .style import BLUE, GREEN, VERMILION, logarithmic, new_figure, quiet, save, spans_a_decade

LINES = (
    (r"$E_1(\varepsilon_1)$ warp", VERMILION),
    (r"$E_2(\varepsilon_2)$ fill", BLUE),
    (r"$G_{12}(\gamma_{12})$ shear", GREEN),
)


def plot_moduli_together(
    path: Path | str,
    strains: ArrayLike,
    moduli: ArrayLike,
    sigma: ArrayLike | None = None,
    title: str = "",
) -> Path:
    """Draw E1, E2 and G12 in one axes; a dot ends each curve.

    The axis is logarithmic where the moduli are positive and span more than a decade, as the
    shear modulus of a coated fabric and its warp modulus do.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    strains : (3, k) logarithmic strain for E1, E2, G12, each from zero to failure.
    moduli : (3, k) MPa, in the same order.
    sigma : (3, k) MPa, one standard deviation, as bands; left out where it is not finite.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    x, curves = np.asarray(strains, dtype=float), np.asarray(moduli, dtype=float)
    figure = new_figure(7.0, 4.4)
    axes = figure.subplots()
    for m, (name, colour) in enumerate(LINES):
        axes.plot(x[m], curves[m], color=colour, linewidth=1.7, label=name)
        axes.plot(x[m, -1:], curves[m, -1:], "o", color=colour, markersize=5)
        if sigma is not None:
            s = np.asarray(sigma, dtype=float)[m]
            axes.fill_between(
                x[m], curves[m] - s, curves[m] + s, where=np.isfinite(s),
                color=colour, alpha=0.18, linewidth=0,
            )  # fmt: skip
    low, high = float(curves.min()), float(curves.max())
    if spans_a_decade(curves):
        logarithmic(axes)
        axes.set_ylim(low / 1.5, high * 1.5)
    else:
        axes.set_ylim(min(0.0, low), 1.08 * high)
    axes.set_xlim(left=0.0)
    quiet(axes, "logarithmic strain", "tangent modulus, MPa", title)
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return save(figure, path)
