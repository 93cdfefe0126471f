"""inference/correlation.py: how many neighbouring residuals vary together."""

import numpy as np
import pytest
from bubblefit.inference.correlation import correlated_count
from scipy.ndimage import gaussian_filter

GRID_SIDE, GRID_STEP = 40, 2.5
GRID = GRID_STEP * np.stack(
    np.meshgrid(np.arange(GRID_SIDE), np.arange(GRID_SIDE)), axis=-1
).reshape(-1, 2)


def smoothed_fields(width, count, seed=3):
    """Fields that are alike over a Gaussian of `width` steps: 4 pi width^2 err as one."""
    fields = np.random.default_rng(seed).standard_normal((count, GRID_SIDE, GRID_SIDE))
    if width:
        fields = np.array([gaussian_filter(field, width, mode="wrap") for field in fields])
    return [field.reshape(-1) for field in fields]


@pytest.mark.parametrize("width", [0.0, 0.7, 1.0, 1.5])
def test_correlated_count_of_smoothed_noise_is_area_of_its_kernel(width):
    fields = smoothed_fields(width, 24)
    expected = max(1.0, 4 * np.pi * width**2)
    assert correlated_count(fields, [GRID] * 24) == pytest.approx(expected, rel=0.15)


def test_correlated_count_does_not_depend_on_sizes_of_blocks():
    fields, places = smoothed_fields(1.0, 12), [GRID] * 12
    sizes = np.array([1.0, 100.0] * 6)
    scaled = [size * field for size, field in zip(sizes, fields, strict=True)]
    assert correlated_count(scaled, places) == pytest.approx(
        correlated_count(fields, places), rel=1e-12
    )


def test_alternating_or_missing_residuals_count_as_independent():
    # What changes its sign from point to point counts as independent; so does nothing at all.
    field = (-1.0) ** np.indices((GRID_SIDE, GRID_SIDE)).sum(axis=0).reshape(-1)
    assert correlated_count([field], [GRID]) == correlated_count([], []) == 1.0
    assert correlated_count([np.zeros(5), np.ones(1)], [GRID[:5], GRID[:1]]) == 1.0


def test_correlated_count_of_autoregressive_readings_along_a_curve():
    """Expect 4 = (1 + 0.6) / (1 - 0.6) that err as one, of readings that follow by 0.6."""
    random = np.random.default_rng(2)
    places = np.arange(2000.0)[:, None]
    white = random.standard_normal((6, 2000))
    follow = np.zeros_like(white)
    for k in range(1, 2000):
        follow[:, k] = 0.6 * follow[:, k - 1] + white[:, k]
    fine = places[:60]
    pieces = [piece for one in follow for piece in np.split(one[:1980], 33)]
    assert correlated_count(pieces, [fine] * len(pieces)) == pytest.approx(4.0, rel=0.15)
    for count in (10, 100):
        found = [
            correlated_count([random.standard_normal(count)], [places[:count]]) for _ in range(60)
        ]
        assert np.median(found) == 1.0 and np.mean(found) < 1.15
