"""Orders of convergence and limits of sequences of refinements."""

from itertools import product

import numpy as np
import pytest
from bubblefit.runs.convergence import convergence, observed_order, richardson
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    order=st.floats(0.3, 6.0), limit=st.floats(-50.0, 50.0),
    constant=st.sampled_from([-3.0, -0.2, 0.2, 3.0]), first=st.floats(1.3, 3.0),
    second=st.floats(1.3, 3.0),
)  # fmt: skip
def test_order_and_limit_of_pure_powers(order, limit, constant, first, second):
    sizes = np.array([1.0, 1 / first, 1 / (first * second)])
    values = limit + constant * sizes**order
    found = richardson(sizes[1:], values[1:], order)
    assert found == pytest.approx(limit, abs=1e-8)
    for unit in (1.0, 1e-6, 1e6):
        assert observed_order(unit * sizes, np.diff(values)) == pytest.approx(order, rel=1e-4)


def test_alternating_growing_or_vanishing_changes_have_no_order():
    every = [(1.0, -0.25), (-1.0, 0.25), (1.0, 1.0), (1.0, 1.2), (1.0, 0.0), (0.0, 1.0)]
    for changes in (*every, (1.0, np.nan), (1.0, 2.0**-12.5)):
        assert observed_order([4.0, 2.0, 1.0], changes) is None, changes


def test_second_term_moves_order_and_is_noted():
    h = np.array([8.0, 4.0, 2.0, 1.0])
    found = convergence(h, 40.0 + 0.01 * h**2 + 0.02 * h**4)
    assert found.previous > found.order > 2.5
    moving = convergence(h, 40.0 + 0.3 * h + 0.02 * h**4)
    assert "still moves" in moving.remark
    fine = 0.01 * h
    settled = convergence(fine, 40.0 + 0.01 * fine**2 + 0.02 * fine**4)
    assert settled.order == pytest.approx(2.0, abs=0.01) and settled.remark == ""


def test_noise_is_a_share_of_the_largest_value():
    """Of 40 here, at the coarsest level: 0.5 are changed by the last step; in any unit."""
    for noise, unit in product((0.0125, 0.0124), (1.0, 1e-3)):
        values = unit * np.array([-40.0, 1.0, 1.5])
        found = convergence([4.0, 2.0, 1.0], values, noise * (1 + 1e-9))
        assert ("accuracy of the solver" in found.remark) == (noise == 0.0125)


@pytest.mark.parametrize(
    "values, noise, words",
    [
        ([1.0, 0.5], 1e-8, "three levels"), ([1.0], 1e-8, "three levels"),
        ([1.0, 1.0], 1e-8, "accuracy of the solver"), ([1.0, 0.5, 0.375], 1e-8, "one order only"),
        ([9.0, 1.0, 0.5, 0.75], 1e-8, "up and down"),
        ([9.0, 1.0, 0.5, 0.0], 1e-8, "do not get smaller"),
        ([9.0, 1.0, 0.5, 0.5 + 1e-9], 1e-8, "accuracy of the solver"),
        ([1.0, 1.5, 1.25, 1.125], 1e-8, "one order only"),
        ([3.0, 2.0, 1.0, 1.0 - 1e-6], 1e-8, "no power"),
        ([0.0, 1.0, 1.9], 1e-8, "no limit: refine further"),
        ([1.0, 2.0, 2.0], 0.0, "accuracy of the solver"),
        ([0.0, 2**0.51, 2**0.51 + 1.0], 0.0, "one order only"),
    ],
)  # fmt: skip
def test_limits_of_extrapolation_are_noted(values, noise, words):
    found = convergence([2.0**-k for k in range(len(values))], values, noise)
    assert words in found.remark
    assert (found.limit is None) == (found.order is None)
