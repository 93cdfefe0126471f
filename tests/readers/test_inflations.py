"""readers/inflations.py: inflations and releases in time, and frames chosen by pressure."""

import numpy as np
import pytest
from bubblefit.readers.inflations import AT_NO_PRESSURE as AT_REST
from bubblefit.readers.inflations import (
    BEYOND_LOG,
    OTHER_INFLATION,
    RELEASED,
    REPEATED,
    Inflations,
    branches_of,
    choose_frames,
    has_several,
)
from hypothesis import given
from hypothesis import strategies as st

from ..support.refusals import complaint, complaint_with


def test_inflations_are_found_in_the_order_of_time():
    seen = np.array([np.nan, 0, 10, 20, 19, 30, 30, 12, 5, 0, 11, 21, 33, np.nan])
    found = [branch.tolist() for branch in branches_of(seen)]
    assert found == [[1, 2, 3, 4, 5], [6, 7, 8, 9], [10, 11, 12]]
    assert has_several(seen) and not has_several(seen[[2, 5, 3, 7, 11, 10]])
    assert choose_frames(seen, inflation=1)[0] == (2, 4, 3, 5)
    assert choose_frames(seen, inflation=1)[1][RELEASED] == 3
    second = choose_frames(seen, inflation=2)
    assert second[0] == (10, 11, 12) and second[1][OTHER_INFLATION] == 7
    # The peak that is held counts once.
    assert choose_frames(seen, inflation="all")[0] == (2, 4, 3, 5, 7, 8, 10, 11, 12)
    assert choose_frames(seen, count=2, inflation="all")[0] == (4, 5, 7, 8, 11, 12)
    assert [branch.tolist() for branch in branches_of(seen[8:5:-1])] == [[0, 1, 2]]


@pytest.mark.parametrize("branches", [1, 2, 5, 6])
def test_line_counts_inflations_with_or_without_their_last_release(branches):
    peaks = np.resize([0.0, 0.03], branches + 1)
    rows = np.linspace(0.0, branches, 4 * branches + 1)
    pressure = np.interp(rows, np.arange(branches + 1), peaks)
    count = (branches + 1) // 2
    all_taken = Inflations(pressure, 100 * pressure, "all")
    assert all_taken.line == f"all frames of {count} inflations are taken, in their order"
    first = Inflations(pressure, 100 * pressure, 1)
    assert first.line.startswith(f"inflation 1 of {count}, the first loading, is taken; ")


def test_height_of_later_inflations_is_told_at_a_few_pressures():
    """Take every other of seven pressures; the apex rises to twice and thrice the first height."""
    rising = np.linspace(0.01, 0.07, 7)
    pressure = np.concatenate([[*rising, *rising[-2::-1], 0.0]] * 3)
    height = np.repeat([1.0, 2.0, 3.0], 14) * 100.0 * pressure
    lines = Inflations(pressure, height, "all").lines
    told = [(number, kilopascals) for number in (2, 3) for kilopascals in (10, 30, 50, 70)]
    assert lines == [
        f"inflation {number} at {kilopascals} kPa: apex {number * kilopascals / 10:.4g} mm, "
        f"{kilopascals / 10:.4g} mm in the first: {(number - 1) * kilopascals / 10:+.2g} mm, "
        f"{100 * (number - 1):+.2g} %"
        for number, kilopascals in told
    ]


def test_frame_near_enough_to_a_pressure_is_chosen():
    seen = np.array([0.010, 0.020, 0.050])
    assert choose_frames(seen, [0.011, 0.05])[0] == (0, 2)
    assert choose_frames(seen, [0.013, 0.047], tolerance=0.003)[0] == (0, 2)
    for asked, tolerance, words in (
        ([0.01101, 0.05], None, "pressures[0]: no frame within 1 kPa of 11.01 kPa"),
        ([0.013], 0.00299, "pressures[0]: no frame within 2.99 kPa of 13 kPa"),
        ([0.0096, 0.0104], 0.001, "pressures[1]: the frame at 10 kPa is the nearest to 9.6 and"),
    ):
        assert complaint(choose_frames, seen, asked, None, tolerance).startswith(words)


def test_pressures_a_millionth_apart_are_one_frame():
    # A millionth of the largest apart is one; more is two.
    assert choose_frames(np.array([0.1, 0.1 - 0.9e-7, 0.05])) == ((2, 1), {REPEATED: 1})
    assert choose_frames(np.array([0.1, 0.1 - 1.1e-7, 0.05]))[0] == (2, 1, 0)


def test_frames_up_to_the_noise_of_a_log_are_at_rest():
    seen = np.array([0.0004, -0.0002, 0.0006, 0.01, 0.02])
    assert choose_frames(seen, rest_limit=0.0006) == ((3, 4), {AT_REST: 3})
    assert choose_frames(seen)[1] == {AT_REST: 1}


def test_number_of_frames_is_spread_over_the_pressures():
    seen = np.array([0.010, 0.011, 0.012, 0.060])
    assert choose_frames(seen, count=4)[0] == (0, 1, 2, 3)
    assert choose_frames(seen, count=3)[0] == (1, 2, 3)
    assert choose_frames(seen, count=1)[0] == (3,)
    assert "frames: expected at most the 4 frames at" in complaint(choose_frames, seen, None, 5)


#: MPa, as a camera saw a test: rest, rise, hold, release, end of the log.
SEEN_PRESSURES = np.array(
    [np.nan, 0.0, -0.001, 0.010, 0.020, 0.031, 0.031, 0.052, 0.040, 0.012, np.nan]
)


def test_frames_of_the_rise_are_chosen_by_pressure():
    chosen = choose_frames(SEEN_PRESSURES, [0.012, 0.0305, 0.05], tolerance=0.003, inflation=1)
    assert chosen[0] == (3, 5, 7)
    assert chosen[1] == {BEYOND_LOG: 2, AT_REST: 2, RELEASED: 2}
    # Not in the order of time, the release cannot be told from the rise.
    assert choose_frames(SEEN_PRESSURES, [0.012], tolerance=0.003)[0] == (9,)
    chosen = choose_frames(SEEN_PRESSURES)
    assert chosen[0] == (3, 9, 4, 5, 8, 7)
    assert chosen[1] == {BEYOND_LOG: 2, AT_REST: 2, REPEATED: 1}
    assert choose_frames(SEEN_PRESSURES, inflation=1)[0] == (3, 4, 5, 7)
    # 2 % of the largest asked for is 1.04 kPa.
    for asked, words in (
        ([0.0305, 0.0420, 0.052], ["pressures[1]", "within 1.04 kPa of 42 kPa", "at 40 kPa"]),
        ([0.0195, 0.0205, 0.052], ["pressures[1]", "frame at 20 kPa", "19.5 and to 20.5 kPa"]),
    ):
        complaint_with(words, choose_frames, SEEN_PRESSURES, asked)
    assert "the 6 frames" in complaint(choose_frames, SEEN_PRESSURES, None, 7)
    assert "none of the 3 frames is under pressure" in complaint(choose_frames, SEEN_PRESSURES[:3])


@given(
    pressures=st.lists(st.floats(1e-3, 1.0), min_size=1, max_size=40, unique=True), data=st.data()
)
def test_chosen_frames_are_as_many_as_requested_and_rising(pressures, data):
    each = np.array(pressures)
    count = data.draw(st.integers(1, len(choose_frames(each)[0])))
    taken = each[list(choose_frames(each, count=count)[0])]
    assert len(taken) == count and (np.diff(taken) > 0).all()
    assert taken[-1] == pytest.approx(each.max())


def test_release_without_loaded_frames_asks_for_none():
    seen = np.array([0.0, 0.01, 0.02, 0.03, 0.0])
    assert choose_frames(seen, [0.01, 0.02, 0.03], inflation="all")[0] == (1, 2, 3)
