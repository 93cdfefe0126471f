"""readers/clock_offset.py: the offset between the clocks of camera and log."""

import numpy as np
import pytest
from bubblefit.readers.clock_offset import find_offset, given_offset

from ..support.refusals import complaint

#: The log's clock, s, of a test that begins at 0; its pressures, MPa.
CLOCK = np.arange(-60.0, 320.0, 0.2)


def stepped_pressure(t):
    """A manual valve: raised by 30 kPa within 3 s, held to 25 s, nine times."""
    return np.where(t > 0, 0.03 * np.clip(np.floor(t / 25) + np.clip(t % 25 / 3, 0, 1), 0, 9), 0.0)


def rising_pressure(t):
    return 0.3 * np.clip(t / 180, 0.0, 1.0)


def cycled_pressure(t):
    return np.where(t > 0, 0.15 * (1 - np.cos(2 * np.pi * t / 60)), 0.0)


#: Sheets: a membrane that was flat, one that was taut, one of neither.
HEIGHTS = {
    "flat": lambda p: 60 * (p / 0.3) ** (1 / 3),
    "taut": lambda p: 60 * p / 0.3,
    "between": lambda p: 45 * np.log1p(10 * p / 0.3) / np.log(11) + 15 * p / 0.3,
}


def recorded_heights(history, law, offset, noise, seed=0, count=150, start=-10.0):
    draw = np.random.default_rng(seed)
    times = np.arange(count) + start
    heights = np.abs(HEIGHTS[law](history(times)) + 60 * noise * draw.normal(size=count))
    pressures = history(CLOCK) + 0.3 * noise * draw.normal(size=len(CLOCK))
    return times, heights, CLOCK + offset, pressures


@pytest.mark.parametrize(
    ("history", "law", "offset"),
    [
        (stepped_pressure, "flat", 37.3),
        (stepped_pressure, "taut", -9876.5),
        (stepped_pressure, "between", 1.7e9 + 0.25),
        (rising_pressure, "flat", 0.0),
        (rising_pressure, "taut", 12.34),
        (cycled_pressure, "between", 60.0),
    ],
)
def test_known_clock_offset_is_found_within_its_error(history, law, offset):
    """Of whatever law: nothing is supposed but that the sheet rises with the pressure."""
    data = recorded_heights(history, law, offset, 5e-4, 3)
    found = find_offset(*data)
    assert found.lower <= offset <= found.upper
    assert found.upper - found.lower < 5.0 and abs(found.offset - offset) < 1.5
    assert 0 < found.misfit < 1e-3
    error = np.abs(found.pressure - history(data[0]))
    within = error <= found.pressure_uncertainty + 5 * 0.3 * 5e-4
    assert within.all() and np.mean(found.pressure_uncertainty) < 0.004


def test_steps_determine_the_offset_better_than_a_frame():
    times, heights, clock, pressures = recorded_heights(stepped_pressure, "flat", 37.3, 5e-4)
    found = find_offset(times, heights, clock, pressures)
    assert found.offset == pytest.approx(37.3, abs=0.2) and found.upper - found.lower < 1.0
    # On the holds the offset does not matter; between them it does.
    assert np.median(found.pressure_uncertainty) < 2e-4 < 5e-4 < found.pressure_uncertainty.max()
    # Frames in no order, and frames without a height.
    order = np.random.default_rng(1).permutation(len(times))
    heights[[20, 21, 90]] = np.nan
    found = find_offset(times[order], heights[order], clock, pressures)
    assert found.offset == pytest.approx(37.3, abs=0.2)
    np.testing.assert_allclose(found.pressure, stepped_pressure(times[order]), atol=0.012)
    assert np.isfinite(found.pressure[np.isnan(heights[order])]).all()
    # Frames beyond the log have no pressure.
    times, heights, clock, pressures = recorded_heights(
        stepped_pressure, "flat", 37.3, 5e-4, count=250
    )
    kept = clock < 37.3 + 220
    found = find_offset(times, heights, clock[kept], pressures[kept])
    assert found.offset == pytest.approx(37.3, abs=0.3)
    lost = np.isnan(found.pressure)
    assert lost.any() and (times[lost] > 219).all()


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_pressure_error_is_half_the_range_of_possible_offsets(noise):
    """On a steady rise of 1.67 kPa/s: half of the range of the offsets times that."""
    found = find_offset(*recorded_heights(rising_pressure, "flat", 37.3, noise))
    assert found.lower <= 37.3 <= found.upper
    assert found.offset == pytest.approx((found.lower + found.upper) / 2)
    middle = found.pressure_uncertainty[60:100]
    assert np.mean(middle) == pytest.approx(0.3 / 180 * (found.upper - found.lower) / 2, rel=0.15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # A steady rise that neither begins nor ends in the film.
        (dict(history=lambda t: 0.3 * (t + 60) / 380, law="taut", start=10.0), "do as well"),
        # Every hold alike, and the film between two of them: a step later does as well.
        (dict(history=stepped_pressure, law="taut", start=40.0, count=100), "kPa on average"),
        (dict(history=rising_pressure, law="flat", count=5), "5 frames are too few"),
        (
            dict(history=rising_pressure, law="flat", count=900),
            "the log lasts 379.8 s, the frames 899 s",
        ),
    ],
)
def test_undetermined_clock_offset_is_refused(change, words):
    assert words in complaint(find_offset, *recorded_heights(offset=12.0, noise=5e-4, **change))


def test_offset_at_which_no_frame_lies_within_the_log_is_refused():
    times, log_times = np.arange(5.0), np.linspace(10.0, 20.0, 6)
    message = complaint(given_offset, 30.0, times, times, log_times, np.zeros(6))
    assert "frames from 30.00 to 34.00 s by its clock, the log from 10.00 to 20.00 s" in message
