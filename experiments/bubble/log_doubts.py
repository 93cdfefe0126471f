"""Doubts about a pressure log, by the frames that were taken beside it."""

from collections.abc import Iterator

import numpy as np

from ...light_dataclasses import dataclass
from ...readers.clock_offset import ClockOffset
from ...solvers.base import Array


@dataclass(frozen=True)
class LogLimits:
    """Limits by which a log has a hole, or its pressure is not that of the sheet."""

    hole: float = 100.0  # median intervals of the log: a longer one is a hole, if it is ...
    shortest_hole: float = 60.0  # ... longer than this, s: some logs record changes only
    fall: float = 0.2  # share of the highest pressure by which the log falls, while ...
    sinking: float = 0.01  # ... the apex sinks by less than this share of its greatest height


LIMITS = LogLimits()


def doubts_of_log(clock: ClockOffset, log_times: Array) -> list[str]:
    """Return doubts about a log: holes, and pressures that the sheet does not follow.

    Parameters
    ----------
    clock : ClockOffset
        Times and heights of the frames, and the pressures that they have by the log.
    log_times : (k,) array, s
        Times of the readings of the log, by its own clock.
    """
    return [*_holes(clock, log_times), *_falls_of_a_still_sheet(clock)]


def _holes(clock: ClockOffset, log_times: Array) -> Iterator[str]:
    """Doubt a log that says nothing of a long time in which frames were taken.

    Parameters
    ----------
    log_times : (n,) array, s
        Times of the readings of the log.
    """
    intervals = np.diff(log_times)
    usual = float(np.median(intervals))
    k = int(np.argmax(intervals))
    start, end = log_times[k : k + 2]
    frame_times = clock.times + clock.offset
    is_among_frames = start < frame_times.max() and end > frame_times.min()
    longest = float(intervals[k])
    if longest > max(LIMITS.hole * usual, LIMITS.shortest_hole) and is_among_frames:
        yield (
            f"the log has a hole of {longest:.4g} s at {start:.4g} s, where readings are otherwise "
            f"{usual:.2g} s apart: was its clock set, or was it stopped? Pressures of frames there "
            "are interpolated"
        )


def _falls_of_a_still_sheet(clock: ClockOffset) -> Iterator[str]:
    """Doubt a log whose pressure falls while the apex stays where it is."""
    order = np.argsort(clock.times, kind="stable")
    is_known = np.isfinite(clock.pressure[order]) & np.isfinite(clock.heights[order])
    order = order[is_known]
    pressure = clock.pressure[order]
    height = clock.heights[order]
    if not len(order):
        return
    peak = np.maximum.accumulate(pressure)
    rows_of_peak = np.maximum.accumulate(np.where(pressure == peak, np.arange(len(order)), 0))
    has_fallen = peak - pressure > LIMITS.fall * pressure.max()
    is_still = height > height[rows_of_peak] - LIMITS.sinking * height.max()
    doubtful = np.flatnonzero(has_fallen & is_still)
    if len(doubtful):
        k = doubtful[0]
        yield (
            f"the log falls from {1e3 * peak[k]:.4g} to {1e3 * pressure[k]:.4g} kPa while the apex "
            f"stays at {height[k]:.4g} mm, in {len(doubtful)} of {len(order)} frames: a leak "
            "between the sheet and the gauge, or the log of another test; leave such frames out"
        )
