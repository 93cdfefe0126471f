"""When what happens: the increments of all load cases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .content import Content
from .fields import DeckError


@dataclass
class Schedule:
    """times (increments,) at their ends; case (increments,) from 0; steps (increments,)."""

    times: NDArray[np.float64]
    case: NDArray[np.int64]
    steps: NDArray[np.float64]
    first: list[str]
    last: list[str]


def schedule_of(content: Content) -> Schedule:
    """The increments; DeckError where a table ends before them."""
    counts = [case.increments for case in content.cases]
    case = np.repeat(np.arange(len(counts)), counts)
    steps = np.array([content.cases[i].step for i in case])
    times = np.cumsum(steps)
    # A third, added up, is no whole number.
    times = np.where(np.abs(times - np.round(times)) < 1e-6, np.round(times), times)
    for table in content.tables.values():
        if table.variable == 1 and (table.x[0] != 0.0 or abs(table.x[-1] - times[-1]) > 1e-6):
            problem = f"table {table.number} goes from {table.x[0]:g} to {table.x[-1]:g}"
            raise DeckError(f"{problem}, the load cases from 0 to {times[-1]:g}")
    return Schedule(times, case, steps, content.cases[0].conditions, content.cases[-1].conditions)


def pressures(content: Content, schedule: Schedule, cases: int = 1) -> list[float]:
    """MPa that inflates, at the end of every increment of the first `cases` load cases."""
    loads = [content.conditions[name] for name in schedule.first]
    loads = [c for c in loads if c.kind != "fixed"]
    if len(loads) != 1 or loads[0].tables == [0]:
        raise DeckError("stand-in: one pressure with a table is what inflates")
    load = loads[0]
    if load.kind == "pressure" and (load.kind_number, load.values) != (2, [-1.0]):
        raise DeckError("stand-in: load type 2 of magnitude -1 inflates")
    if load.kind == "cavity" and load.kind_number != 1:
        raise DeckError("stand-in: a cavity is inflated by a pressure")
    table = content.tables[load.tables[0]]
    return [table.at(time) for time in schedule.times[schedule.case < cases]]
