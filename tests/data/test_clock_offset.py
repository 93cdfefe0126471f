"""Two clocks of known difference: found as closely as it is said, or refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bubblefit.readers.pressure_log import (
    _rest_height,
    find_offset,
    given_offset,
    log_at,
    offset_misfits,
)

from ..complaints import complaint

#: The log's clock, s, of a test that begins at 0; its pressures, MPa.
CLOCK = np.arange(-60.0, 320.0, 0.2)


def steps(t):
    """A manual valve: raised by 30 kPa within 3 s, held to 25 s, nine times."""
    return np.where(t > 0, 0.03 * np.clip(np.floor(t / 25) + np.clip(t % 25 / 3, 0, 1), 0, 9), 0.0)


def ramp(t):
    return 0.3 * np.clip(t / 180, 0.0, 1.0)


def cycles(t):
    return np.where(t > 0, 0.15 * (1 - np.cos(2 * np.pi * t / 60)), 0.0)


#: Sheets: a membrane that was flat, one that was taut, one of neither.
HEIGHTS = {
    "flat": lambda p: 60 * (p / 0.3) ** (1 / 3),
    "taut": lambda p: 60 * p / 0.3,
    "between": lambda p: 45 * np.log1p(10 * p / 0.3) / np.log(11) + 15 * p / 0.3,
}


def recorded(history, law, offset, noise, seed=0, count=150, start=-10.0):
    """Times and heights of a frame a second, and the log, whose clock is `offset` ahead."""
    draw = np.random.default_rng(seed)
    times = np.arange(count) + start
    heights = np.abs(HEIGHTS[law](history(times)) + 60 * noise * draw.normal(size=count))
    pressures = history(CLOCK) + 0.3 * noise * draw.normal(size=len(CLOCK))
    return times, heights, CLOCK + offset, pressures


@pytest.mark.parametrize(
    ("history", "law", "offset"),
    [
        (steps, "flat", 37.3),
        (steps, "taut", -9876.5),
        (steps, "between", 1.7e9 + 0.25),
        (ramp, "flat", 0.0),
        (ramp, "taut", 12.34),
        (cycles, "between", 60.0),
    ],
)
def test_a_known_offset_is_found_within_what_is_said(history, law, offset, seed=3):
    """Of whatever law: nothing is supposed but that the sheet rises with the pressure."""
    data = recorded(history, law, offset, 5e-4, seed)
    found = find_offset(*data)
    assert found.lower <= offset <= found.upper
    assert found.upper - found.lower < 5.0 and abs(found.offset - offset) < 1.5
    assert 0 < found.misfit < 1e-3
    true = history(data[0])
    within = np.abs(found.pressure - true) <= found.doubt + 5 * 0.3 * 5e-4
    assert within.all() and np.mean(found.doubt) < 0.004


def test_steps_are_sharper_than_a_frame_between_two_pictures():
    found = find_offset(*recorded(steps, "flat", 37.3, 5e-4))
    assert found.offset == pytest.approx(37.3, abs=0.2)
    assert found.upper - found.lower < 1.0
    # On the holds the offset does not matter; between them it does.
    assert np.median(found.doubt) < 2e-4 < 5e-4 < found.doubt.max()


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_the_doubt_is_what_the_offsets_leave_open(noise):
    """On a steady rise of 1.67 kPa/s: half of the range of the offsets times that."""
    found = find_offset(*recorded(ramp, "flat", 37.3, noise))
    assert found.lower <= 37.3 <= found.upper
    assert found.offset == pytest.approx((found.lower + found.upper) / 2)
    middle = found.doubt[60:100]
    assert np.mean(middle) == pytest.approx(0.3 / 180 * (found.upper - found.lower) / 2, rel=0.15)


def test_frames_in_no_order_and_frames_without_a_height():
    times, heights, *log = recorded(steps, "flat", 37.3, 5e-4)
    order = np.random.default_rng(1).permutation(len(times))
    heights[[20, 21, 90]] = np.nan
    found = find_offset(times[order], heights[order], *log)
    assert found.offset == pytest.approx(37.3, abs=0.2)
    np.testing.assert_allclose(found.pressure, steps(times[order]), atol=0.012)
    assert np.isfinite(found.pressure[np.isnan(heights[order])]).all()


def test_frames_beyond_the_log_have_no_pressure():
    times, heights, clock, pressures = recorded(steps, "flat", 37.3, 5e-4, count=250)
    kept = clock < 37.3 + 220
    found = find_offset(times, heights, clock[kept], pressures[kept])
    assert found.offset == pytest.approx(37.3, abs=0.3)
    lost = np.isnan(found.pressure)
    assert lost.any() and (times[lost] > 219).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # A steady rise that neither begins nor ends in the film.
        (dict(history=lambda t: 0.3 * (t + 60) / 380, law="taut", start=10.0), ["do as well"]),
        # Every hold alike, and the film between two of them: a step later does as well.
        (dict(history=steps, law="taut", start=40.0, count=100), ["do as well", "kPa on average"]),
        (dict(history=ramp, law="flat", count=5), ["5 frames are too few"]),
        (dict(history=ramp, law="flat", count=900), ["the log lasts 379.8 s, the frames 899 s"]),
    ],
)
def test_what_cannot_be_told_is_refused(change, words):
    said = complaint(find_offset, *recorded(offset=12.0, noise=5e-4, **change))
    assert all(word in said for word in ["offset" if "log" not in words[0] else "", *words]), said


def test_no_offset_is_looked_at_for_which_there_is_no_log():
    """Also where the best is the last that there is: closer together, not beyond."""
    times, heights, clock, pressures = recorded(steps, "flat", 37.3, 5e-4, count=100)
    clock, pressures = clock[:646], pressures[:646]
    offsets, misfits = offset_misfits(times, heights, clock, pressures)
    assert len(offsets) == len(misfits) > 100 and (np.diff(offsets) >= 0).all()
    best = offsets[np.argmin(misfits)]
    assert offsets[-1] - best < 1.0
    ends = [np.isfinite(log_at(s, times, clock, pressures)).mean() for s in offsets]
    assert min(ends) >= 0.8 - 1e-9


def test_up_to_where_a_frame_is_at_rest():
    """Six standard deviations above the lowest, by second differences; a fiftieth of the most."""
    assert _rest_height(np.linspace(3.0, 60.0, 20)) == pytest.approx(1.2)
    assert _rest_height(np.linspace(0.0, 60.0, 20)) == pytest.approx(0.0, abs=1e-9)
    rough = np.arange(20.0) % 2  # second differences of 2, which noise of 1.21 makes
    assert _rest_height(np.append(rough, 900.0)) == pytest.approx(6 * 2 / 0.6745 / np.sqrt(6))
    assert _rest_height(np.append(rough, 90.0)) == pytest.approx(1.8)


def test_offsets_that_do_as_well_are_told_from_the_least_to_the_largest():
    """A steady rise over the whole log and film: any offset within it does."""
    times, log = np.arange(20.0), np.arange(0.0, 60.0, 0.5)
    said = complaint(find_offset, times, times + 5.0, log, 0.3 * log / 60)
    assert said.startswith("offset: cannot be found: offsets from ")
    numbers = [float(n) for n in re.findall(r"-?\d+\.\d\d", said)[:2]]
    assert numbers[0] < 0 < 30 < numbers[1]
    assert said.endswith(
        "kPa on average; give it in s. Where the pressure was held, released or began to rise "
        "while frames were taken, it can be found"
    )


def test_heights_of_another_test_are_refused():
    times, heights, *log = recorded(steps, "flat", 12.0, 5e-4)
    said = complaint(find_offset, times, np.roll(heights[::-1], 31), *log)
    assert "at no offset does the sheet rise with the pressure" in said


def test_an_offset_that_is_given_is_taken():
    times, heights, *log = recorded(ramp, "flat", 12.0, 0.0)
    found = given_offset(12.0, times, heights, *log)
    np.testing.assert_allclose(found.pressure, ramp(times), atol=1e-12)
    assert found.misfit is None and found.lower == found.upper == 12.0 and not found.doubt.any()
    said = complaint(given_offset, 1e5, times, heights, *log)
    assert "no frame lies within the log" in said and "from -48.00 to 331.80 s" in said
