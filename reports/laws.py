"""Forms of the law compared: how well they fit, and how well they predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .style import (
    BLUE,
    GREY,
    VERMILION,
    from_zero,
    legend_above,
    logarithmic,
    new_figure,
    quiet,
    save,
    spans_a_decade,
)

Array = NDArray[np.float64]

#: Of the two dots of a law, to both sides of its place; and of its folds, to one side again.
ASIDE, FURTHER = 0.14, 0.1


@dataclass(frozen=True, eq=False)
class LawRow:
    """One form of the law: name, number of coefficients, and its errors (N).

    `fitted` is the error on the data it was fitted to, `validated` the cross-validated error and
    `folds` that of every fold. NaN where there is no result.
    """

    name: str
    coefficients: int
    fitted: float
    validated: float = float("nan")
    folds: ArrayLike = ()


def plot_laws(
    path: Path | str,
    rows: Sequence[LawRow],
    scatter: float | None = None,
    label: str = "RMS error, N",
) -> Path:
    """Draw fit error and cross-validated error of every form side by side.

    Small dots are the single folds, a bar joins the smallest and the largest. The axis is
    logarithmic where the errors span more than a decade.

    Parameters
    ----------
    path : PNG, SVG or PDF.
    rows : in the order to be drawn, usually by number of coefficients.
    scatter : N, of the specimens: what no law can beat.
    label : of the error, with its unit.

    Raises
    ------
    ValueError : no rows.
    OutputError : the file cannot be written.
    """
    if not rows:
        raise ValueError("plot_laws: no laws to draw")
    figure = new_figure(max(5.5, 1.5 + 1.5 * len(rows)), 4.2)
    axes = figure.subplots()
    place = np.arange(len(rows), dtype=float)
    handles = {}
    folds = [np.asarray(row.folds, dtype=float).ravel() for row in rows]
    for a, values in zip((place + ASIDE).tolist(), folds, strict=True):
        ended = values[np.isfinite(values)]
        if len(ended):
            axes.plot([a, a], [ended.min(), ended.max()], color=VERMILION, linewidth=1.2, alpha=0.6)
            (handles["single folds"],) = axes.plot(
                np.full(len(ended), a + FURTHER), ended, "o", color=VERMILION, markersize=3.5,
                alpha=0.45, markeredgewidth=0,
            )  # fmt: skip
    dots: tuple[tuple[str, Array, list[float], str], ...] = (
        ("error of the fit", place - ASIDE, [r.fitted for r in rows], BLUE),
        ("cross-validated error", place + ASIDE, [r.validated for r in rows], VERMILION),
    )
    for name, x, errors, colour in dots:
        (handles[name],) = axes.plot(x, errors, "o", color=colour, markersize=8)
        for a, value in zip(x.tolist(), errors, strict=True):
            if np.isfinite(value):
                axes.annotate(
                    f"{value:.3g}", (a, value), xytext=(-7, 0), textcoords="offset points",
                    ha="right", va="center", fontsize=8.5, color=colour,
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
                )  # fmt: skip
    if scatter is not None:
        handles["scatter of specimens"] = axes.axhline(
            scatter, color=GREY, linewidth=1.4, linestyle=(0, (5, 3)), zorder=1
        )
    levels = np.concatenate([*folds, *(values for _, _, values, _ in dots), [scatter or np.nan]])
    if spans_a_decade(levels):
        logarithmic(axes)
    else:
        from_zero(axes, levels)
    axes.set_xlim(-0.6, len(rows) - 0.4)
    quiet(axes, "form of the moduli (number of coefficients)", label)
    axes.set_xticks(place, [_label(row, values) for row, values in zip(rows, folds, strict=True)])
    axes.grid(False, axis="x")
    order = [*(name for name, *_ in dots), "single folds", "scatter of specimens"]
    entries = {name: handles[name] for name in order if name in handles}
    legend_above(figure, entries, int(figure.get_figwidth() / 1.9))
    return save(figure, path)


def _label(row: LawRow, folds: Array) -> str:
    lost = int(np.sum(~np.isfinite(folds)))
    text = f"{row.name} ({row.coefficients})"
    if lost:
        text += f"\n{lost} fold{'s' if lost > 1 else ''} without a result"
    return text if np.isfinite(row.fitted) else f"{text}\nno fit"
