"""Load over deflection of bent cylinders, and their gas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from .style import BLACK, GREY, legend_above, named_look, new_figure, quiet, save

Point = tuple[float, float]

DOTS: dict[str, Any] = {
    "color": GREY, "marker": "o", "markersize": 3.6, "linestyle": "", "alpha": 0.85,
}  # fmt: skip
BAND = "#E0E0E0"
MEAN: dict[str, Any] = {"color": "#777777", "linewidth": 4.0, "alpha": 0.45}
KNEE: dict[str, Any] = {"marker": "D", "markersize": 5.5, "markerfacecolor": "white"}
LIMIT: dict[str, Any] = {"marker": "^", "markersize": 7.0, "markerfacecolor": "white"}
#: How much of its card's colour a band has.
BETWEEN = 0.22
#: How it is drawn how far a curve may be off.
DOTTED: dict[str, Any] = {"linestyle": (0, (1, 1.2)), "linewidth": 1.2}
MM3_PER_LITRE = 1e6


@dataclass(frozen=True, eq=False)
class BendLine:
    """The curve of one card.

    Parameters
    ----------
    name : of the card. rank : of its colour, the same in every figure.
    deflection, load, pressure, volume : (frames,) mm, N, MPa, mm^3.
    knee, limit : where they are, mm and N.
    rms : N, against what was measured.
    other : deflection (mm) and load (N) of the other end of a band that begins at the curve.
    off : (frames,) N, how far the load may be off to either side by what the card leaves open.
    """

    name: str
    rank: int
    deflection: ArrayLike
    load: ArrayLike
    pressure: ArrayLike = ()
    volume: ArrayLike = ()
    knee: Point | None = None
    limit: Point | None = None
    rms: float | None = None
    other: tuple[ArrayLike, ArrayLike] | None = None
    off: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class BendReadings:
    """What was measured: every repetition's readings, their mean and scatter on one grid (k,)."""

    readings: Sequence[tuple[ArrayLike, ArrayLike]]
    deflection: ArrayLike
    mean: ArrayLike
    deviation: ArrayLike


@dataclass(frozen=True, eq=False)
class BendPanel:
    """One case: what it is called, a curve a card, what was measured, what a band goes between,
    and what the curves may be off by.
    """

    title: str
    lines: Sequence[BendLine] = ()
    measured: BendReadings | None = None
    band: str = ""
    spread: str = ""


def plot_bending(path: Path | str, panel: BendPanel) -> Path:
    """Draw one case; beneath it, where there are readings, what the cards miss.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    rows = 2 if panel.measured is not None else 1
    figure = new_figure(7.6, 4.9 if rows == 1 else 6.4)
    panels = figure.subplots(rows, 1, squeeze=False, sharex=True, height_ratios=[2.3, 1.0][:rows])[
        :, 0
    ]
    _loads(panels[0], panel)
    along = "deflection of the collar, mm"
    quiet(panels[0], along if rows == 1 else "", "load, N", panel.title)
    if panel.measured is not None:
        panels[0].tick_params(labelbottom=False)
        _misses(panels[1], panel)
        quiet(panels[1], along, "model $-$ mean, N")
    legend_above(figure, _entries([panel]), 3)
    return save(figure, path)


def plot_bending_cases(path: Path | str, panels: Sequence[BendPanel], columns: int) -> Path:
    """Draw all cases small, the same loads in a row; panels without a title are left free.

    Parameters
    ----------
    panels : row by row, `columns` in each.

    Raises
    ------
    ValueError : no panels. OutputError : the file cannot be written.
    """
    if not panels:
        raise ValueError("plot_bending_cases: no cases to draw")
    rows = ceil(len(panels) / columns)
    figure = new_figure(1.0 + 3.4 * columns, 1.0 + 2.5 * rows)
    drawn = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey="row")
    longest = max(map(_longest, panels))
    for place, axes in enumerate(drawn.ravel()):
        column = place % columns
        panel = panels[place] if place < len(panels) else BendPanel("")
        if not panel.title:
            axes.set_axis_off()
            continue
        _loads(axes, panel)
        below = place + columns >= len(panels) or not panels[place + columns].title
        axes.tick_params(labelbottom=below)
        x = "deflection, mm" if below else ""
        quiet(axes, x, "load, N" if column == 0 else "", panel.title)
    for row in range(rows):
        highest = [_highest(p) for p in panels[row * columns : (row + 1) * columns]]
        drawn[row, 0].set_ylim(0.0, 1.06 * max(highest) or 1.0)
    drawn[0, 0].set_xlim(0.0, 1.03 * longest or 1.0)
    legend_above(figure, _entries(panels), 2 * columns)
    return save(figure, path)


def plot_gas(path: Path | str, panel: BendPanel) -> Path:
    """Draw gauge pressure against change of volume and against deflection.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    figure = new_figure(9.6, 4.3)
    left, right = figure.subplots(1, 2, sharey=True)
    entries: dict[str, Any] = {}
    for line in panel.lines:
        pressure = 1e3 * np.asarray(line.pressure, dtype=float)
        volume = np.asarray(line.volume, dtype=float) / MM3_PER_LITRE
        name = f"{line.name}, from {volume[0]:.4g} litres"
        volume = volume - volume[0]
        look = {"linewidth": 1.6, **named_look(line.rank)}
        left.plot(volume, pressure, **look)
        entries[name] = Line2D([], [], **look)
        right.plot(np.asarray(line.deflection, dtype=float), pressure, **look)
    right.set_xlim(left=0.0)
    quiet(left, "volume less that when inflated, litres", "gauge pressure, kPa", panel.title)
    quiet(right, "deflection of the collar, mm", "")
    legend_above(figure, entries, 3)
    return save(figure, path)


def _loads(axes: Axes, panel: BendPanel) -> None:
    if panel.measured is not None:
        seen = panel.measured
        grid, mean = np.asarray(seen.deflection, float), np.asarray(seen.mean, float)
        spread = np.asarray(seen.deviation, float)
        axes.fill_between(grid, mean - spread, mean + spread, color=BAND, linewidth=0, zorder=0)
        axes.plot(grid, mean, zorder=1, **MEAN)
        for reading in seen.readings:
            axes.plot(*reading, zorder=2, **DOTS)
    drawn = []
    for line in panel.lines:
        look = named_look(line.rank)
        _to_other_end(axes, line)
        drawn.append(axes.plot(line.deflection, line.load, linewidth=1.6, **look)[0])
        _spread(axes, line)
        for point, marker in ((line.knee, KNEE), (line.limit, LIMIT)):
            if point is not None:
                axes.plot(*point, color=look["color"], linestyle="", zorder=6, **marker)
    axes.set_xlim(0.0, 1.03 * _longest(panel) or 1.0)
    axes.set_ylim(0.0, 1.06 * _highest(panel) or 1.0)
    known = [(h, x.rms) for h, x in zip(drawn, panel.lines, strict=True) if x.rms is not None]
    if known:
        axes.legend(
            [handle for handle, _ in known], [f"{rms:.3g} N" for _, rms in known],
            title="RMS error", title_fontsize=9, fontsize=9, framealpha=0.85, edgecolor="none",
        )  # fmt: skip


def _to_other_end(axes: Axes, line: BendLine) -> None:
    """The band between a curve and its other end, as far as both go."""
    if line.other is None:
        return
    color = named_look(line.rank)["color"]
    way, load = (np.asarray(values, dtype=float) for values in line.other)
    axes.plot(way, load, color=color, linewidth=0.6, alpha=0.6, zorder=1)
    x, y = np.asarray(line.deflection, dtype=float), np.asarray(line.load, dtype=float)
    grid = np.union1d(x, way)
    grid = grid[grid <= min(x[-1], way[-1])]
    both = np.interp(grid, x, y), np.interp(grid, way, load)
    axes.fill_between(grid, *both, color=color, alpha=BETWEEN, linewidth=0, zorder=1)


def _spread(axes: Axes, line: BendLine) -> None:
    """Between what the curve may lie: dotted, so that it is told from the band of the walls."""
    if line.off is None:
        return
    off, load = np.asarray(line.off, dtype=float), np.asarray(line.load, dtype=float)
    color = named_look(line.rank)["color"]
    for end in (load - off, load + off):
        axes.plot(line.deflection, end, color=color, zorder=2, **DOTTED)


def _highest(panel: BendPanel) -> float:
    """The largest load drawn, N."""
    loads = [np.asarray(x.load, dtype=float) for x in panel.lines]
    loads += [
        np.nan_to_num(np.asarray(x.load, dtype=float) + np.asarray(x.off, dtype=float))
        for x in panel.lines
        if x.off is not None
    ]
    loads += [np.asarray(x.other[1], dtype=float) for x in panel.lines if x.other is not None]
    if panel.measured is not None:
        loads += [np.asarray(y, dtype=float) for _, y in panel.measured.readings]
    return max((float(y.max()) for y in loads), default=0.0)


def _longest(panel: BendPanel) -> float:
    """The largest deflection drawn, mm."""
    ways = [np.asarray(x.deflection, dtype=float) for x in panel.lines]
    ways += [np.asarray(x.other[0], dtype=float) for x in panel.lines if x.other is not None]
    if panel.measured is not None:
        ways += [np.asarray(x, dtype=float) for x, _ in panel.measured.readings]
    return max((float(x.max()) for x in ways), default=0.0)


def _misses(axes: Axes, panel: BendPanel) -> None:
    seen = panel.measured
    assert seen is not None
    grid, mean = np.asarray(seen.deflection, float), np.asarray(seen.mean, float)
    spread = np.asarray(seen.deviation, float)
    axes.fill_between(grid, -spread, spread, color=BAND, linewidth=0, zorder=0)
    axes.axhline(0.0, color=BLACK, linewidth=0.8, zorder=1)
    for line in panel.lines:
        x, y = np.asarray(line.deflection, float), np.asarray(line.load, float)
        there = np.interp(grid, x, y, left=np.nan, right=np.nan) - mean
        axes.plot(grid, there, linewidth=1.6, **named_look(line.rank))


def _entries(panels: Sequence[BendPanel]) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for line in sorted((x for p in panels for x in p.lines), key=lambda x: x.rank):
        entries[line.name] = Line2D([], [], linewidth=1.6, **named_look(line.rank))
    banded = [(p.band, x.rank) for p in panels for x in p.lines if x.other is not None]
    for words, rank in reversed(banded):  # of the first card's colour
        entries[words] = Patch(color=named_look(rank)["color"], alpha=BETWEEN)
    sure = [(p.spread, x.rank) for p in panels for x in p.lines if x.off is not None]
    for words, rank in reversed(sure):
        entries[words] = Line2D([], [], color=named_look(rank)["color"], **DOTTED)
    if any(p.measured for p in panels):
        entries["measured"] = Line2D([], [], **DOTS)
        entries["mean"] = Line2D([], [], **MEAN)
        entries["scatter of repetitions (±)"] = Patch(color=BAND)
    for name, kind, marker in (("knee", "knee", KNEE), ("limit point", "limit", LIMIT)):
        if any(getattr(x, kind) is not None for p in panels for x in p.lines):
            entries[name] = Line2D([], [], color=BLACK, linestyle="", **marker)
    return entries
