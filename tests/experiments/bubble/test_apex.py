"""experiments/bubble/apex.py: force, strain and stiffness at the apex."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.apex import apex_of, apex_shape
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.readers.fields import DisplacementField

from ...builders.bubbles import THICKNESS, inflated_bubble, noisy
from ...support.refusals import complaint

DOME_RADIUS, DOME_PRESSURE = 80.0, 0.05
#: 1/mm, of the paraboloid along x and y; mm, its top; stretch of the sheet along x and y.
CURVED, TOP, STRETCH = (0.004, 0.006), 12.0, (1.02, 1.05)


def paraboloid_field(
    noise=0.0, seed=0, count=400, stretch=STRETCH, sign=(1, 1, 1)
) -> DisplacementField:
    draw = np.random.default_rng(seed)
    places = DOME_RADIUS * draw.uniform(-0.35, 0.35, (count, 2))
    after = places * stretch
    height = TOP - 0.5 * after**2 @ CURVED + noise * draw.standard_normal(count)
    moved = np.column_stack([after - places, height - 3.0])
    return DisplacementField(DOME_PRESSURE, places, moved * sign, z=np.full(count, 3.0))


def test_apex_of_a_paraboloid_in_closed_form():
    found = apex_of(paraboloid_field(), DOME_RADIUS)
    assert (found.pressure, found.height) == (DOME_PRESSURE, pytest.approx(TOP - 3.0))
    assert found.curvature == pytest.approx(sum(CURVED))
    assert found.force == pytest.approx(DOME_PRESSURE / sum(CURVED))  # 5 N/mm
    assert found.strain == pytest.approx(np.log(STRETCH))
    assert found.stiffness == pytest.approx(5.0 / np.mean(np.log(STRETCH)))
    assert found.error == pytest.approx(0.0, abs=1e-9)
    found = apex_of(replace(paraboloid_field(sign=(1, 1, -1)), z=None), DOME_RADIUS)
    assert found.curvature == pytest.approx(-sum(CURVED))
    assert found.force == found.error == np.inf
    still = apex_of(replace(paraboloid_field(sign=(0, 0, 1)), z=None), DOME_RADIUS)
    assert still.strain == pytest.approx((0.0, 0.0), abs=1e-12)
    assert (
        apex_of(replace(paraboloid_field(sign=(-1, -1, 1)), z=None), DOME_RADIUS).stiffness
        == np.inf
    )


def test_standard_error_of_the_apex_is_scatter_of_repetitions():
    """Compute it for a sheet that is hardly stretched, whose thinning is left out."""
    found = [
        apex_of(paraboloid_field(0.02, seed, stretch=(1.0, 1.001)), DOME_RADIUS)
        for seed in range(200)
    ]
    scatter = np.std([apex.force for apex in found])
    # 200 repetitions know a standard deviation to 5 %.
    assert np.mean([apex.error for apex in found]) == pytest.approx(scatter, rel=0.15)


def test_apex_needs_enough_points_about_the_centre():
    """Thirty: twice as many as a surface of degree four has coefficients; none beyond half way."""
    good = paraboloid_field(count=30)
    apex_of(good, DOME_RADIUS)
    for points in (good.points[1:], np.vstack([good.points[1:], [[0.5 * DOME_RADIUS, 0.0]]])):
        moved = np.zeros((len(points), 3))
        few = complaint(apex_of, DisplacementField(DOME_PRESSURE, points, moved), DOME_RADIUS)
        assert few == "expected 30 points about the centre, got 29"
    values = np.full((31, 1), 2.0)
    values[30] = np.nan
    shape = apex_shape(np.vstack([good.points, [[0.0, 0.0]]]), values, DOME_RADIUS)
    assert shape.is_fitted.tolist() == [True] * 30 + [False]
    # x^3 y / 7: its one derivative that is not zero at the centre is 6 / 7.
    x, y = good.points.T
    cubic = apex_shape(good.points, (x**3 * y / 7)[:, None], DOME_RADIUS)
    assert cubic.at_centre(3, 1) == pytest.approx([6 / 7])
    assert cubic.at_centre(1, 1) == pytest.approx([0.0], abs=1e-6)


def test_force_at_the_apex_is_that_of_the_model(clean_bubble):
    """The mean of the two membrane forces, within the little that they differ: 3 %."""
    law = HypoelasticLaw.linear(400.0, 400.0, 400.0 / 2.48)  # isotropic: both forces are the same
    last = inflated_bubble(law)[-1]
    top = apex_of(last, 100.0)
    strain = 0.5 * sum(top.strain)
    assert top.force / THICKNESS == pytest.approx(400.0 / (1 - 0.24) * strain, rel=0.03)
    assert top.height == pytest.approx(last.displacement[:, 2].max(), rel=0.01)
    noise = [apex_of(noisy(clean_bubble, s)[-1], 100.0) for s in (0.05, 0.1)]
    assert 0 < noise[0].error < 0.05 * noise[0].force
    assert noise[1].error == pytest.approx(2 * noise[0].error, rel=0.2)
