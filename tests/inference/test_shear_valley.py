"""inference/shear_valley.py: laws and stiffness where data leave G12, or warp and fill, open."""

from dataclasses import replace
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.inference.assessment import certainty
from bubblefit.inference.comparison import ErrorColumns
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.reported import reported_moduli
from bubblefit.inference.shear_valley import (
    OPEN_SHEAR,
    ValleySearch,
    balanced_modulus,
    note_of_one_stiffness,
    with_open_shear,
)
from bubblefit.inference.unknowns import Unknowns
from bubblefit.runs.verdict import objections_in
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.gauges import LAW, PRESSURES, THICKNESS
from ..builders.projects import fit_setup

PLACES = [[0.0, 0.0], [50.0, 0.0], [0.0, 50.0]]
BOUNDS = {"E1": [20.0, 3000.0], "E2": [20.0, 3000.0], "G12": [1.0, 60.0]}


def problem_of(places, symmetry="orthotropic", bounds=BOUNDS):
    """A fit to the heights of its own model with E1 = 700, E2 = 300 and G12 = 15 MPa, no noise."""
    bubble = bf.Bubble.heights(
        PRESSURES,
        np.ones((len(places), len(PRESSURES))),
        places=places,
        radius=100.0,
        elements=48,
        symmetry="quarter",
        noise=0.05,
    )
    if symmetry != "orthotropic":
        bounds = {name: ends for name, ends in bounds.items() if name != "E2"}
    law = bf.Law("constant", bounds=bounds, symmetry=symmetry)
    setup = fit_setup(bf.Project.of(bubble, fabric=bf.Fabric("", THICKNESS), law=law))
    (comparison,) = setup.tests[0].comparisons(MembraneSolver, Weighting())
    history = comparison.solver.run(comparison.model, LAW)
    objective = comparison.objective
    readers = [
        replace(r, series=replace(r.series, value=r.values(history.displacement)))
        for r in objective.readers
    ]
    kind = type(objective)
    exact = kind(readers, "e", 1.0, {"height": 0.05})
    exact.is_exchangeable = objective.is_exchangeable
    comparison = replace(comparison, objective=exact)
    law = setup.law
    bounds = setup.bounds
    unknowns = Unknowns.of(law.form, law.nu12, law.strain_range, bounds, [comparison])
    return FitProblem((comparison,), law, unknowns)


@pytest.fixture(scope="module")
def apex():
    problem = problem_of(PLACES[:1])
    y = problem.unknowns.at(np.array([15.0, 300.0, 700.0]))
    return problem, problem.evaluate(y, True)


def test_heights_of_the_apex_do_not_tell_warp_from_fill(apex):
    problem, point = apex
    assert problem.is_exchangeable and point.value < 1e-9
    assert not problem_of(PLACES).is_exchangeable
    assert not problem_of(PLACES[:1], "balanced").is_exchangeable


def test_bands_of_both_moduli_reach_over_both(apex):
    problem, point = apex
    noise = Noise.from_residual(problem, point.residual)
    linear, _ = posteriors_of(problem, point, noise)
    search = ValleySearch(problem, point, noise, np.linspace(0.0, 0.05, 3))
    posterior, _ = with_open_shear(linear, None, search, None)
    for name in ("E1", "E2"):
        low, high = np.quantile(posterior.modulus_samples(name, np.zeros(1)), [0.025, 0.975])
        # E2 = 20 and E1 = 1060 MPa, or these exchanged, fit the readings within their noise.
        assert low == pytest.approx(20.0, rel=0.1) and high > 1000.0
    draws = posterior.law_draws @ problem.unknowns.to_coefficients.T
    assert draws[:, 1].mean() == pytest.approx(draws[:, 2].mean(), rel=0.1)


def test_the_one_stiffness_is_that_of_the_balanced_sheet(apex):
    problem, point = apex
    modulus = balanced_modulus(
        problem, point, Noise.from_residual(problem, point.residual), end=0.05
    )
    # The geometric mean is 458 MPa; G12 from 1 to 60 MPa changes it by 3 %.
    assert modulus.value[0] == pytest.approx(458.0, rel=0.03)
    assert modulus.lower[0] < 458.3 < modulus.upper[0] < 1.1 * modulus.lower[0]
    words = note_of_one_stiffness(modulus)
    assert f"{modulus.value[0]:.4g} MPa" in words and "geometric mean" in words


def test_band_of_the_one_stiffness_is_wide_where_any_shear_modulus_is_allowed():
    """A sheet as stiff in shear as a foil has 12 % less of it: the best fit may be at any G12."""
    problem = problem_of(PLACES[:1], bounds={**BOUNDS, "G12": [1.0, 300.0]})
    stiff = problem.evaluate(problem.unknowns.at(np.array([300.0, 20.0, 1050.0])), True)
    noise = Noise.from_residual(problem, 0.0 * stiff.residual)
    modulus = balanced_modulus(problem, stiff, noise, end=0.05)
    assert 1.02 * modulus.lower[0] < 458.3 < modulus.upper[0]
    assert 1.1 * modulus.lower[0] < modulus.upper[0] < 1.16 * modulus.lower[0]


def test_band_of_the_one_stiffness_holds_in_noisy_fields(apex):
    """Coverage to first order: 20 fields of 0.05 mm noise about the same apex curve."""
    problem, point = apex
    noise = Noise.from_residual(problem, point.residual)
    random = np.random.default_rng(3)
    # By the logarithms of G12, E2 and E1, which are known to a factor before the test.
    slopes = point.jacobian * point.unknowns / noise.residual_sigma[:, None]
    covariance = np.linalg.inv(slopes.T @ slopes + np.eye(3))
    variances, directions = np.linalg.eigh(covariance)
    fields = random.standard_normal((20, len(slopes)))
    errors = fields @ slopes @ covariance @ directions[:, 0]
    assert (np.abs(errors) <= 1.96 * np.sqrt(variances[0])).sum() >= 18
    # One combination is known to less than 1 %, the others hardly at all.
    assert np.sqrt(variances[0]) < 0.01 and np.sqrt(variances[1:]).min() > 0.1


def test_valley_is_about_the_residual_of_the_best_fit():
    """That of CalculiX, while the membrane searches: here as if all moduli were 2 % larger."""
    problem = problem_of(PLACES)
    point = problem.evaluate(problem.unknowns.at(np.array([15.0, 300.0, 700.0])), True)
    stiffer = replace(point, residual=point.residual - 0.02 * point.jacobian @ point.unknowns)
    strain = np.zeros(1)
    noise = Noise.from_residual(problem, point.residual)
    moduli = [
        np.mean(
            [
                law.posterior.best
                for law in ValleySearch(problem, best, noise, strain).valley().laws
            ],
            0,
        )
        for best in (point, stiffer)
    ]
    assert moduli[1][1:] / moduli[0][1:] == pytest.approx(1.02, abs=0.008)


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
