"""Choose frames of a bubble test by their pressures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frames import Array
from .inflations import InflationChoice, branches_of

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
        if requested is not None:
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
