"""inference/balanced.py: the one stiffness that heights at the centre of a circular sheet tell."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.inference.balanced import balanced_modulus, note_of_one_stiffness
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.shear_valley import ValleySearch, with_open_shear
from bubblefit.inference.unknowns import Unknowns
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
