"""readers/spheres.py: spheres through measured points."""

import numpy as np
import pytest
from bubblefit.readers.frames import Frame
from bubblefit.readers.spheres import _fit_algebraic, fit_sphere, points_of
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.refusals import complaint

CENTRE = np.array([12.0, -7.0, 610.0])


def ball_cap(radius: float = 40.0, half: float = 45.0, count: int = 400, seed: int = 0):
    draw = np.random.default_rng(seed)
    height = draw.uniform(np.cos(np.radians(half)), 1.0, count)
    turn = draw.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - height**2)
    ways = np.column_stack([across * np.cos(turn), across * np.sin(turn), -height])
    return CENTRE + radius * ways, ways, draw


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.floats(0.01, 1e4), st.floats(10, 170), st.integers(0, 10**6))
def test_perfect_sphere_is_recovered(radius, half, seed):
    points, _, _ = ball_cap(radius, half, 60, seed)
    found = fit_sphere(points)
    # Places have 16 digits of 610 mm, and a small cap magnifies them.
    rounding = 1e-13 * (1e3 + radius) / np.radians(half) ** 4 * 100
    assert found.radius == pytest.approx(radius, rel=1e-9, abs=rounding)
    np.testing.assert_allclose(found.centre, CENTRE, atol=rounding + 1e-9 * radius)
    assert found.left_out == 0 and found.rms < rounding + 1e-9 * radius
    # The first guess is exact without noise.
    centre, linear = _fit_algebraic(ball_cap(count=12)[0])
    np.testing.assert_allclose([*centre, linear], [*CENTRE, 40.0], rtol=1e-9)


def test_sphere_errors_are_scatter_of_noisy_fits():
    sigma, found = 0.05, []
    for seed in range(60):
        points, ways, draw = ball_cap(seed=seed)
        found.append(fit_sphere(points + sigma * draw.normal(size=(len(ways), 1)) * ways))
        assert found[-1].rms == pytest.approx(sigma, rel=0.2)
    errors = np.mean([[one.radius_error, *one.centre_error] for one in found], axis=0)
    scatter = np.std([[one.radius, *one.centre] for one in found], axis=0)
    # 60 repetitions know a standard deviation to 9 %.
    np.testing.assert_allclose(scatter, errors, rtol=0.3)
    assert abs(np.mean([one.radius for one in found]) - 40.0) < 4 * errors[0] / np.sqrt(60)


def test_linear_sphere_fit_is_biased_by_noise():
    """By 0.61 mm of 40 in the mean of repetitions, four of whose errors are 0.15 mm."""
    linear, least = [], []
    for seed in range(60):
        points, ways, draw = ball_cap(seed=seed)
        noisy = points + 0.5 * draw.normal(size=(len(ways), 1)) * ways
        linear.append(_fit_algebraic(noisy)[1])
        least.append(fit_sphere(noisy).radius)
    assert np.mean(linear) == pytest.approx(40 * (1 - 0.015), abs=0.15)
    assert np.mean(least) == pytest.approx(40.0, abs=0.15)


def test_outliers_of_a_sphere_are_left_out():
    points, ways, draw = ball_cap(count=1000)
    points += 0.02 * draw.normal(size=(1000, 1)) * ways
    points[:30] += 3.0 * ways[:30]
    points[30] = [0.0, 0.0, 0.0]
    found = fit_sphere(points)
    assert not found.is_used[:31].any() and found.left_out < 36
    assert found.radius == pytest.approx(40.0, abs=4 * found.radius_error)
    assert found.deviation[5] == pytest.approx(3.0, abs=0.1)
    assert "10 points or more, got 9" in complaint(fit_sphere, ball_cap(count=9)[0])
    flat = np.random.default_rng(0).normal(size=(50, 3)) * [1, 1, 0] + 5.0
    for noise in (0, 1e-2, 1e-4, 1e-7):
        nearly = flat + np.random.default_rng(1).normal(size=(50, 1)) * [0, 0, noise]
        assert "in a plane" in complaint(fit_sphere, nearly)


def test_surface_of_a_frame_is_its_displaced_points():
    points, _, _ = ball_cap(count=20)
    still, moved = np.full_like(points, np.nan), np.tile([1.0, 2.0, 3.0], (20, 1))
    np.testing.assert_array_equal(points_of(Frame(points, still)), points)
    moved[4] = np.nan
    expected = np.delete(points, 4, 0) + np.array([1, 2, 3])
    np.testing.assert_allclose(points_of(Frame(points, moved)), expected)


def test_used_points_lie_near_the_sphere_through_them():
    """Within four robust standard deviations, of noise with long tails: it takes some rounds."""
    for seed in range(1, 6):
        points, ways, draw = ball_cap(count=300, seed=seed)
        points += 0.05 * draw.standard_t(2, size=(300, 1)) * ways
        found = fit_sphere(points)
        off, arms = np.abs(found.deviation), points - found.centre
        lengths = np.linalg.norm(arms, axis=1)
        np.testing.assert_array_equal(found.is_used, off <= 4 * np.median(off) / 0.6744897501960817)
        assert 3 < found.left_out < 20
        np.testing.assert_allclose(found.deviation, lengths - found.radius)
        # Least squares: the deviations of what is kept have no mean, and no way to lean.
        left, kept = found.deviation[found.is_used], (arms / lengths[:, None])[found.is_used]
        assert left.sum() == pytest.approx(0.0, abs=1e-8)
        np.testing.assert_allclose(kept.T @ left, 0.0, atol=1e-8)
        assert found.rms == pytest.approx(np.sqrt(np.mean(left**2)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_sphere_is_that_of_most_points_where_a_third_lies_elsewhere(seed):
    points, ways, draw = ball_cap(seed=seed)
    count = len(ways) // 3
    points[:count] += [0.0, 0.0, 60.0] + 5.0 * draw.normal(size=(count, 3))
    sphere = fit_sphere(points)
    assert sphere.radius == pytest.approx(40.0, abs=1e-6) and sphere.left_out == count
