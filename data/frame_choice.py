"""Which frames of a test are taken: by the pressure at which each was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]

#: Why frames are not looked at.
BEYOND = "without a pressure: beyond the log"
AT_REST = "at no pressure"
RELEASED = "after the largest pressure"
REPEATED = "at a pressure that another frame has"
#: Pressures that differ by less than this share of the largest are one.
SAME = 1e-6
#: How far from an asked pressure a frame may be, as a share of the largest asked one.
TOLERANCE = 0.02


@dataclass(frozen=True, eq=False)
class FrameChoice:
    """Numbers of the frames taken, by rising pressure, and how many were not looked at, by why."""

    frames: tuple[int, ...]
    left_out: dict[str, int] = field(default_factory=dict)


def choose_frames(
    pressures: Array,
    asked: Sequence[float] | None = None,
    count: int | None = None,
    tolerance: float | None = None,
    in_time: bool = False,
) -> FrameChoice:
    """The frame nearest to each asked pressure, or `count` evenly spread in pressure, or all.

    Parameters
    ----------
    pressures : (frames,) MPa, of every frame; NaN where it is not known.
    asked : MPa, rising. tolerance : MPa, how far a frame may be from the asked pressure; 2 % of the
        largest asked one unless given.
    in_time : whether the frames are in the order of time: those after the largest pressure are then
        of the release, and not taken.

    Raises
    ------
    InputError : no frame under pressure, none near an asked pressure, one that is nearest to two;
        fewer frames than `count`.
    """
    known, left_out = np.isfinite(pressures), {}
    able = known & (np.nan_to_num(pressures) > 0)
    left_out[BEYOND] = int((~known).sum())
    left_out[AT_REST] = int((known & ~able).sum())
    if not able.any():
        raise InputError(None, "", f"none of the {len(pressures)} frames is under pressure")
    top = int(np.argmax(np.where(able, pressures, -np.inf)))
    if in_time:
        later = able & (np.arange(len(pressures)) > top)
        left_out[RELEASED] = int(later.sum())
        able &= ~later
    order = np.flatnonzero(able)
    order = order[np.argsort(pressures[order], kind="stable")]
    apart = np.diff(pressures[order], prepend=-np.inf) > SAME * pressures[top]
    if asked is not None:
        frames = _nearest(pressures, order, asked, tolerance)
    elif count is not None:
        left_out[REPEATED] = int((~apart).sum())
        frames = _spread(pressures, order[apart], count)
    else:
        left_out[REPEATED] = int((~apart).sum())
        frames = order[apart].tolist()
    return FrameChoice(tuple(frames), {why: n for why, n in left_out.items() if n})


def _nearest(
    pressures: Array, able: NDArray[np.intp], asked: Sequence[float], tolerance: float | None
) -> list[int]:
    limit = TOLERANCE * max(asked) if tolerance is None else tolerance
    taken: list[int] = []
    for number, wanted in enumerate(asked):
        off = np.abs(pressures[able] - wanted)
        frame = int(able[np.argmin(off)])
        there = f"{1e3 * pressures[frame]:.4g} kPa"
        if off.min() > limit * (1 + 1e-9):
            problem = (
                f"no frame within {1e3 * limit:.3g} kPa of {1e3 * wanted:.4g} kPa; the nearest was"
                f" recorded at {there}: ask for that, or say a larger tolerance"
            )
            raise InputError(None, f"pressures[{number}]", problem)
        if frame in taken:
            first = asked[taken.index(frame)]
            problem = (
                f"the frame at {there} is the nearest to {1e3 * first:.4g} and to"
                f" {1e3 * wanted:.4g} kPa; ask for one of them"
            )
            raise InputError(None, f"pressures[{number}]", problem)
        taken.append(frame)
    return taken


def _spread(pressures: Array, able: NDArray[np.intp], count: int) -> list[int]:
    if len(able) < count:
        problem = f"expected at most the {len(able)} frames at pressures of their own, got {count}"
        raise InputError(None, "frames", problem)
    levels = pressures[able[-1]] * np.arange(1, count + 1) / count
    taken: list[int] = []
    for number, level in enumerate(levels):
        # Each takes a frame above the one before, and leaves one for each that follows.
        first = 1 + int(np.flatnonzero(able == taken[-1])[0]) if taken else 0
        free = able[first : len(able) - (count - 1 - number)]
        taken.append(int(free[np.argmin(np.abs(pressures[free] - level))]))
    return taken
