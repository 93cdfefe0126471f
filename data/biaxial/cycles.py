"""The cycles of a biaxial test: where each is loaded from, how far, and of which ratio it is.

A cycle begins where the larger of the two loads turns from falling to rising and ends where it does
so again. Turns that are small beside the range of the loads are noise or a hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from .ratios import nearest_ratio

Array = NDArray[np.float64]

#: Of the range of loads of a phase: a smaller turn is none.
TURN = 0.2
#: Of a cycle's range: how far from its lowest and highest load the loading begins and ends, so
#: that holds at the prestress and at the top, in which the fabric creeps, are no part of it.
HOLD = 0.01


@dataclass(frozen=True)
class Cycle:
    """One cycle, by rows of the test.

    ratio : "2:1". phase : number, from 1, of the row of cycles of one ratio that it is in; number :
    from 1, within its phase; count : from 1, in the whole test. first : row from which the
    fabric is loaded; last : row at which it is loaded most (both are of the loading).
    """

    ratio: str
    phase: int
    number: int
    count: int
    first: int
    last: int

    @property
    def rows(self) -> slice:
        """Of the loading."""
        return slice(self.first, self.last + 1)


def find_cycles(load: Array, labels: Sequence[str] | None = None) -> list[Cycle]:
    """The cycles in their order.

    Parameters
    ----------
    load : (n, 2) along warp and fill. labels : (n,) the ratio of each row; where there are none,
        that of the loads at the top of a cycle.
    """
    larger = np.asarray(load).max(axis=1)
    cycles: list[Cycle] = []
    for label, start, stop in _stretches(len(larger), labels):
        for first, last in _loadings(larger[start:stop]):
            ratio = label or nearest_ratio(load[start + last] - _base(load, start + first))
            same = bool(cycles) and cycles[-1].ratio == ratio
            before = cycles[-1] if cycles else None
            phase = 1 if before is None else before.phase + (0 if same else 1)
            number = before.number + 1 if before is not None and same else 1
            cycles.append(Cycle(ratio, phase, number, len(cycles) + 1, start + first, start + last))
    return cycles


def _base(load: Array, row: int) -> Array:
    """A prestress has no ratio of its own: what is below it does not count."""
    return np.asarray(np.minimum(load[row], load[row].min()))


def _stretches(count: int, labels: Sequence[str] | None) -> list[tuple[str | None, int, int]]:
    if labels is None:
        return [(None, 0, count)]
    found: list[tuple[str | None, int, int]] = []
    start = 0
    for label, same in groupby(labels):
        stop = start + len(list(same))
        found.append((label, start, stop))
        start = stop
    return found


def _loadings(s: Array) -> list[tuple[int, int]]:
    """First and last row of every loading in loads (n,)."""
    least = TURN * float(np.ptp(s)) if len(s) else 0.0
    if not least > 0:
        return []
    found = []
    for low, high in _rises(s, least):
        hold = HOLD * (s[high] - s[low])
        first = low + int(np.flatnonzero(s[low : high + 1] <= s[low] + hold)[-1])
        last = first + int(np.flatnonzero(s[first : high + 1] >= s[high] - hold)[0])
        found.append((first, last))
    return found


def _rises(s: Array, least: float) -> list[tuple[int, int]]:
    """Rows of a valley and of the peak after it, for each rise of more than `least`."""
    found, low, high, rising = [], 0, 0, False
    for i in range(len(s)):
        if rising:
            if s[i] > s[high]:
                high = i
            elif s[i] < s[high] - least:
                found.append((low, high))
                rising, low = False, i
        elif s[i] < s[low]:
            low = i
        elif s[i] > s[low] + least:
            rising, high = True, i
    return [*found, (low, high)] if rising else found
