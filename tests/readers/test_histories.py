"""readers/histories.py: load histories of any machine, and their cycles."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.histories import LoadHistory, find_cycles, pace_of, passage, rest_limit_of


def test_small_cycles_are_found_and_overshoot_is_none():
    load = np.concatenate([
        np.linspace(25, 330, 30), np.linspace(330, 140, 10), np.linspace(140, 200, 10),
        np.linspace(200, 52, 30), np.linspace(52, 56, 8), np.linspace(56, 204, 30),
        np.linspace(204, 52, 30), np.linspace(52, 6680, 40), np.linspace(6680, 25, 40),
    ])  # fmt: skip
    load += np.random.default_rng(1).normal(0, 0.5, len(load))
    assert [load[c.peak] for c in find_cycles(load)] == pytest.approx([330, 204, 6680], abs=3)


def test_passage_is_interpolated_where_the_load_first_crosses_a_level():
    load, strain = np.array([0.0, 10.0, 30.0, 20.0]), np.array([0.0, 1.0, 2.0, 5.0])
    assert passage(load, strain, 15.0) == (1, 1.25)
    assert passage(load[2:], strain[2:], 25.0) == (0, 3.5)
    row, none = passage(load, strain, 30.1)
    assert row == -1 and np.isnan(none)


def test_pressures_within_the_noise_of_a_log_are_none():
    """Four standard deviations of what the log reads at rest, whatever it reads later."""
    time = np.arange(0.0, 100.0, 0.1)
    ramp = np.interp(time, [30.0, 90.0], [0.0, 0.1])
    noise = np.random.default_rng(1).normal(0.0, 2e-4, len(time))
    assert rest_limit_of(ramp + noise) == pytest.approx(8e-4, rel=0.1)
    assert rest_limit_of(ramp) < 2e-5
    # A few readings in great steps are no noise.
    assert rest_limit_of(np.array([0.0, 0.001, 0.02, 0.05, 0.1])) == 0.0


def test_pace_is_the_rate_of_loadings_and_the_longest_hold_at_a_peak():
    """Holds of 60 s and 20 s at the peaks, and of 120 s at rest, which does not count."""
    time = np.arange(0.0, 331.0)
    turns = [0, 10, 70, 80, 200, 210, 230, 240, 330]
    load = np.interp(time, turns, [0, 100, 100, 0, 0, 100, 100, 0, 0])
    history = LoadHistory(Path("a.csv"), load, 1e-4 * load, time)
    pace = pace_of([history, LoadHistory(Path("b.csv"), load, 1e-4 * load)])
    assert pace.rate == pytest.approx(1e-3)
    assert pace.hold == pytest.approx(60.0, abs=2.0)
    assert np.isnan(pace_of([]).hold)
