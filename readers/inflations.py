"""Find the inflations and releases of a sheet in the pressures of its frames, and choose frames.

At the same pressure, the apex of a conditioned sheet is higher than at the first loading.
"""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
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


# Reasons, in run records, why frames are not used.
BEYOND_LOG = "without a pressure: beyond the log"
AT_NO_PRESSURE = "at no pressure"
RELEASED = "after the largest pressure"
REPEATED = "at a pressure that another frame has"
OTHER_INFLATION = "of another inflation"
#: Pressures that differ by less than this share of the largest count as the same.
SAME_PRESSURE = 1e-6
#: How far from a requested pressure a frame may be, as a share of the largest requested one.
DEFAULT_TOLERANCE = 0.02


def choose_frames(
    pressures: Array,
    requested: Sequence[float] | None = None,
    count: int | None = None,
    tolerance: float | None = None,
    inflation: InflationChoice | None = None,
    rest_limit: float = 0.0,
) -> tuple[tuple[int, ...], dict[str, int]]:
    """Choose frames: those closest to requested pressures, a number spread evenly, or all.

    Parameters
    ----------
    pressures : (frames,) array, MPa
        Pressure recorded at each frame; NaN where unknown.
    requested : sequence of float, MPa, optional
        Pressures for which a frame is wanted.
    count : int, optional
        Number of frames, of each inflation and release.
    tolerance : float, MPa, optional
        Largest difference from a requested pressure; 2 % of the largest one if omitted.
    inflation : int or "all", optional
        Inflation that is taken, without its release, of frames in order of time; "all" takes
        every inflation and release. All frames are one inflation if omitted.
    rest_limit : float, MPa
        Pressure up to which a frame is at rest.

    Returns
    -------
    frames : tuple of int
        Indices of the frames, by rising pressure in an inflation and falling in a release.
    left_out : dict
        Number of frames that are not used, by reason.

    Raises
    ------
    InputError
        No frame is under pressure, close enough to a requested one, or of the chosen inflation; or
        there are fewer frames than `count`.
    """
    has_pressure = np.isfinite(pressures)
    is_loaded = has_pressure & (np.nan_to_num(pressures) > rest_limit)
    left_out = {
        BEYOND_LOG: int((~has_pressure).sum()),
        AT_NO_PRESSURE: int((has_pressure & ~is_loaded).sum()),
    }
    if not is_loaded.any():
        raise InputError(None, "", f"none of the {len(pressures)} frames is under pressure")
    branches = [np.arange(len(pressures))] if inflation is None else branches_of(pressures)
    branches = [branch[is_loaded[branch]] for branch in branches]
    if isinstance(inflation, int):
        branch, released_count = _branch_of_inflation(branches, inflation)
        branches = [branch]
        left_out[RELEASED] = released_count
        left_out[OTHER_INFLATION] = int(is_loaded.sum()) - len(branch) - released_count
    repeated_count = 0
    frames: list[int] = []
    for number, branch in enumerate(branches):
        rising = branch[np.argsort(pressures[branch], kind="stable")]
        if requested is not None and len(rising):
            frames += _nearest(pressures, rising, requested, tolerance)
            continue
        distinct = _distinct(pressures, rising, pressures[frames[-1]] if frames else -np.inf)
        repeated_count += len(rising) - len(distinct)
        chosen = distinct.tolist() if count is None else _spread(pressures, distinct, count)
        is_release = number % 2 == 1
        frames += reversed(chosen) if is_release else chosen
    left_out[REPEATED] = repeated_count
    return tuple(frames), {reason: n for reason, n in left_out.items() if n}


def _branch_of_inflation(
    branches: Sequence[NDArray[np.intp]], inflation: int
) -> tuple[NDArray[np.intp], int]:
    """Return the frames of an inflation, counted from 1, and how many the release after it has."""
    index = 2 * inflation - 2
    if index >= len(branches):
        count = (len(branches) + 1) // 2
        problem = f"{count} are in the frames, number {inflation} is not"
        raise InputError(None, "inflation", problem)
    return branches[index], sum(map(len, branches[index + 1 : index + 2]))


def _distinct(pressures: Array, rising: NDArray[np.intp], previous: float) -> NDArray[np.intp]:
    """Return the frames without those that repeat the pressure of another frame.

    Parameters
    ----------
    pressures : (frames,) array, MPa
    rising : array of int
        Indices of frames, by rising pressure.
    previous : float, MPa
        Pressure of the last frame of the branch before.
    """
    smallest_step = SAME_PRESSURE * np.nanmax(pressures)
    is_distinct = np.diff(pressures[rising], prepend=-np.inf) > smallest_step
    is_distinct &= np.abs(pressures[rising] - previous) > smallest_step
    return rising[is_distinct]


def _nearest(
    pressures: Array,
    candidates: NDArray[np.intp],
    requested: Sequence[float],
    tolerance: float | None,
) -> list[int]:
    """Return the candidate closest to each requested pressure; InputError beyond the tolerance.

    Parameters
    ----------
    pressures : (frames,) array, MPa
        Pressure of each frame.
    candidates : (n,) array of int
        Numbers of the frames that may be chosen.
    requested : sequence of float, MPa
    tolerance : float or None, MPa
        A share of the largest requested pressure if it is None.
    """
    limit = DEFAULT_TOLERANCE * max(requested) if tolerance is None else tolerance
    frames: list[int] = []
    for number, target in enumerate(requested):
        difference = np.abs(pressures[candidates] - target)
        frame = int(candidates[np.argmin(difference)])
        recorded = f"{1e3 * pressures[frame]:.4g} kPa"
        if difference.min() > limit * (1 + 1e-9):
            problem = (
                f"no frame within {1e3 * limit:.3g} kPa of {1e3 * target:.4g} kPa; the nearest was"
                f" recorded at {recorded}: ask for that, or say a larger tolerance"
            )
            raise InputError(None, f"pressures[{number}]", problem)
        if frame in frames:
            first = requested[frames.index(frame)]
            problem = (
                f"the frame at {recorded} is the nearest to {1e3 * first:.4g} and to"
                f" {1e3 * target:.4g} kPa; ask for one of them"
            )
            raise InputError(None, f"pressures[{number}]", problem)
        frames.append(frame)
    return frames


def _spread(pressures: Array, candidates: NDArray[np.intp], count: int) -> list[int]:
    """Return `count` frames at evenly spread pressures; candidates are sorted by pressure."""
    if len(candidates) < count:
        available = len(candidates)
        problem = f"expected at most the {available} frames at pressures of their own, got {count}"
        raise InputError(None, "frames", problem)
    targets = pressures[candidates[-1]] * np.arange(1, count + 1) / count
    frames: list[int] = []
    start = 0
    for number, target in enumerate(targets):
        # Each takes a frame above the previous one, and leaves one for each that follows.
        free = candidates[start : len(candidates) - (count - 1 - number)]
        nearest = int(np.argmin(np.abs(pressures[free] - target)))
        frames.append(int(free[nearest]))
        start += nearest + 1
    return frames
