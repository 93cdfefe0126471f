"""Find the inflations and releases of a sheet in the pressures of its frames.

At the same pressure, the apex of a conditioned sheet is higher than at the first loading.
"""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..light_dataclasses import dataclass
from .frames import Array
from .histories import turns

#: Number of an inflation from 1, or all frames in their order.
InflationChoice = int | Literal["all"]
#: Row of a table of inflations: number of the inflation, pressure in kPa, height of the apex in mm
#: (in the first inflation, in the release before this one, in this one), and how much higher it is
#: than in the first inflation, in mm and in %.
InflationRow = tuple[int, float, float, float, float, float, float]
#: Smallest fall of a release over the rise before it, and smallest rise of an inflation over the
#: fall of the release before it.
TURNING_SHARE = 0.3
#: Fewest frames of an inflation.
MIN_FRAMES = 3
#: Largest number of pressures of an inflation that are printed.
MAX_PRINTED = 5


def branches_of(pressures: Array) -> list[NDArray[np.intp]]:
    """Return the indices of the frames of each inflation and release in turn.

    Parameters
    ----------
    pressures : (n,) array, MPa
        Pressure of each frame in order of time; frames without one (NaN) are in no branch.

    Returns
    -------
    list of arrays of int
        The first is an inflation. If the pressure does not turn, all frames are one inflation.
    """
    frames = np.flatnonzero(np.isfinite(pressures))
    rows = turns(
        pressures[frames],
        unloading_share=TURNING_SHARE,
        loading_share=TURNING_SHARE,
    )
    if len(rows) < 2:
        return [frames]
    # Frames before the first valley are in no branch; a turning point is the last of its branch.
    return np.split(frames[rows[0] :], [row + 1 - rows[0] for row in rows[1:-1]])


def has_several(pressures: Array) -> bool:
    """Return whether frames are of several inflations of enough frames each.

    Parameters
    ----------
    pressures : (frames,) array
        In order of time.
    """
    inflations = branches_of(pressures)[::2]
    return len(inflations) > 1 and min(map(len, inflations)) >= MIN_FRAMES


@dataclass(frozen=True, eq=False)
class Inflations:
    """Pressures and apex heights of frames of several inflations.

    Attributes
    ----------
    pressure : (n,) array, MPa
    height : (n,) array, mm
        Height of the apex, NaN where unknown.
    choice : int or "all"
        The inflation that a test takes.
    """

    pressure: Array
    height: Array
    choice: InflationChoice

    @property
    def curves(self) -> list[tuple[Array, Array]]:
        """Return pressures (MPa, rising) and heights (mm) of each inflation and release in turn."""
        curves = []
        for branch in branches_of(self.pressure):
            frames = branch[np.isfinite(self.height[branch])]
            pressure, first = np.unique(self.pressure[frames], return_index=True)
            curves.append((pressure, self.height[frames][first]))
        return curves

    @property
    def rows(self) -> list[InflationRow]:
        """Return a row for each later inflation and each pressure it shares with the first one.

        The height in the release before is NaN beyond its pressures.
        """
        first, *later = self.curves
        rows = []
        releases = later[0::2]
        inflations = later[1::2]
        for number, (release, inflation) in enumerate(
            zip(releases, inflations, strict=False), start=2
        ):
            for pressure in _common_pressures(first[0], inflation[0]):
                heights = [_height_at(pressure, *curve) for curve in (first, release, inflation)]
                rise = heights[2] - heights[0]
                rows.append((number, 1e3 * pressure, *heights, rise, 100 * rise / heights[0]))
        return rows

    @property
    def line(self) -> str:
        """Return which inflation is taken, in one line."""
        count = (len(self.curves) + 1) // 2
        if self.choice == "all":
            return f"all frames of {count} inflations are taken, in their order"
        state = "the first loading" if self.choice == 1 else "conditioned"
        advice = "inflation = N or 'all' takes others"
        return f"inflation {self.choice} of {count}, {state}, is taken; {advice}"

    @property
    def lines(self) -> Sequence[str]:
        """Return how far the apex is higher at a few common pressures."""
        return [
            f"inflation {number} at {pressure:.4g} kPa: apex {height:.4g} mm, {first:.4g} mm in "
            f"the first: {rise:+.2g} mm, {percent:+.2g} %"
            for number, pressure, first, _, height, rise, percent in self._printed_rows()
        ]

    def _printed_rows(self) -> Iterator[InflationRow]:
        """Yield rows of the table for the terminal: of many in an inflation, evenly spaced ones."""
        rows = self.rows
        for number in dict.fromkeys(row[0] for row in rows):
            rows_of_inflation = [row for row in rows if row[0] == number]
            yield from rows_of_inflation[:: -(-len(rows_of_inflation) // MAX_PRINTED)]


def _common_pressures(reference: Array, pressures: Array) -> Array:
    """Return the pressures above zero of `reference` that lie within the range of another one."""
    is_common = (reference >= np.min(pressures)) & (reference <= np.max(pressures))
    return reference[is_common & (reference > 0)]


def _height_at(pressure: float, pressures: Array, heights: Array) -> float:
    """Interpolate a height linearly in the cube root of the pressure, as a flat sheet rises.

    Parameters
    ----------
    pressures, heights : (n,) array
        Frames of an inflation; the heights are NaN beyond them.
    """
    return float(np.interp(np.cbrt(pressure), np.cbrt(pressures), heights, np.nan, np.nan))
