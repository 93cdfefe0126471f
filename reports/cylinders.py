"""Charts of bent cylinders: load over deflection, their gas, and the bent beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..readers.bending import BendingCurve, BendingScatter
from .charts import Array, Chart, Charts, Series, band, dots, faces, line, shades_of

Point = tuple[float, float]

MM3_PER_LITRE = 1e6
ALONG = "deflection of the collar, mm"
#: mm of the collar's wall, which the model does not have: only for the eye.
WALL = 12.0
#: Beside the collar, in its lengths: how far the close view goes.
CLOSE = 2.2


@dataclass(frozen=True, eq=False)
class BendLine:
    """The curve of one card.
    name : of the card. rank : of its colour, the same in every figure. deflection, load, pressure,
    volume : (frames,) mm, N, MPa, mm^3. knee, limit : where they are, mm and N. rms : N, against
    what was measured. other : deflection (mm) and load (N) of the other end of a band that begins
    at the curve. off : (frames,) N, how far the load may be off to either side by what the card
    leaves open."""

    name: str
    rank: int
    deflection: Array
    load: Array
    pressure: Array | None = None
    volume: Array | None = None
    knee: Point | None = None
    limit: Point | None = None
    rms: float | None = None
    other: tuple[ArrayLike, ArrayLike] | None = None
    off: Array | None = None


@dataclass(frozen=True, eq=False)
class BendPanel:
    """One case: a curve a card, repetitions with their scatter, what curves may be off by.
    along : the name of the deflection."""

    title: str
    lines: Sequence[BendLine] = ()
    readings: Sequence[BendingCurve] = ()
    measured: BendingScatter | None = None
    spread: str = ""
    along: str = ALONG


@dataclass(frozen=True)
class BeamBodies:
    """Rigid bodies when bent, mm; supports : (z, y) of the axes; collar_height : y of its axis.
    collars : z of each collar, or strap."""

    supports: tuple[tuple[float, float], ...]
    support_radius: float
    collar_height: float
    collar_radius: float
    collar_length: float
    collars: tuple[float, ...] = (0.0,)

    @property
    def name(self) -> str:
        """Return the name of what loads the beam."""
        return "collar" if self.collars == (0.0,) else "strap"


def bending_charts(
    panels: Sequence[BendPanel], caption: str = "", columns: int = 0, misses: bool = False
) -> Charts:
    """Return load over deflection, a chart a case; in columns, a row has the same loads."""
    drawn = [panel for panel in panels if panel.lines or columns > 1]
    charts = [_loads(panel) for panel in drawn]
    if columns > 1:
        charts = [
            replace(chart, x_range=_range(charts, "x"), y_range=_range(row, "y"))
            for row in (charts[k : k + columns] for k in range(0, len(charts), columns))
            for chart in row
        ]
    charts += [_misses(panel) for panel in drawn if misses and panel.measured is not None]
    return Charts("loads", charts, caption, columns)


def _range(charts: Sequence[Chart], axis: str) -> tuple[float, float]:
    """Return the range of an axis that holds all that several charts draw."""
    fields = ("x",) if axis == "x" else ("y", "upper")
    every = [v for c in charts for s in c.series for f in fields for v in getattr(s, f)]
    return 0.0, 1.06 * max([v for v in every if v is not None], default=0.0) or 1.0


def _loads(panel: BendPanel) -> Chart:
    series: list[Series] = []
    if panel.measured is not None:
        seen = panel.measured
        ends = seen.mean - seen.deviation, seen.mean + seen.deviation
        series.append(band("scatter of repetitions (±)", seen.deflection, *ends, colour=7))
        series.append(line("mean", seen.deflection, seen.mean, colour=7, wide=True))
        series += [dots("measured", c.deflection, c.load, colour=7) for c in panel.readings]
    known = [(own.name, own.rms) for own in panel.lines if own.rms is not None]
    for own in panel.lines:
        look = 1 + own.rank % 6
        sure = None if own.off is None else (own.load - own.off, own.load + own.off)
        series.append(line(own.name, own.deflection, own.load, sure, colour=look))
        if own.other is not None:
            series.append(line(f"{own.name}, other end", *own.other, colour=look, dashes=1))
        for words, point, shape in (
            ("knee", own.knee, "diamond"), ("limit point", own.limit, "triangle-up")
        ):  # fmt: skip
            if point is not None:
                at = [point[0]], [point[1]]
                series.append(dots(words, *at, colour=look, shape=shape, hollow=True))
    sides = [panel.spread] if any(own.off is not None for own in panel.lines) else []
    series += [band(name, (), (), (), colour=1 + panel.lines[0].rank % 6) for name in sides if name]
    highest = max((float(own.load.max()) for own in panel.lines), default=0.0)
    alt = f"{panel.title}: load over deflection, up to {highest:.4g} N"
    alt += "".join(f"; {name}: RMS error {rms:.3g} N" for name, rms in known)
    title = panel.title
    if len(known) == 1:
        title += f": RMS error {known[0][1]:.3g} N"
    return Chart(title, panel.along, "load, N", series, alt, from_zero=True)


def _misses(panel: BendPanel) -> Chart:
    seen = panel.measured
    assert seen is not None
    grid, spread = seen.deflection, seen.deviation
    series = [band("scatter of repetitions (±)", grid, -spread, spread, colour=7)]
    for own in panel.lines:
        off = np.interp(grid, own.deflection, own.load, left=np.nan, right=np.nan) - seen.mean
        series.append(line(own.name, grid, off, colour=1 + own.rank % 6))
    known = [f"{own.name} {own.rms:.3g} N" for own in panel.lines if own.rms is not None]
    title = f"RMS error: {', '.join(known)}" if known else ""
    alt = f"{panel.title}: model less mean of the readings"
    return Chart(title, panel.along, "model − mean, N", series, alt, level=0.0)


def gas_charts(panel: BendPanel) -> Charts:
    """Return gauge pressure against change of volume and against deflection."""
    by_volume: list[Series] = []
    by_way: list[Series] = []
    for own in panel.lines:
        assert own.pressure is not None and own.volume is not None
        pressure, volume = 1e3 * own.pressure, own.volume / MM3_PER_LITRE
        name, look = f"{own.name}, from {volume[0]:.4g} litres", 1 + own.rank % 6
        by_volume.append(line(name, volume - volume[0], pressure, colour=look))
        by_way.append(line(name, own.deflection, pressure, colour=look))
    across, up = "volume less that when inflated, litres", "gauge pressure, kPa"
    charts = [
        Chart(panel.title, across, up, by_volume, f"{panel.title}: pressure over volume"),
        Chart("", panel.along, up, by_way, f"{panel.title}: pressure over deflection"),
    ]
    return Charts("gas", charts, "")


def beam_charts(
    now: Array, cells: NDArray[np.intp], strain: Array, before: Array,
    section: tuple[Array, Array], bodies: BeamBodies, title: str = "",
) -> Charts:  # fmt: skip
    """Return a whole beam true to scale, coloured by its strain along the axis.
    now : (n, 3) mm, positions; z along the axis, y up. cells : (m, 4). strain : (m,) log strain
    along the axis when bent. before : (k, 2) mm, the inflated beam from the side as a closed line
    (z, y). section : (k, 2) mm, the mid-span ring as a closed line (x, y), inflated and bent.
    bodies : supports and collar when bent."""
    # Wrinkles take up many times the strain that the fabric carries: all of them one colour.
    most = max(float(strain.max()), 1e-6)
    values = np.clip(strain, -most, most)
    # Of the two halves the eye sees one; what is nearer hides what is behind.
    seen = np.flatnonzero(now[cells, 0].mean(axis=1) >= 0)
    seen = seen[np.argsort(now[cells[seen], 0].mean(axis=1))]
    body = faces("", now[cells[seen]][:, :, [2, 1]], values[seen])
    series = [
        line("support", *_circle(z, y, bodies.support_radius), colour=3) for z, y in bodies.supports
    ]
    half, r = 0.5 * bodies.collar_length, bodies.collar_radius
    for z in bodies.collars:
        for y in (bodies.collar_height - r - WALL, bodies.collar_height + r):
            x = [z - half, z + half, z + half, z - half, z - half]
            series.append(line(bodies.name, x, [y, y, y + WALL, y + WALL, y], colour=0))
    side = [body, line("inflated", *before.T, colour=7, dashes=1), *series]
    ring, middle = bodies.collar_radius + WALL, bodies.collar_height
    feet = [y - bodies.support_radius for _, y in bodies.supports]
    low = min(float(now[:, 1].min()), middle - ring, *feet)
    high = max(float(now[:, 1].max()), float(before[:, 1].max()), middle + ring)
    ends, reach = float(np.abs(now[:, 2]).max()), CLOSE * bodies.collar_length
    at = bodies.collars[-1]
    tall, axes = bodies.collar_radius + 4 * WALL, ("z, mm", "y, mm")
    shades = shades_of(values)
    scale: dict[str, Any] = {"equal": True, "scale": "log strain along the axis", "shades": shades}
    whole = Chart(title, *axes, side, f"{title}: the bent beam from the side",
                  x_range=(-1.03 * ends, 1.03 * ends), y_range=(low - 20, high + 20),
                  **scale)  # fmt: skip
    close = Chart(f"at the {bodies.name}", *axes, side, f"the bent beam at the {bodies.name}",
                  x_range=(at - reach, at + reach), y_range=(middle - tall, middle + tall),
                  **scale)  # fmt: skip
    return Charts("beam", [whole, close, _cut(section, bodies)], "", columns=2)


def _circle(x: float, y: float, radius: float) -> tuple[Array, Array]:
    turn = np.linspace(0.0, 2.0 * np.pi, 73)
    return x + radius * np.cos(turn), y + radius * np.sin(turn)


def _cut(section: tuple[Array, Array], bodies: BeamBodies) -> Chart:
    before, now = section
    circle = _circle(0.0, bodies.collar_height, bodies.collar_radius + 0.5 * WALL)
    series = [
        *([line("collar", *circle)] if 0.0 in bodies.collars else []),
        line("inflated", *before.T, colour=7, dashes=1),
        line("bent", *now.T, colour=3),
    ]
    alt = "the beam cut at mid-span, inflated and bent"
    return Chart("cut at mid-span", "x, mm", "y, mm", series, alt, equal=True)
