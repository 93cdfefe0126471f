"""Orders and limits of manufactured sequences."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.runs.refinement import Convergence, convergence, observed_order, richardson
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


def manufactured(sizes, order: float, limit: float, constant: float) -> np.ndarray:
    return limit + constant * np.asarray(sizes, dtype=float) ** order


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    order=st.floats(0.3, 6.0),
    limit=st.floats(-50.0, 50.0),
    constant=st.sampled_from([-3.0, -0.2, 0.2, 3.0]),
    first=st.floats(1.3, 3.0),
    second=st.floats(1.3, 3.0),
)
def test_order_and_limit_of_pure_powers(
    order: float, limit: float, constant: float, first: float, second: float
) -> None:
    """Whatever the ratios of the sizes, which need not be the same twice."""
    sizes = [1.0, 1 / first, 1 / (first * second)]
    values = manufactured(sizes, order, limit, constant)
    found = observed_order(sizes, np.diff(values))
    assert found == pytest.approx(order, rel=1e-4)
    assert richardson(sizes[1:], values[1:], order) == pytest.approx(limit, abs=1e-8)


def test_the_unit_of_size_does_not_matter() -> None:
    sizes = np.array([12.75, 7.07, 3.5])
    values = manufactured(sizes, 2.0, 39.8, 1e-3)
    orders = [observed_order(scale * sizes, np.diff(values)) for scale in (1e-6, 1.0, 1e6)]
    assert orders == pytest.approx([2.0] * 3)


@pytest.mark.parametrize(
    "changes",
    [(1.0, -0.25), (-1.0, 0.25), (1.0, 1.0), (1.0, 1.2), (1.0, 0.0), (0.0, 1.0), (1.0, np.nan),
     (1.0, 2.0**-12.5)],
)  # fmt: skip
def test_changes_without_an_order(changes: tuple[float, float]) -> None:
    assert observed_order([4.0, 2.0, 1.0], changes) is None


@pytest.mark.parametrize("sizes", [[1.0, 1.0, 0.5], [1.0, 2.0, 3.0], [1.0, 0.5, 0.0], [1.0, 0.5]])
def test_sizes_must_fall(sizes: list[float]) -> None:
    with pytest.raises(ValueError, match="decreasing"):
        observed_order(sizes, [1.0, 0.25])


def test_a_sequence_that_has_settled_needs_no_remark() -> None:
    sizes = [8.0, 4.0, 2.0, 1.0]
    found = convergence(sizes, manufactured(sizes, 2.0, 40.0, 0.01).tolist())
    assert (found.order, found.previous, found.limit) == pytest.approx((2.0, 2.0, 40.0))
    assert found.remark == ""
    assert found.error(40.4) == pytest.approx(0.01)


def test_a_second_term_makes_the_order_move_and_is_said() -> None:
    h = np.array([8.0, 4.0, 2.0, 1.0])
    values = 40.0 + 0.01 * h**2 + 0.02 * h**4
    found = convergence(h.tolist(), values.tolist())
    assert found.order is not None and found.previous is not None
    assert found.previous > found.order > 2.5
    fine = 0.01 * h
    settled = convergence(fine.tolist(), (40.0 + 0.01 * fine**2 + 0.02 * fine**4).tolist())
    assert settled.order == pytest.approx(2.0, abs=0.01)
    assert settled.remark == ""
    moving = convergence(h.tolist(), (40.0 + 0.3 * h + 0.02 * h**4).tolist())
    assert "still moves" in moving.remark


@pytest.mark.parametrize(
    ("limit", "error"), [(2.0, -0.25), (-2.0, -1.75), (0.0, None), (None, None)]
)
def test_error_beside_the_limit(limit: float | None, error: float | None) -> None:
    assert Convergence(limit=limit).error(1.5) == error


@pytest.mark.parametrize(
    ("values", "noise", "found"),
    [
        # Order 1 exactly, then twice: the order one level coarser is known.
        ([8.0, 4.0, 2.0, 1.0], 0.0, Convergence(1.0, 0.0, 1.0, "")),
        # It moved by less than a half, and by more.
        ([1.0 + 2**1.4 + 2, 3.0, 2.0, 1.5], 0.0, (1.0, 1.0, 1.4, "")),
        (
            [1.0 + 2**1.6 + 2, 3.0, 2.0, 1.5], 0.0,
            (1.0, 1.0, 1.6, "the order still moves (from 1.6): the limit is a guess"),
        ),
        # What the coarser levels change is the solver's: only one order is known.
        (
            [3.0, 3.0, 2.0, 1.5], 0.0,
            (1.0, 1.0, None,
             "one order only, a level coarser there is none: one more level would tell"),
        ),
        (
            [7.0, 3.0, 2.0, 1.5], 0.08,
            (None, None, None, "the two finest levels agree to the accuracy of the solver"),
        ),
        (
            [3.0, 2.0, 1.5], 0.0,
            (1.0, 1.0, None, "one order only: one more level would tell whether it holds"),
        ),
    ],
)  # fmt: skip
def test_everything_of_a_sequence(values: list[float], noise: float, found) -> None:
    seen = convergence([2.0**-k for k in range(len(values))], values, noise)
    wanted = found if isinstance(found, Convergence) else Convergence(*found)
    for name in ("order", "limit", "previous"):
        assert getattr(seen, name) == pytest.approx(getattr(wanted, name), abs=1e-8), name
    assert seen.remark == wanted.remark


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (0.49, "changes that fall so slowly (order 0.49) show no limit: refine further"),
        (0.51, "one order only: one more level would tell whether it holds"),
    ],
)
def test_below_an_order_of_a_half_there_is_no_limit(order: float, words: str) -> None:
    """Sizes halved: it would lie further off than the coarsest of three levels does."""
    found = convergence([4.0, 2.0, 1.0], [0.0, 2**order, 2**order + 1.0])
    assert found.remark == words and (found.limit is None) == (order < 0.5)


@pytest.mark.parametrize("noise, settled", [(0.0125, True), (0.0124, False)])
def test_noise_is_a_share_of_the_largest_value(noise: float, settled: bool) -> None:
    """Of 40 here, at the coarsest level: 0.5 are changed by the last step; in any unit."""
    for unit in (1.0, 1e-3):
        values = (unit * np.array([-40.0, 1.0, 1.5])).tolist()
        found = convergence([4.0, 2.0, 1.0], values, noise * (1 + 1e-9))
        assert ("accuracy of the solver" in found.remark) == settled


def test_without_noise_only_the_same_value_has_settled() -> None:
    assert "accuracy of the solver" in convergence([4.0, 2.0, 1.0], [1.0, 2.0, 2.0]).remark


@pytest.mark.parametrize(
    "values, words",
    [
        ([1.0, 0.5], "three levels"),
        ([1.0], "three levels"),
        ([1.0, 1.0], "accuracy of the solver"),
        ([1.0, 0.5, 0.375], "one order only"),
        ([9.0, 1.0, 0.5, 0.75], "up and down"),
        ([9.0, 1.0, 0.5, 0.0], "do not get smaller"),
        ([9.0, 1.0, 0.5, 0.5 + 1e-9], "accuracy of the solver"),
        ([1.0, 1.5, 1.25, 1.125], "one order only"),
        ([3.0, 2.0, 1.0, 1.0 - 1e-6], "no power"),
        ([0.0, 1.0, 1.9], "no limit: refine further"),
    ],
)
def test_limits_of_the_extrapolation_are_said(values: list[float], words: str) -> None:
    sizes = [2.0**-k for k in range(len(values))]
    found = convergence(sizes, values, noise=1e-8)
    assert words in found.remark
    assert (found.limit is None) == (found.order is None)
    assert (found.error(1.0) is None) == (found.limit is None)
