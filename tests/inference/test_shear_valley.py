"""inference/shear_valley.py: E1 and E2 over all shear moduli that readings of few gauges allow."""

import numpy as np
import pytest
from bubblefit.inference.noise import Noise
from bubblefit.inference.shear_valley import (
    laws_by_shear,
    moduli_over_shear,
    samples_over_shear,
)

from .test_balanced import BOUNDS, PLACES, problem_of

STRAINS = {"E1": np.array([0.0, 0.05]), "E2": np.array([0.0, 0.05])}


@pytest.fixture(scope="module")
def two_gauges():
    """Readings without noise at the apex and at half the radius, and the fit at a stiff shear."""
    problem = problem_of(PLACES[:2], bounds={**BOUNDS, "G12": [1.0, 300.0]})
    point = problem.evaluate(problem.unknowns.at(np.array([200.0, 230.0, 770.0])), True)
    return problem, point, Noise.from_residual(problem, 0.0 * point.residual).residual_sigma


def test_laws_of_all_shear_moduli_fit_the_readings(two_gauges):
    problem, point, sigma = two_gauges
    assert problem.is_curved_in_shear
    laws = laws_by_shear(problem, point, sigma, STRAINS)
    shear_moduli = [law.shear_modulus for law in laws]
    np.testing.assert_allclose(shear_moduli, np.geomspace(1.0, 300.0, 5), rtol=1e-6)
    assert max(law.misfit for law in laws) < 3.0  # of 12 readings
    moduli = np.array([[law.moduli[name][0] for name in STRAINS] for law in laws])
    np.testing.assert_allclose(np.exp(np.log(moduli[1:3]).mean(axis=0)), [700, 300], rtol=0.03)
    assert (np.diff(moduli[:, 0]) > 0).all() and (np.diff(moduli[:, 1]) < 0).all()


def test_samples_lie_between_the_laws_with_their_noise(two_gauges):
    problem, point, sigma = two_gauges
    laws = laws_by_shear(problem, point, sigma, STRAINS)
    samples = samples_over_shear(laws, "E1")[:, 0]
    assert 640.0 < np.median(samples) < 760.0
    assert 30.0 < samples.std() < 70.0


def test_bands_reach_over_the_laws_whatever_the_reported_one_is(two_gauges):
    problem, point, sigma = two_gauges
    law = problem.unknowns.law(problem.law, point.unknowns)
    mesh = {name: np.full(2, 0.01) for name in STRAINS}
    moduli = moduli_over_shear(problem, point, sigma, law, STRAINS, mesh)
    assert moduli["E1"].lower[0] < 650.0 < 770.0 < moduli["E1"].upper[0] < 850.0
    assert moduli["E2"].lower[0] < 230.0 < 330.0 < moduli["E2"].upper[0] < 400.0
