"""experiments/bubble/log_doubts.py: holes in a log, and pressures the sheet does not follow."""

import numpy as np
import pytest
from bubblefit.experiments.bubble.log_doubts import doubts_of_log
from bubblefit.readers.clock_offset import given_offset

CLOCK = np.arange(0.0, 200.0, 0.2)
TIMES = np.arange(0.0, 180.0, 2.0)


def doubts(heights, log_times, pressures, times=TIMES):
    return doubts_of_log(given_offset(5.0, times, heights, log_times, pressures), log_times)


def pressure(t):
    return 0.1 * np.clip(t / 100, 0, 1)


HEIGHTS = 40 * np.cbrt(pressure(TIMES + 5.0) / 0.1)


def test_log_of_one_inflation_and_its_release_is_not_doubted():
    assert doubts(HEIGHTS, CLOCK, pressure(CLOCK)) == []
    released = np.where(CLOCK > 120, 0.1 * np.exp((120 - CLOCK) / 20), pressure(CLOCK))
    at_frames = np.interp(TIMES + 5.0, CLOCK, released)
    # A sheet that has crept stands higher when the pressure falls.
    assert doubts(42 * np.cbrt(at_frames / 0.1), CLOCK, released) == []
    assert doubts(np.full(len(TIMES), np.nan), CLOCK, released) == []


@pytest.mark.parametrize(("share", "is_doubted"), [(0.85, False), (0.7, True), (0.2, True)])
def test_leak_between_sheet_and_gauge_is_doubted(share, is_doubted):
    leaking = np.where(
        CLOCK > 120, 0.1 * np.maximum(share, 1 - (CLOCK - 120) / 50), pressure(CLOCK)
    )
    found = doubts(HEIGHTS + 1e-3, CLOCK, leaking)
    assert len(found) == is_doubted
    if is_doubted:
        assert "stays at 40 mm" in found[0] and "a leak between the sheet and the gauge" in found[0]


@pytest.mark.parametrize(("hole", "is_doubted"), [(3600.0, True), (30.0, False)])
def test_hole_of_an_hour_in_a_log_of_a_fifth_of_a_second_is_doubted(hole, is_doubted):
    late = CLOCK > 50
    times = np.where(TIMES > 45, TIMES + hole, TIMES)
    found = doubts(HEIGHTS, np.where(late, CLOCK + hole, CLOCK), pressure(CLOCK), times)
    assert len(found) == is_doubted
    assert (
        not is_doubted or "a hole of 3600 s at 50 s, where readings are otherwise 0.2 s" in found[0]
    )
    # A hole before the first frame tells nothing of the frames.
    early = np.where(CLOCK > 2, CLOCK, CLOCK - 3600.0)
    assert doubts(HEIGHTS, early, pressure(CLOCK)) == []
