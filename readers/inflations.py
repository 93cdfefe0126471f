"""A sheet that is inflated several times: inflations and releases found in the frames' pressures.

The apex of a conditioned sheet is higher than that of the first loading at the same pressure.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .histories import turns

Array = NDArray[np.float64]
#: Of the rise before it, what a release goes back; of the release, what an inflation rises again.
TURN = 0.3
#: The inflation that is taken, from 1, or every frame of all.
Which = int | Literal["all"]
#: Frames of an inflation, at least; pressures of the terminal.
FEWEST, FEW = 3, 5


def branches_of(pressures: Array) -> list[NDArray[np.intp]]:
    """Return the frames of each inflation and release in turn, of frames (n,) in order of time.

    Frames without a pressure (NaN) are in none. Where nothing rises, all are one inflation.
    """
    known = np.flatnonzero(np.isfinite(pressures))
    rows = turns(pressures[known], TURN, TURN)
    if len(rows) < 2:
        return [known]
    between = [row + 1 for row in rows[1:-1]]
    ends = zip([rows[0], *between], [*between, len(known)], strict=True)
    return [known[a:b] for a, b in ends]


def has_several(pressures: Array) -> bool:
    """Return whether frames are of several inflations, and not only in another order than time."""
    inflations = branches_of(pressures)[::2]
    return len(inflations) > 1 and min(map(len, inflations)) >= FEWEST


@dataclass(frozen=True, eq=False)
class Inflations:
    """Frames of several inflations, pressure (n,) MPa, height (n,) mm of the apex; and `taken`."""

    pressure: Array
    height: Array
    taken: Which

    @property
    def curves(self) -> list[tuple[Array, Array]]:
        """Return pressures (MPa, rising) and heights (mm) of each inflation and release in turn."""
        found = []
        for branch in branches_of(self.pressure):
            own = branch[np.isfinite(self.height[branch])]
            pressure, first = np.unique(self.pressure[own], return_index=True)
            found.append((pressure, self.height[own][first]))
        return found

    @property
    def rows(self) -> list[tuple[int, float, float, float, float, float, float]]:
        """Return a row a later inflation and common pressure, those of the first one's frames.

        Number, kPa; mm of the first inflation, of the release before this one (NaN beyond its
        pressures), of this one; mm and % that this one is higher than the first.
        """
        curves, found = self.curves, []
        for k in range(2, len(curves), 2):
            pressures = curves[0][0]
            most, least = (f(curves[k][0]) for f in (np.max, np.min))
            for p in pressures[(pressures >= least) & (pressures <= most) & (pressures > 0)]:
                # Straight in the cube root of the pressure, as a flat sheet rises.
                first, release, now = (
                    float(np.interp(np.cbrt(p), np.cbrt(x), y, np.nan, np.nan))
                    for x, y in (curves[0], curves[k - 1], curves[k])
                )
                more = now - first
                found.append((1 + k // 2, 1e3 * p, first, release, now, more, 100 * more / first))
        return found

    @property
    def line(self) -> str:
        """Return which inflation is taken, in one line."""
        count = (len(self.curves) + 1) // 2
        if self.taken == "all":
            return f"all frames of {count} inflations are taken, in their order"
        state = "the first loading" if self.taken == 1 else "conditioned"
        said = f"inflation {self.taken} of {count}, {state}, is taken"
        return f"{said}; inflation = N or 'all' takes others"

    @property
    def lines(self) -> Sequence[str]:
        """Return how far the apex is higher at a few common pressures."""
        said = []
        for number in dict.fromkeys(row[0] for row in self.rows):
            own = [row for row in self.rows if row[0] == number]
            for _, kilo, first, _, now, more, percent in own[:: -(-len(own) // FEW)]:
                said.append(
                    f"inflation {number} at {kilo:.4g} kPa: apex {now:.4g} mm, {first:.4g} mm in "
                    f"the first: {more:+.2g} mm, {percent:+.2g} %"
                )
        return said
