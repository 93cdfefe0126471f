"""Piecewise cubics beside those of scipy."""

import numpy as np
import pytest
import scipy
from bubblefit.materials.cubic_curves import hermite_slope_weights, hermite_weights, spline_slopes

POSITIONS = np.linspace(-0.2, 1.2, 71)


@pytest.mark.parametrize("count", [2, 3, 4, 9])
def test_spline_and_its_slope_are_those_of_scipy(count):
    knots = np.linspace(0.0, 1.0, count) ** 1.5
    values = np.random.default_rng(count).random((count, 2))
    spline = scipy.interpolate.CubicSpline(knots, values)
    slopes = spline_slopes(knots) @ values
    weights = (hermite_weights, hermite_slope_weights)
    for derivative, weights_of in enumerate(weights):
        by_value, by_slope = weights_of(knots, POSITIONS)
        exact = spline(POSITIONS, derivative)
        assert by_value @ values + by_slope @ slopes == pytest.approx(exact, abs=1e-10)


def test_cubic_through_values_and_slopes_is_that_of_scipy():
    knots = np.array([0.0, 0.1, 0.4, 1.0])
    values, slopes = np.random.default_rng(1).random((2, 4))
    curve = scipy.interpolate.CubicHermiteSpline(knots, values, slopes)
    by_value, by_slope = hermite_weights(knots, POSITIONS)
    assert by_value @ values + by_slope @ slopes == pytest.approx(curve(POSITIONS), abs=1e-12)
