"""The apex of a dome whose shape is known: curvature, force, strain, and how far noise moves it."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.equilibrium import apex_of, apex_shape
from bubblefit.readers.fields import DisplacementField

from ..complaints import complaint

RADIUS, PRESSURE = 80.0, 0.05
#: 1/mm, of the paraboloid along x and y; mm, its top; stretch of the sheet along x and y.
CURVED, TOP, STRETCH = (0.004, 0.006), 12.0, (1.02, 1.05)


def dome(
    noise: float = 0.0, seed: int = 0, count: int = 400, stretch: tuple[float, float] = STRETCH
) -> DisplacementField:
    draw = np.random.default_rng(seed)
    places = RADIUS * draw.uniform(-0.35, 0.35, (count, 2))
    after = places * stretch
    height = TOP - 0.5 * after**2 @ CURVED + noise * draw.standard_normal(count)
    moved = np.column_stack([after - places, height - 3.0])
    return DisplacementField(PRESSURE, places, moved, z=np.full(count, 3.0))


def test_the_apex_of_a_paraboloid() -> None:
    found = apex_of(dome(), RADIUS)
    assert (found.pressure, found.height) == (PRESSURE, pytest.approx(TOP - 3.0))
    assert found.curvature == pytest.approx(sum(CURVED))
    assert found.force == pytest.approx(PRESSURE / sum(CURVED))  # 5 N/mm
    assert found.strain == pytest.approx(np.log(STRETCH))
    assert found.stiffness == pytest.approx(5.0 / np.mean(np.log(STRETCH)))
    assert found.error == pytest.approx(0.0, abs=1e-9)


def test_a_hollow_and_a_sheet_at_rest_have_no_force() -> None:
    good = dome()
    hollow = DisplacementField(PRESSURE, good.points, good.displacement * [1, 1, -1], z=None)
    found = apex_of(hollow, RADIUS)
    assert found.curvature == pytest.approx(-sum(CURVED))
    assert found.force == found.error == np.inf
    still = apex_of(DisplacementField(PRESSURE, good.points, good.displacement * [0, 0, 1]), RADIUS)
    assert still.strain == pytest.approx((0.0, 0.0), abs=1e-12)
    squeezed = DisplacementField(PRESSURE, good.points, good.displacement * [-1, -1, 1])
    assert apex_of(squeezed, RADIUS).stiffness == np.inf


def test_the_standard_error_is_that_of_repetitions() -> None:
    """Of a sheet that is hardly stretched: what the stretch takes from it is not reckoned."""
    found = [apex_of(dome(0.02, seed, stretch=(1.0, 1.001)), RADIUS) for seed in range(200)]
    scatter = np.std([apex.force for apex in found])
    # 200 repetitions know a standard deviation to 5 %.
    assert np.mean([apex.error for apex in found]) == pytest.approx(scatter, rel=0.15)


def test_points_about_the_centre() -> None:
    """Thirty: twice as many as a surface of degree four has coefficients; none beyond half way."""
    good = dome(count=30)
    apex_of(good, RADIUS)
    for points in (good.points[1:], np.vstack([good.points[1:], [[0.5 * RADIUS, 0.0]]])):
        moved = np.zeros((len(points), 3))
        few = complaint(apex_of, DisplacementField(PRESSURE, points, moved), RADIUS)
        assert few == "expected 30 points about the centre, got 29"
    values = np.full((31, 1), 2.0)
    values[30] = np.nan
    shape = apex_shape(np.vstack([good.points, [[0.0, 0.0]]]), values, RADIUS)
    assert shape.near.tolist() == [True] * 30 + [False]
    # x^3 y / 7: its one derivative that is not zero at the centre is 6 / 7.
    x, y = good.points.T
    cubic = apex_shape(good.points, (x**3 * y / 7)[:, None], RADIUS)
    assert cubic.at_centre(3, 1) == pytest.approx([6 / 7])
    assert cubic.at_centre(1, 1) == pytest.approx([0.0], abs=1e-6)
