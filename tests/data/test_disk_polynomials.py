"""Polynomials over a disk: given back exactly, and refused where points do not tell them."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.sheet import fit_disk_polynomial

from ..complaints import complaint

RADIUS = 80.0
POINTS = RADIUS * np.random.default_rng(2).uniform(-0.7, 0.7, (60, 2))


def surface(points: np.ndarray) -> np.ndarray:
    """Two values, of degree two and three."""
    x, y = points.T / RADIUS
    return np.column_stack([3 + x - 2 * x * y, 0.5 * y**3 - x**2 * y])


def test_a_polynomial_is_given_back() -> None:
    found = fit_disk_polynomial(POINTS, surface(POINTS), RADIUS, 3)
    there = np.array([[0.0, 0.0], [80.0, 0.0], [-40.0, 60.0]])
    np.testing.assert_allclose(found.at(there), surface(there), atol=1e-12)
    assert (found.radius, found.degree, found.coefficients.shape) == (RADIUS, 3, (10, 2))
    assert found.rms == pytest.approx([0.0, 0.0], abs=1e-12)
    # Of a lower degree the first is met, the second is not.
    low = fit_disk_polynomial(POINTS, surface(POINTS), RADIUS, 2)
    left = surface(POINTS) - low.at(POINTS)
    assert low.rms == pytest.approx(np.sqrt(np.mean(left**2, axis=0)))
    assert low.rms[0] < 1e-12 and low.rms[1] > 0.01


def test_two_points_a_coefficient() -> None:
    assert fit_disk_polynomial(POINTS[:20], surface(POINTS[:20]), RADIUS, 3).degree == 3
    few = complaint(fit_disk_polynomial, POINTS[:19], surface(POINTS[:19]), RADIUS, 3)
    assert few == "degree: 19 points are too few for degree 3: expected 20 or more"
    line = POINTS * [1.0, 0.0]
    assert complaint(fit_disk_polynomial, line, surface(line), RADIUS, 3) == (
        "degree: the points do not determine a polynomial of degree 3; take a lower one"
    )
