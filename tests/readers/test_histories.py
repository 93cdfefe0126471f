"""readers/histories.py: load histories of any machine, and their cycles."""

import numpy as np
import pytest
from bubblefit.readers.histories import find_cycles


def test_small_cycles_are_found_and_overshoot_is_none():
    load = np.concatenate([
        np.linspace(25, 330, 30), np.linspace(330, 140, 10), np.linspace(140, 200, 10),
        np.linspace(200, 52, 30), np.linspace(52, 56, 8), np.linspace(56, 204, 30),
        np.linspace(204, 52, 30), np.linspace(52, 6680, 40), np.linspace(6680, 25, 40),
    ])  # fmt: skip
    load += np.random.default_rng(1).normal(0, 0.5, len(load))
    assert [load[c.peak] for c in find_cycles(load)] == pytest.approx([330, 204, 6680], abs=3)
