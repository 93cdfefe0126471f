"""experiments/biaxial/prepared.py: residuals, noise and errors of biaxial paths."""

import numpy as np
import pytest
import scipy
from bubblefit.experiments.base import Weighting
from bubblefit.inference.linear import LinearisedFit
from bubblefit.inference.noise import Noise
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import elongations

from ...builders.biaxial_tests import (
    BENT_LAW,
    FIVE_RATIOS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)
from ...builders.projects import fit_setup

CONSTANT_LAW = HypoelasticLaw.linear(900.0, 600.0, 30.0)


def test_biaxial_residuals_and_derivatives(five_ratios_folder):
    setup = fit_setup(five_ratios_folder / "project.toml")
    (prepared,) = setup.tests
    comparisons = prepared.comparisons(setup.make_solver, Weighting())
    assert [c.name for c in comparisons] == [f"biaxial: {ratio}" for ratio in FIVE_RATIOS]
    law = BENT_LAW.with_beta(1.1 * BENT_LAW.beta)
    free = tuple(range(12))
    for comparison in comparisons:
        objective = comparison.objective
        history, jacobian = comparison.differentiate(law, free, {}, warm=False)
        residual = objective.residual(history, {})
        own = elongations(history.displacement)
        off = (own - own[0] - objective.strain)[1:]
        np.testing.assert_allclose(residual * objective.scale, 100 * off.T.ravel(), atol=1e-12)
        rms, largest = np.sqrt(np.mean(off[:, 0] ** 2)), np.abs(objective.strain).max()
        assert np.linalg.norm(residual[: objective.sizes[0]]) == pytest.approx(rms / largest)
        for place in (7, 11):
            step = 1e-4 * np.eye(12)[place]
            laws = [law.with_beta(law.beta + s) for s in (step, -step)]
            up, down = (objective.residual(comparison.run(x, free, {}, False), {}) for x in laws)
            slope = (up - down) / 2e-4
            least = 1e-6 * np.abs(jacobian[:, [7, 11]]).max()
            np.testing.assert_allclose(jacobian[:, place], slope, rtol=1e-5, atol=least)
        larger = np.linspace(2, 30, 30)[1:, None]
        assert [len(at) for at in objective.positions] == list(objective.sizes)
        np.testing.assert_allclose(objective.positions[1], larger)
        # Weights of one test among others add up to that of the test.
    weighted, own = prepared.comparisons(setup.make_solver, Weighting(True, 3.0)), comparisons[0]
    history, other = (own.run(one, free, {}, False) for one in (law, BENT_LAW))
    residual = own.objective.residual(history, {})
    ratio = weighted[0].objective.residual(history, {}) / residual
    np.testing.assert_allclose(ratio, 3.0 / 10)
    shifted = own.objective.shifted(history, other)
    np.testing.assert_allclose(shifted.residual(other, {}), residual, atol=1e-12)


@pytest.mark.parametrize(
    ("line", "noise", "how"), [("noise = 0.03", 0.03, "given"), ("", 0.01, "assumed")]
)
def test_noise_of_a_biaxial_test_is_that_of_its_section(tmp_path, line, noise, how):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["1:1"]))
    (prepared,) = fit_setup(biaxial_project(tmp_path, line)).tests
    (comparison,) = prepared.comparisons(lambda *a: None, Weighting())
    assert comparison.objective.least_noise == pytest.approx(noise)
    assert comparison.objective.noise_is == how and comparison.objective.unit == "%"


def test_bands_hold_the_noise_of_the_rows_from_which_strains_count(tmp_path):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(CONSTANT_LAW, ["1:1", "2:1", "1:2"]))
    problem = fit_setup(biaxial_project(tmp_path, "noise = 0.03", form="constant")).problem()
    truth = problem.unknowns.at([CONSTANT_LAW.beta[row] for row in (3, 7, 11)])
    best = problem.evaluate(truth, True)
    no_noise = np.zeros_like(best.residual)
    noise = Noise.from_residual(problem, no_noise).with_shared_errors(problem, best, no_noise)
    fitted = LinearisedFit.of(problem, best, noise)
    covariance = fitted.noise_response @ fitted.noise_response.T
    random = np.random.default_rng(0)
    draws = 400
    estimates = np.zeros((draws, problem.unknowns.count))
    for comparison, number in zip(problem.comparisons, range(3), strict=True):
        objective = comparison.objective
        rows = problem.rows(number)
        weights = fitted.weights[rows, None] * np.ones(draws)
        strains = 3e-4 * random.standard_normal((*objective.strain.shape, draws))
        residuals = objective.in_blocks(strains - strains[0])
        estimates += (fitted.estimator[:, rows] @ (weights * residuals)).T
    yarns = slice(1, 3)  # the shear modulus is open
    chi_square = np.sum(
        estimates[:, yarns].T * np.linalg.solve(covariance[yarns, yarns], estimates[:, yarns].T)
    )
    # Sums of squares of independent errors scatter as chi-square does: 1 in 100 lies outside.
    low, high = scipy.stats.chi2.ppf([0.005, 0.995], 2 * draws)
    assert low < chi_square < high
