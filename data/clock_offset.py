"""How far two clocks are apart: the log's of the pressures, and the camera's of the frames.

The sheet rises while the pressure does, by a law that is not known here. At the right offset the
heights of the frames are therefore some rising function of the pressures, and the pressures one of
the heights; at a wrong one they are not, wherever the pressure was held, released, or raised faster
or slower. Both functions are found by isotonic regression, which supposes nothing else of them but
that a sheet that has not risen is at the least pressure of the log: where the pressure was raised
in equal steps, a step later would else do as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .offset_misfits import log_at, offset_misfits
from .rising import LEAST_FRAMES

Array = NDArray[np.float64]

#: Noise that no measurement is without, as a share of the variance: 0.1 % of the amplitude.
FLOOR = 1e-6
#: Offsets of a misfit up to so many times the smallest may be the right one.
AS_GOOD = 2.0
#: Misfit above which the heights do not follow the pressures; mean doubt of the frames' pressures,
#: as a share of their range, above which the offset is not known.
WORST_MISFIT, MOST_DOUBT = 0.05, 0.015


@dataclass(frozen=True, eq=False)
class ClockOffset:
    """The log's clock less that of the frames.

    Parameters
    ----------
    offset : s. lower, upper : s, the least and the largest offset that may be right; the offset
        itself where it was given.
    misfit : share of the variance of heights and pressures that no rising function explains; None
        where the offset was given.
    pressure : (frames,) MPa, of each frame; NaN beyond the log.
    doubt : (frames,) MPa, half of the range of each frame's pressure over all offsets that may be
        right.
    times : (frames,) s, by the frames' own clock. heights : (frames,) mm, NaN where none is known.
    """

    offset: float
    lower: float
    upper: float
    misfit: float | None
    pressure: Array
    doubt: Array
    times: Array
    heights: Array


def given_offset(
    offset: float, times: Array, heights: Array, log_times: Array, pressures: Array
) -> ClockOffset:
    """The pressures of frames by a clock offset (s) that is known; else as `find_offset`.

    Raises
    ------
    InputError : no frame lies within the log.
    """
    there = log_at(offset, times, log_times, pressures)
    if not np.isfinite(there).any():
        problem = (
            f"no frame lies within the log: frames from {times.min() + offset:.2f} to"
            f" {times.max() + offset:.2f} s by its clock, the log from {log_times[0]:.2f} to"
            f" {log_times[-1]:.2f} s"
        )
        raise InputError(None, "offset", problem)
    none = np.zeros(len(times))
    return ClockOffset(offset, offset, offset, None, there, none, times, heights)


def find_offset(times: Array, heights: Array, log_times: Array, pressures: Array) -> ClockOffset:
    """The offset at which heights rise with the pressures.

    Parameters
    ----------
    times : (frames,) s, by the frames' clock. heights : (frames,) mm; NaN where none is known.
    log_times, pressures : (k,) s, rising, and MPa.

    Raises
    ------
    InputError : too few frames, a log that is shorter than the frames; heights that follow the
        pressures at no offset; offsets that do equally well and give other pressures.
    """
    known = np.isfinite(heights)
    if known.sum() < LEAST_FRAMES:
        problem = f"{known.sum()} frames are too few to find it by; give it in s"
        raise InputError(None, "offset", problem)
    offsets, misfits = offset_misfits(times[known], heights[known], log_times, pressures)
    best = int(np.argmin(misfits))
    if misfits[best] > WORST_MISFIT:
        problem = (
            f"at no offset does the sheet rise with the pressure: at best, {offsets[best]:.2f} s,"
            f" {misfits[best]:.0%} of the variance is left; are these the log and the frames of one"
            " test, and their times right? else give the offset in s"
        )
        raise InputError(None, "offset", problem)
    able = misfits <= AS_GOOD * max(misfits[best], FLOOR)
    first = last = best
    while first and able[first - 1]:
        first -= 1
    while last + 1 < len(able) and able[last + 1]:
        last += 1
    offset = float(offsets[first] + offsets[last]) / 2
    may_be = offsets[able]
    some = np.append(may_be[:: max(1, len(may_be) // 200)], may_be[-1])
    each = np.array([log_at(s, times, log_times, pressures) for s in some])
    there = log_at(offset, times, log_times, pressures)
    doubt = _half_range(each)
    span = float(np.ptp(there[np.isfinite(there)]))
    if float(np.nanmean(doubt)) > MOST_DOUBT * span:
        problem = (
            f"cannot be found: offsets from {may_be[0]:.2f} to {may_be[-1]:.2f} s do as well, and"
            f" leave the frames' pressures uncertain by {1e3 * np.nanmean(doubt):.3g} kPa on"
            " average; give it in s. Where the pressure was held, released or began to rise while"
            " frames were taken, it can be found"
        )
        raise InputError(None, "offset", problem)
    lower, upper = float(may_be[0]), float(may_be[-1])
    least = float(misfits[best])
    return ClockOffset(offset, lower, upper, least, there, doubt, times, heights)


def _half_range(each: Array) -> Array:
    """(frames,) of pressures (offsets, frames); NaN where a frame is never within the log."""
    inside = np.isfinite(each)
    most = np.where(inside, each, -np.inf).max(axis=0)
    least = np.where(inside, each, np.inf).min(axis=0)
    half = np.full(each.shape[1], np.nan)
    some = inside.any(axis=0)
    half[some] = (most - least)[some] / 2
    return half
