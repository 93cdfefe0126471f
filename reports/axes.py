"""Where the values of a chart lie on its axes: ends, and places from 0 to 1000."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite, log10

from .charts import Chart, Numbers
from .ticks import log_ticks, ticks

#: Places along an axis.
PLACES = 1000.0
#: Free room beyond what is drawn, as a share of it.
ROOM = 0.05


@dataclass(frozen=True)
class Axis:
    """From low to high, in the unit of the axis; logarithmic or not."""

    low: float
    high: float
    log: bool = False

    def place(self, value: float | None) -> float | None:
        """0 at the low end, `PLACES` at the high one; None for what has no place."""
        if value is None or not isfinite(value) or (self.log and value <= 0):
            return None
        ends = self.low, self.high
        if self.log:
            value, ends = log10(value), (log10(self.low), log10(self.high))
        return PLACES * (value - ends[0]) / (ends[1] - ends[0])

    @property
    def ticks(self) -> list[float]:
        """Round numbers between the ends."""
        return (log_ticks if self.log else ticks)(self.low, self.high)


def axes_of(chart: Chart) -> tuple[Axis, Axis]:
    """The x and the y axis of a chart, with a little room around what is drawn."""
    along = (s.x for s in chart.series)
    up = (v for s in chart.series for v in (s.y, s.lower, s.upper))
    if chart.top is not None:
        up = (s.y for s in chart.series)
    level = [] if chart.level is None else [chart.level]
    values = [*_known(up, chart.log_y), *level]
    y = _axis(values, chart.log_y, ROOM)
    least = min(values, default=0.0)
    if not chart.log_y and least >= 0 and (chart.from_zero or y.low < 0.25 * y.high):
        y = Axis(0.0, y.high)
    if chart.top is not None:
        y = Axis(y.low, max(chart.top, y.low + 1e-12), chart.log_y)
    if chart.x_names:
        return Axis(0.5, len(chart.x_names) + 0.5), y
    dotted = any(s.look == "dots" or s.marks for s in chart.series)
    return _axis(_known(along, chart.log_x), chart.log_x, 0.02 if dotted else 0.0), y


def _known(several: Iterable[Numbers], log: bool) -> list[float]:
    return [v for own in several for v in own if v is not None and (v > 0 or not log)]


def _axis(values: list[float], log: bool, room: float) -> Axis:
    if not values:
        return Axis(1.0 if log else 0.0, 10.0 if log else 1.0, log)
    low, high = min(values), max(values)
    if log:
        share = max((high / low) ** room, 1.0 if high > low else 2.0)
        return Axis(low / share, high * share, log)
    span = high - low
    more = room * span if span > 0 else 0.5 * abs(high) or 0.5
    return Axis(low - more, high + more)
