"""Polynomials of load over elongation, and specimens about them."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.readers.curves import LoadCurve
from bubblefit.readers.polynomials import LoadPolynomial, fit_load_polynomial, specimen_scatter
from hypothesis import given, settings
from hypothesis import strategies as st

from ..complaints import complaint


@settings(deadline=None, max_examples=60)
@given(
    order=st.integers(1, 6),
    through_origin=st.booleans(),
    end=st.sampled_from([0.01, 3.3, 11.0, 1e3]),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_polynomial_of_the_order_is_met_exactly(order, through_origin, end, seed):
    random = np.random.default_rng(seed)
    scaled = random.uniform(-500, 500, order + 1)
    scaled[0] *= not through_origin
    scaled[-1] += 10.0
    u = np.linspace(0, end, 40)
    load = np.polynomial.polynomial.polyval(u / end, scaled)
    fitted = fit_load_polynomial(u, load, order, through_origin)
    np.testing.assert_allclose(fitted.coefficients * end ** np.arange(order + 1), scaled, atol=1e-6)
    np.testing.assert_allclose(fitted(u), load, atol=1e-8)
    assert (fitted.order, fitted.points, fitted.end) == (order, 40, end)
    assert fitted.r_squared == pytest.approx(1.0)
    assert fitted.rmse < 1e-8
    if through_origin:
        assert fitted.coefficients[0] == 0.0
    step = 1e-5 * end
    inner = u[1:-1]
    difference = (fitted(inner + step) - fitted(inner - step)) / (2 * step)
    np.testing.assert_allclose(fitted.slope(inner), difference, atol=1e-3 * 500 / end)


def test_r_squared_and_rmse_are_those_of_numpy():
    random = np.random.default_rng(1)
    u = np.linspace(0, 3, 50)
    load = 100 * u + random.normal(0, 20, 50)
    fitted = fit_load_polynomial(u, load, 1, through_origin=False)
    np.testing.assert_allclose(fitted.coefficients[::-1], np.polyfit(u, load, 1))
    left = load - fitted(u)
    assert fitted.rmse == pytest.approx(np.sqrt((left**2).mean()))
    assert fitted.r_squared == pytest.approx(np.corrcoef(u, load)[0, 1] ** 2)
    assert fitted(1.0).shape == () and fitted.slope([[1.0, 2.0]]).shape == (1, 2)


@pytest.mark.parametrize(
    ("u", "load", "order", "words"),
    [
        ([1, 2], [1, 2, 3], 1, "as many elongations as loads, got 2 and 3"),
        ([1, np.nan], [1, 2], 1, "expected finite numbers"),
        ([], [], 1, "expected points with elongation above 0"),
        ([-1, -2], [1, 2], 1, "expected points with elongation above 0"),
        ([0, 0], [1, 2], 1, "expected points with elongation above 0"),
        ([1, 2], [3, 3], 1, "all 2 loads are 3 N"),
        ([1, 2, 3], [1, 2, 3], 4, "order 4: 4 coefficients need as many points, there are 3"),
        ([1, 1, 1, 1, 2], [1, 2, 3, 4, 5], 3, "order 3: the elongations settle only 2 of 3"),
        ([1, 2], [1, 2], 0, "order: expected 1 to 12, got 0"),
    ],
)
def test_points_that_settle_no_polynomial(u, load, order, words):
    assert words in complaint(fit_load_polynomial, u, load, order)


def test_scatter_is_about_the_polynomial():
    line = LoadPolynomial(np.array([0.0, 10.0]), 2.0, np.nan, np.nan, 0)
    u = np.array([1.0, 2.0])
    above = LoadCurve("warp", "A", u, np.array([13.0, 23.0]), None)
    below = LoadCurve("warp", "B", u, np.array([10.0, 16.0]), None)
    scatter = specimen_scatter([above, below], line)
    assert scatter.specimens == ("A", "B")
    np.testing.assert_allclose(scatter.rms, [3, np.sqrt(8)])
    np.testing.assert_allclose(scatter.mean, [3, -2])
    assert scatter.rmse == pytest.approx(np.sqrt(34 / 4))
    assert scatter.deviation == pytest.approx(np.std([3, 3, 0, -4], ddof=1))
    assert specimen_scatter(above, line).rms == (3.0,)
    assert "scatter needs two points" in complaint(specimen_scatter, [], line)
