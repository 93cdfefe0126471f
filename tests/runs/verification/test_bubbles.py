"""runs/verification/bubbles.py: Hencky's series, and figures of Abaqus."""

import numpy as np
import pytest
from bubblefit.runs.verification.bubbles import (
    FICHTER,
    MODULUS,
    RADIUS,
    THICKNESS,
    apex_coefficient,
    central_stress,
    pressure_at,
    stress_series,
)


def test_series_fulfils_its_differential_equation():
    coefficients = stress_series(0.43)
    even = np.zeros(2 * len(coefficients) - 1)
    even[::2] = coefficients
    stress = np.polynomial.Polynomial(even)
    r = np.linspace(0.05, 0.8, 16)
    left = stress.deriv(2)(r) + 3 * stress.deriv()(r) / r + 1 / (8 * stress(r) ** 2)
    np.testing.assert_allclose(left, 0.0, atol=1e-9)


@pytest.mark.parametrize("nu", FICHTER)
def test_central_stress_is_the_published_coefficient(nu):
    assert 4 * central_stress(nu) == pytest.approx(FICHTER[nu], abs=6e-5)


def test_pressure_grows_with_the_cube_of_the_height():
    low, high = pressure_at(0.01, 0.3), pressure_at(0.02, 0.3)
    assert high == pytest.approx(8 * low)
    scale = (high * RADIUS / (MODULUS * THICKNESS)) ** (1 / 3)
    assert apex_coefficient(0.3) * scale == pytest.approx(0.02)
