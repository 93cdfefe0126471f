"""Validation: polynomials and scatter of the published load curves."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.curves import (
    fit_load_polynomial,
    read_load_curves,
    read_published_polynomials,
    specimen_deviation,
)

from ..support.paths import PUBLISHED

PUBLISHED_EXAMPLE = Path(__file__).parents[2] / "examples/uniaxial-valmex7318/curves.csv"


def test_examples_have_the_published_polynomials():
    ours = read_published_polynomials(PUBLISHED_EXAMPLE)
    theirs = read_published_polynomials(PUBLISHED / "published_uniaxial_polynomials.csv")
    assert list(ours) == list(theirs) == ["warp", "fill", "bias"]
    for one, other in zip(ours.values(), theirs.values(), strict=True):
        np.testing.assert_array_equal(one.polynomial.coefficients, other.polynomial.coefficients)
        assert (one.gauge_length, one.final_length) == (other.gauge_length, other.final_length)
        assert one.scatter == other.scatter
        assert (one.polynomial(0.0), one.polynomial.order) == (0.0, 4)
    # Lengths are those of Table 3.1.
    strain = {name: p.polynomial.end / p.gauge_length for name, p in ours.items()}
    assert strain == pytest.approx({"warp": 0.165, "fill": 0.261, "bias": 0.555}, abs=5e-4)


@pytest.fixture
def fill_points(shared_data):
    curves = read_load_curves(shared_data / "uniaxial/valmex7318_load_gauge.csv")
    return {curve.direction: curve for curve in curves}


def test_published_scatter_is_a_standard_deviation(fill_points):
    """21.7, 64.1, 40.3 N: about their own mean, n - 1."""
    for direction, one in read_published_polynomials(PUBLISHED_EXAMPLE).items():
        curve = fill_points[direction]
        found = specimen_deviation(curve.elongation, curve.load, one.polynomial)
        assert found == pytest.approx(one.scatter, abs=0.05)


def test_published_fill_polynomial_misses_one_digitised_point(fill_points):
    """Fill gives R^2 0.9576 where Table 3.1 has 0.959, and coefficients 0.4 N/mm apart."""
    published = read_published_polynomials(PUBLISHED_EXAMPLE)["fill"].polynomial
    curve = fill_points["fill"]
    refitted = fit_load_polynomial(curve.elongation, curve.load)
    assert refitted.r_squared == pytest.approx(0.9576, abs=5e-5)
    assert np.abs(refitted.coefficients - published.coefficients).max() > 0.4
    completed = fit_load_polynomial(np.append(curve.elongation, 0.07), np.append(curve.load, -2.1))
    off = np.abs(completed.coefficients - published.coefficients)[1:]
    assert (off < [0.01, 0.01, 0.005, 0.0005]).all()
    assert completed.r_squared == pytest.approx(0.959, abs=5e-4)
