"""Draws from a normal distribution within inequalities, beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference import posterior as truncated
from bubblefit.inference.posterior import truncated_draws
from scipy.stats import halfnorm, kstest, norm, truncnorm, uniform

COUNT = 4000
COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])
NOTHING = (np.zeros((0, 2)), np.zeros(0))


def draws(mean: object, inequalities: tuple[object, object], allowed: object) -> np.ndarray:
    a, c = (np.asarray(v, dtype=float) for v in inequalities)
    drawn = truncated_draws(
        np.asarray(mean, dtype=float), COVARIANCE, (a, c), np.asarray(allowed, dtype=float),
        COUNT, np.random.default_rng(5),
    )  # fmt: skip
    assert drawn.shape == (COUNT, 2)
    assert (drawn @ a.T >= c - 1e-7).all()
    return drawn


def test_without_bounds_it_is_the_normal_distribution() -> None:
    drawn = draws([1.0, -2.0], NOTHING, [1.0, -2.0])
    assert drawn.mean(axis=0) == pytest.approx([1.0, -2.0], abs=0.12)
    assert np.cov(drawn.T) == pytest.approx(COVARIANCE, rel=0.1)


@pytest.mark.parametrize("walks", [False, True])
def test_on_a_bound_it_is_half_of_it(walks: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawn again, or walked to: the same distribution."""
    if walks:
        monkeypatch.setattr(truncated, "MOST_DRAWS", 1)
    drawn = draws([0.0, 0.0], ([[1.0, 0.0]], [0.0]), [0.0, 0.0])
    assert kstest(drawn[:, 0], halfnorm(scale=2.0).cdf).pvalue > 0.01
    # The other follows:  y1 | y0  is normal about 1.5 / 4 y0 with 1 - 1.5^2 / 4.
    rest = drawn[:, 1] - 0.375 * drawn[:, 0]
    assert kstest(rest, norm(scale=np.sqrt(1 - 1.5**2 / 4)).cdf).pvalue > 0.01


def test_a_mean_far_outside() -> None:
    """Five standard deviations: nothing drawn again would do, and it lies near the bound."""
    drawn = draws([-10.0, 0.0], ([[1.0, 0.0], [-1.0, 0.0]], [0.0, -6.0]), [0.0, 0.0])
    cut = truncnorm(5.0, 8.0, loc=-10.0, scale=2.0)
    assert kstest(drawn[:, 0], cut.cdf).pvalue > 0.01
    assert drawn[:, 0].mean() < 0.5


def test_in_a_corner() -> None:
    """Of independent unknowns each is cut off for itself."""
    identity, random = np.eye(3), np.random.default_rng(1)
    mean, c = np.array([-3.0, 0.0, 4.0]), np.zeros(3)
    drawn = truncated_draws(mean, identity, (identity, c), c, COUNT, random)
    for k, middle in enumerate(mean):
        assert kstest(drawn[:, k], truncnorm(-middle, np.inf, loc=middle).cdf).pvalue > 0.01


def test_what_has_no_room_stays() -> None:
    """Equal bounds hold an unknown; the other is what it is beside that one."""
    drawn = draws([3.0, 0.0], ([[1.0, 0.0], [-1.0, 0.0]], [1.0, -1.0]), [1.0, 0.0])
    assert drawn[:, 0] == pytest.approx(np.ones(COUNT), abs=1e-9)
    given = norm(0.375 * (1.0 - 3.0), np.sqrt(1 - 1.5**2 / 4))
    assert kstest(drawn[:, 1], given.cdf).pvalue > 0.01


def test_nothing_varies() -> None:
    drawn = truncated_draws(
        np.ones(2), np.zeros((2, 2)), NOTHING, np.ones(2), 3, np.random.default_rng(0)
    )
    assert (drawn == 1.0).all()


def test_a_direction_without_variance_stays() -> None:
    flat = np.diag([1.0, 0.0])
    drawn = truncated_draws(
        np.zeros(2), flat, (np.eye(2), np.zeros(2)), np.zeros(2), 100, np.random.default_rng(0)
    )
    assert (drawn[:, 0] >= 0).all() and drawn[:, 0].std() > 0.4 and not drawn[:, 1].any()


def test_between_bounds_that_are_close_to_each_other() -> None:
    """A slab of a thousandth of a standard deviation, askew: along it everything is drawn."""
    across, along = np.array([[0.6, 0.8, 0.0], [0.8, -0.6, 0.0]])
    inequalities = np.array([across, -across]), np.array([2.0, -2.001])
    drawn = truncated_draws(
        np.zeros(3), np.eye(3), inequalities, 2.0 * across, COUNT, np.random.default_rng(2)
    )
    assert kstest(drawn @ along, norm.cdf).pvalue > 0.01
    assert kstest(drawn[:, 2], norm.cdf).pvalue > 0.01
    assert kstest(drawn @ across, uniform(2.0, 0.001).cdf).pvalue > 0.01


@pytest.mark.parametrize("width", [1e-6, 1e-8, 3e-9])
def test_oblique_bounds_that_nearly_meet(width: float) -> None:
    """Between x + y = 0 and a width more: rounding of so sharp a curvature is larger than one."""
    rows = np.array([[1.0, 1.0, 0.3], [-1.0, -1.0, -0.3], [0.2, -0.7, 1.0]])
    least = np.array([0.0, -width, -50.0])
    start = np.array([width / 2, 0.0, 0.0])
    drawn = truncated_draws(
        np.zeros(3), np.eye(3), (rows, least), start, COUNT, np.random.default_rng(4)
    )
    across = drawn @ rows[0]
    assert across.min() >= -1e-9 and across.max() <= width + 1e-9
    along = drawn @ np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    assert along.std() == pytest.approx(1.0, abs=0.05)
