"""Which frames are taken by their pressures, and which are not looked at."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.readers.pressure_log import (
    AT_REST_FRAME_CHOICE as AT_REST,
)
from bubblefit.readers.pressure_log import (
    BEYOND,
    RELEASED,
    REPEATED,
    choose_frames,
)
from hypothesis import given
from hypothesis import strategies as st

from ..complaints import complaint, complaint_with

#: MPa, as a camera saw a test: rest, rise, hold, release, end of the log.
SEEN = np.array([np.nan, 0.0, -0.001, 0.010, 0.020, 0.031, 0.031, 0.052, 0.040, 0.012, np.nan])


def test_the_nearest_frame_of_the_rise():
    chosen = choose_frames(SEEN, [0.012, 0.0305, 0.05], tolerance=0.003, in_time=True)
    assert chosen.frames == (3, 5, 7)
    assert chosen.left_out == {BEYOND: 2, AT_REST: 2, RELEASED: 2}
    # Not in the order of time, the release cannot be told from the rise.
    assert choose_frames(SEEN, [0.012], tolerance=0.003).frames == (9,)


def test_all_frames_by_rising_pressure():
    chosen = choose_frames(SEEN)
    assert chosen.frames == (3, 9, 4, 5, 8, 7)
    assert chosen.left_out == {BEYOND: 2, AT_REST: 2, REPEATED: 1}
    assert choose_frames(SEEN, in_time=True).frames == (3, 4, 5, 7)


def test_some_frames_evenly_spread_in_pressure():
    pressures = np.arange(0.001, 0.301, 0.001)
    chosen = choose_frames(pressures, count=4)
    assert pressures[list(chosen.frames)] == pytest.approx([0.075, 0.15, 0.225, 0.3])


@given(
    pressures=st.lists(st.floats(1e-3, 1.0), min_size=1, max_size=40, unique=True),
    data=st.data(),
)
def test_as_many_as_asked_for_and_rising(pressures, data):
    each = np.array(pressures)
    able = choose_frames(each).frames
    count = data.draw(st.integers(1, len(able)))
    taken = each[list(choose_frames(each, count=count).frames)]
    assert (
        len(taken) == count
        and (np.diff(taken) > 0).all()
        and taken[-1] == pytest.approx(each.max())
    )


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        # 2 % of the largest asked for is 1.04 kPa.
        ([0.0305, 0.0420, 0.052], ["pressures[1]", "within 1.04 kPa of 42 kPa", "at 40 kPa"]),
        ([0.0195, 0.0205, 0.052], ["pressures[1]", "frame at 20 kPa", "19.5 and to 20.5 kPa"]),
    ],
)
def test_pressures_without_a_frame_of_their_own(asked, words):
    complaint_with(words, choose_frames, SEEN, asked)


def test_too_few_frames():
    assert "the 6 frames at pressures of their own, got 7" in complaint(
        choose_frames, SEEN, None, 7
    )
    assert "none of the 3 frames is under pressure" in complaint(choose_frames, SEEN[:3])
