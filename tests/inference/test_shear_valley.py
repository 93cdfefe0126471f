"""inference/shear_valley.py: the laws that readings of few gauges allow where G12 stays open."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.inference.assessment import certainty
from bubblefit.inference.comparison import ErrorColumns
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.reported import reported_moduli
from bubblefit.inference.shear_valley import OPEN_SHEAR, ValleySearch, with_open_shear
from bubblefit.runs.verdict import objections_in

from .test_balanced import BOUNDS, PLACES, problem_of

STRAIN = np.array([0.0, 0.05])
STRAINS = {"E1": STRAIN, "E2": STRAIN, "G12": STRAIN}


@pytest.fixture(scope="module")
def two_gauges():
    """Readings without noise at the apex and at half the radius, and the fit at a stiff shear."""
    problem = problem_of(PLACES[:2], bounds={**BOUNDS, "G12": [1.0, 300.0]})
    point = problem.evaluate(problem.unknowns.at(np.array([200.0, 230.0, 770.0])), True)
    noise = Noise.from_residual(problem, 0.0 * point.residual)
    return ValleySearch(problem, point, noise, STRAIN)


@pytest.fixture(scope="module")
def opened(two_gauges):
    """The posterior of the readings, and that of finer meshes, in which E1 rises by 7 MPa."""
    posterior, _ = posteriors_of(two_gauges.problem, two_gauges.best, two_gauges.noise)
    step = two_gauges.problem.unknowns.at(np.array([400.0, 5.0, 7.0]))
    return with_open_shear(posterior, posterior, two_gauges, SimpleNamespace(step=step))


@pytest.fixture(scope="module")
def open_posterior(opened):
    return opened[0]


@pytest.fixture(scope="module")
def valley(open_posterior):
    (valley,) = open_posterior.valleys
    return valley


def modulus(problem, name, y):
    return (problem.unknowns.modulus_rows(name, np.zeros(1)) @ y)[0]


def test_laws_of_all_shear_moduli_fit_the_readings(two_gauges, valley):
    problem = two_gauges.problem
    assert problem.is_curved_in_shear
    shear_moduli = [law.shear_modulus for law in valley.laws]
    np.testing.assert_allclose(shear_moduli, np.geomspace(1.0, 300.0, 5), rtol=1e-6)
    assert max(law.misfit for law in valley.laws) < 3.0  # of 12 readings
    moduli = np.array(
        [[modulus(problem, n, law.posterior.best) for n in ("E1", "E2")] for law in valley.laws]
    )
    np.testing.assert_allclose(np.exp(np.log(moduli[1:3]).mean(axis=0)), [700, 300], rtol=0.03)
    assert (np.diff(moduli[:, 0]) > 0).all() and (np.diff(moduli[:, 1]) < 0).all()


def test_draws_lie_between_the_laws_with_their_noise(two_gauges, valley):
    draws = valley.draws(1000, np.random.default_rng(0))
    samples = modulus(two_gauges.problem, "E1", draws.T)
    assert 640.0 < np.median(samples) < 760.0
    assert 30.0 < samples.std() < 70.0


def test_bands_reach_over_the_laws_whatever_the_reported_one_is(two_gauges, open_posterior):
    problem = two_gauges.problem
    law = problem.unknowns.law(problem.law, two_gauges.best.unknowns)
    moduli = reported_moduli(open_posterior, law, STRAINS)
    assert moduli["E1"].lower[0] < 650.0 < 770.0 < moduli["E1"].upper[0] < 850.0
    assert moduli["E2"].lower[0] < 230.0 < 330.0 < moduli["E2"].upper[0] < 400.0
    assert moduli["G12"].lower[0] == pytest.approx(1.0, rel=1e-3)
    assert moduli["G12"].upper[0] == pytest.approx(300.0, rel=1e-3)
    assert not moduli["G12"].determined.any()


def test_draws_of_the_law_have_the_spread_of_the_bands(two_gauges, open_posterior):
    """About one law they would be normal, with values of G12 that are not within its bounds."""
    unknowns = two_gauges.problem.unknowns
    law = unknowns.law(two_gauges.problem.law, two_gauges.best.unknowns)
    moduli = reported_moduli(open_posterior, law, STRAINS)
    laws = open_posterior.laws(law, 300, np.random.default_rng(1))
    rows, limits = unknowns.inequalities
    assert (open_posterior.sample(100, np.random.default_rng(2)) @ rows.T > limits - 1e-6).all()
    for name in ("E1", "E2"):
        values = np.array([float(drawn.modulus(name, 0.0)) for drawn in laws])
        ends = np.quantile(values, [0.025, 0.975])
        np.testing.assert_allclose(ends, moduli[name].band[:, 0], rtol=0.06)
    shear = np.array([float(drawn.modulus("G12", 0.0)) for drawn in laws])
    assert shear.min() >= 1.0 - 1e-6 and shear.max() <= 300.0 + 1e-6
    assert np.quantile(shear, 0.3) < 10.0 and np.quantile(shear, 0.7) > 30.0


def test_finer_meshes_shift_the_laws_within_the_bounds(opened):
    plain, fine = opened
    assert fine.modulus_samples("G12", np.zeros(1)).max() <= 300.0 + 1e-6
    shift = np.median(fine.modulus_samples("E1", np.zeros(1))) - np.median(
        plain.modulus_samples("E1", np.zeros(1))
    )
    assert shift == pytest.approx(7.0, abs=15.0)


def test_errors_that_readings_share_widen_the_laws(two_gauges, valley):
    problem, noise = two_gauges.problem, two_gauges.noise
    shared = 5.0 * noise.residual_sigma[:, None]
    shared[: len(shared) // 2] = 0.0  # all readings of the second gauge too high at once
    search = replace(two_gauges, noise=replace(noise, shared=ErrorColumns.independent(shared)))
    (wide,) = search.valleys()
    row = problem.unknowns.modulus_rows("E1", np.zeros(1))[0]
    variances = [row @ v.laws[2].posterior.covariance @ row for v in (valley, wide)]
    assert variances[1] > 2.0 * variances[0]


def test_open_shear_modulus_on_its_bound_asks_for_a_test_and_not_for_wider_bounds(two_gauges):
    problem = two_gauges.problem
    at_bound = problem.evaluate(problem.unknowns.at(np.array([300.0, 230.0, 780.0])), True)
    law = problem.unknowns.law(problem.law, at_bound.unknowns)
    sure = certainty(problem, at_bound, law, np.full(3, 0.05), noise=two_gauges.noise)
    assert not any("bound: the data ask" in str(note) for note in sure.notes)
    (note,) = (note for note in sure.notes if note.kind is OPEN_SHEAR)
    assert "45 degrees" in str(note) and "wider bounds would not" in str(note)
    assert objections_in(sure.notes, {})[0].advice.startswith("add a strip at 45 degrees")
