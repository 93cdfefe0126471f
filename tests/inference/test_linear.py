"""inference/linear.py: posterior of a linearised fit."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.assessment import certainty
from bubblefit.inference.comparison import ErrorColumns
from bubblefit.inference.descent import DescentSettings, descend
from bubblefit.inference.linear import (
    NOT_DEFINITE,
    PRIOR,
    SECOND_ORDER,
    TOO_LITTLE,
    FineMeshLimit,
    LinearisedFit,
    SecondOrderSettings,
    SecondOrderTerms,
    information,
    is_definite,
    limit_of,
    posteriors_of,
    residual_of,
    second_order_terms,
    weights_of,
)
from bubblefit.inference.noise import Noise
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.objective import Blocks
from bubblefit.inference.posterior import Posterior
from bubblefit.inference.problem import Evaluation
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.processes import may_run_at_once
from bubblefit.runs import certainty as fit_certainty
from bubblefit.runs.certainty import certainty_of_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.projects import fit_setup
from ..builders.unknowns import project as project_with_unknowns
from .cases import (
    CONSTANT,
    CONSTANT_BOUNDS,
    LAW,
    MODEL,
    NEAR,
    bubble_problem,
    fitted_by_lm,
    one_comparison_problem,
    reference,
    targets,
)

OFFSET = Nuisance("offset", -2.0, 2.0, "mm")
UNKNOWNS = replace(
    Unknowns.of(forms.CONSTANT, 0.24, [0.1, 0.1, 0.1], CONSTANT_BOUNDS),
    nuisance=NuisanceUnknowns({"linear": (OFFSET,)}),
)
TRUTH = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.3)
SIZES, SIGMA = (300, 200), np.array([0.05, 0.4])


@dataclass
class Linear:
    """A problem  r = J (y - truth) - noise  of two blocks; all that propagation asks of one."""

    unknowns: Unknowns
    blocks: Blocks
    is_exchangeable: bool = False


PROBLEM = Linear(UNKNOWNS, Blocks(SIZES))
RANDOM = np.random.default_rng(8)
JACOBIAN = RANDOM.standard_normal((sum(SIZES), 4))
ROWS = SIGMA[PROBLEM.blocks.block_of]
#: The covariance of estimates whose blocks are weighted with the inverse of their norms.
WEIGHT = 1.0 / (SIGMA * np.sqrt(SIZES))[PROBLEM.blocks.block_of]
GAIN = np.linalg.inv(JACOBIAN.T @ (WEIGHT[:, None] * JACOBIAN)) @ JACOBIAN.T * WEIGHT
FORMULA = (GAIN * ROWS) @ (GAIN * ROWS).T


NO_ERRORS = ErrorColumns.independent(np.zeros((len(ROWS), 0)))


def noise(rows=ROWS):
    return Noise({}, {}, rows, rows, NO_ERRORS)


def posterior_of(problem, best, by):
    return posteriors_of(problem, best, by)[0]


def evaluation(y, drawn):
    residual = JACOBIAN @ (y - TRUTH) - drawn
    return Evaluation(y, y[:3], residual, PROBLEM.blocks.value(residual), JACOBIAN, ())


def best_of(drawn):
    """The least of |r1| + |r2|, by weighting with the inverse norms in turn."""
    y = TRUTH
    for _ in range(12):
        r = JACOBIAN @ (y - TRUTH) - drawn
        w = 1.0 / np.sqrt(PROBLEM.blocks.norms(r))[PROBLEM.blocks.block_of]
        y = y - np.linalg.lstsq(w[:, None] * JACOBIAN, w * r, rcond=None)[0]
    return np.asarray(y)


def test_posterior_covariance_is_that_of_fits_to_drawn_noise():
    drawn = ROWS * np.random.default_rng(3).standard_normal((800, len(ROWS)))
    found = np.array([best_of(one) for one in drawn])
    said = posterior_of(
        PROBLEM,
        evaluation(best_of(drawn[0]), drawn[0]),
        Noise({}, {}, ROWS, 0.5 * ROWS, NO_ERRORS),
    )
    assert found.std(axis=0) == pytest.approx(np.sqrt(np.diag(said.covariance)), rel=0.08)
    assert said.covariance == pytest.approx(FORMULA, rel=0.1, abs=0.05 * np.abs(FORMULA).max())
    assert said.centre == pytest.approx(said.best, abs=1e-6)


def test_posterior_of_an_exact_fit_weighs_blocks_by_smallest_noise():
    exact = posterior_of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise())
    assert exact.covariance == pytest.approx(FORMULA)
    t = UNKNOWNS.to_coefficients
    assert exact.coefficient_covariance[:3, :3] == pytest.approx(t @ exact.covariance[:3, :3] @ t.T)
    assert exact.labels == (*UNKNOWNS.labels, "offset")
    assert exact.coefficient_covariance[3, 3] == exact.covariance[3, 3]
    sigma = np.sqrt(np.diag(exact.coefficient_covariance))
    assert exact.correlations * sigma * sigma[:, None] == pytest.approx(
        exact.coefficient_covariance
    )
    nothing = posterior_of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise(0 * ROWS))
    assert not nothing.covariance.any()
    held = TRUTH - [0.02, 0.0, 0.0, 0.0]
    posterior = posterior_of(PROBLEM, evaluation(held, 0 * ROWS), noise())
    assert posterior.centre == pytest.approx(TRUTH, abs=1e-12)
    assert (posterior.best == held).all()


def test_posterior_of_the_fine_mesh_is_shifted_by_its_step():
    y, error = TRUTH + 0.01, JACOBIAN @ np.full(4, -0.02)
    point = evaluation(y, 0 * ROWS)
    limit = FineMeshLimit(np.full(4, 0.02), point.residual, error)
    own, fine = posteriors_of(PROBLEM, point, noise(), limit)
    assert own.best == pytest.approx(y) and own.centre == pytest.approx(TRUTH)
    assert fine is not None and fine.best == pytest.approx(y + 0.02)
    assert fine.centre == pytest.approx(TRUTH + 0.02)
    assert fine.covariance - own.covariance == pytest.approx(np.full((4, 4), 0.002**2))


def test_step_of_blocks_below_their_least_norm_is_between_optima_of_the_merit():
    problem = Linear(UNKNOWNS, Blocks(SIZES, np.array([100.0, 900.0])))
    random = np.random.default_rng(5)
    drawn = ROWS * random.standard_normal(len(ROWS))
    error = 0.2 * random.standard_normal(len(ROWS))
    root = 1.0 / np.sqrt(problem.blocks.least_norms)[problem.blocks.block_of]
    optima = [
        TRUTH + np.linalg.lstsq(root[:, None] * JACOBIAN, root * values, rcond=None)[0]
        for values in (drawn, drawn - error)
    ]
    merits = [
        problem.blocks.merit(JACOBIAN @ (optima[1] + change - TRUTH) - drawn + error)
        for change in 1e-3 * np.vstack([np.zeros(4), np.eye(4), -np.eye(4)])
    ]
    assert np.argmin(merits) == 0
    point = evaluation(optima[0], drawn)
    limit = limit_of(problem, point, point.residual + 0.75 * error, 2.0)
    np.testing.assert_allclose(limit.step, optima[1] - optima[0], rtol=1e-6)


@pytest.fixture(scope="module")
def best():
    fit = bubble_problem(CONSTANT)
    return fit, fit.evaluate(CONSTANT.at(np.array([15.0, 190.0, 330.0])), True)


def test_error_of_the_mesh_follows_from_one_refinement(best):
    fit, point = best
    error = 1e-3 * np.random.default_rng(1).standard_normal(len(point.residual))
    for factor in (2.0, 1.5):
        finer = point.residual + error * (1 - factor**-2)
        limit = limit_of(fit, point, finer, factor)
        np.testing.assert_allclose(limit.error, error, atol=1e-15)
        expected = point.residual + error + point.jacobian @ limit.step
        np.testing.assert_allclose(limit.residual, expected)


def test_step_takes_up_an_error_that_the_unknowns_can_follow(best):
    fit, point = best
    step = 1e-3 * np.array([0.5, -1.0, 2.0]) * np.abs(point.unknowns)
    error = -point.jacobian @ step
    limit = limit_of(fit, point, point.residual + 0.75 * error, 2.0)
    np.testing.assert_allclose(limit.step, step, rtol=1e-5)
    np.testing.assert_allclose(limit.residual, point.residual, atol=1e-9)


def test_model_without_error_moves_nothing(best):
    fit, point = best
    limit = limit_of(fit, point, point.residual, 2.0)
    np.testing.assert_allclose(limit.step, 0.0, atol=1e-12)
    assert not limit.error.any()
    exact = replace(point, residual=0 * point.residual)
    limit = limit_of(fit, exact, exact.residual, 2.0)
    assert not limit.step.any() and limit.residual is exact.residual


def test_step_keeps_the_bounds(best):
    fit, point = best
    a, c = fit.unknowns.inequalities
    error = -point.jacobian @ (-10.0 * point.unknowns)
    limit = limit_of(fit, point, point.residual + 0.75 * error, 2.0)
    assert (a @ (point.unknowns + limit.step) >= c - 1e-7).all()
    assert limit.step.any()


def test_residual_of_the_same_models_is_that_of_the_fit(best):
    fit, point = best
    law = fit.unknowns.law(fit.law, point.unknowns)
    found = residual_of(fit, fit.comparisons, point, law)
    np.testing.assert_allclose(found, point.residual, atol=1e-6 * np.abs(point.residual).max())


def test_finer_model_with_other_residuals_is_a_failure(best):
    fit, point = best
    law = fit.unknowns.law(fit.law, point.unknowns)
    (comparison,) = fit.comparisons
    objective = SimpleNamespace(residual=lambda history, nuisance: np.zeros(3))
    other = replace(comparison, objective=objective)
    with pytest.raises(SolverFailure, match="does not give what was matched"):
        residual_of(fit, [other], point, law)


LIGHTLY_DAMPED = DescentSettings(initial_damping=1e-6)
#: mm of noise beside 0.5 mm that constants leave of the fields of cubics.
NOISE, REFITS = 0.02, 40


def noisy_bubble(number):
    random = np.random.default_rng(number)
    fields = reference().displacement
    fields = fields + NOISE * random.standard_normal(fields.shape)
    return one_comparison_problem(
        MODEL, MembraneSolver(), LAW, FieldObjective(targets(fields), "e"), CONSTANT
    )


@pytest.fixture(scope="module")
def constants_fitted_to_cubic():
    """A fit of constants to the fields of cubics: problem, optimum, and the noise that there is."""
    fit = bubble_problem(CONSTANT)
    found = fitted_by_lm(fit, CONSTANT.at(NEAR), 1e-9, 60)
    best = fit.evaluate(found.best.unknowns, True)
    assert best is not None
    rows = NOISE / fit.scale
    return (
        fit,
        best,
        replace(
            Noise.from_residual(fit, best.residual),
            residual_sigma=rows,
            smallest_residual_sigma=rows,
        ),
    )


def test_second_order_sigma_is_scatter_of_refits_of_a_wrong_law(constants_fitted_to_cubic):
    fit, best, noise = constants_fitted_to_cubic
    second = second_order_terms(fit, best, noise)
    assert second.directions == second.analyses == 3
    assert is_definite(LinearisedFit.of(fit, best, noise), second)
    first, whole = (
        np.sqrt(np.diag(posteriors_of(fit, best, noise, None, s)[0].covariance))
        for s in (None, second)
    )
    found = []
    for number in range(REFITS):
        own = noisy_bubble(number)
        point = own.evaluate(best.unknowns, True)
        found.append(descend(own, point, 1e-9, 60, norms=True, settings=LIGHTLY_DAMPED)[0].unknowns)
    scatter = np.std(found, axis=0, ddof=1)
    # Forty refits say it to 11 %.
    assert whole == pytest.approx(scatter, rel=0.25)
    assert (first < 0.75 * scatter).all()


def test_second_order_curvature_is_difference_of_gradients(constants_fitted_to_cubic):
    fit, best, noise = constants_fitted_to_cubic
    settings = SecondOrderSettings(min_step=1e-4, max_step=1e-4)
    noiseless = replace(noise, smallest_residual_sigma=0 * noise.smallest_residual_sigma)
    second = second_order_terms(fit, best, noiseless, settings)
    near = LinearisedFit.of(fit, best, noiseless)
    back = (near.sharp * near.curvature) @ near.sharp.T + second.hessian_term
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-4 * near.sizes[k]  # the sheet nearly folds: a larger step sees another
        ends = [fit.evaluate(best.unknowns + way * step, True) for way in (1, -1)]
        up, down = (fit.blocks.gradient(e.residual, e.jacobian) for e in ends)
        expected = near.sizes * (up - down) / 2e-4
        np.testing.assert_allclose(back[:, k], expected, atol=0.02 * np.abs(back).max())


def test_second_order_curvature_from_the_failed_side_is_equal(
    constants_fitted_to_cubic, monkeypatch
):
    fit, best, noise = constants_fitted_to_cubic
    settings = SecondOrderSettings(min_step=5e-5, max_step=5e-5)
    up = second_order_terms(fit, best, noise, settings).hessian_term
    evaluate, sides = fit.evaluate, [True]

    def down_alone(*given):
        sides[0] = not sides[0]
        return evaluate(*given) if sides[0] else None

    monkeypatch.setattr(fit, "evaluate", down_alone)
    down = second_order_terms(fit, best, noise, settings).hessian_term
    assert down == pytest.approx(up, abs=0.02 * np.abs(up).max())


def test_directions_side_by_side_give_the_second_order_of_one_after_the_other(
    constants_fitted_to_cubic,
):
    fit, best, noise = constants_fitted_to_cubic

    def terms(processes):
        analyses = fit.analyses
        with may_run_at_once(processes):
            second = second_order_terms(fit, best, noise)
        return second, fit.analyses - analyses

    (alone, analyses), (together, analyses_together) = terms(1), terms(2)
    np.testing.assert_array_equal(together.hessian_term, alone.hessian_term)
    assert analyses_together == analyses == alone.analyses == together.analyses == 3


def test_second_order_is_used_where_definite_and_not_negligible(
    constants_fitted_to_cubic, monkeypatch
):
    fit, best, _ = constants_fitted_to_cubic
    reached = np.full(3, 0.08)
    law = fit.unknowns.law(LAW, best.unknowns)
    sure = certainty_of_fit(fit, best, law, reached, None)
    assert sure.order is not None and sure.order.used and sure.second is not None
    first = certainty(fit, best, law, reached)
    for name, by in sure.order.change.items():
        assert by > 0.1
        np.testing.assert_allclose(
            sure.linear_sigma[name] / first.linear_sigma[name] - 1, by, rtol=1e-6
        )
    (note,) = sure.order.notes
    assert note.kind == SECOND_ORDER and sure.order.words in note
    assert sure.order.numbers["order"] == 2 and sure.order.analyses <= 8

    def given(share):
        def second(fit, best, noise):
            linear = LinearisedFit.of(fit, best, noise)
            added = -share * (linear.sharp * linear.curvature) @ linear.sharp.T
            return SecondOrderTerms(added, np.zeros(len(best.residual)), 3, 3)

        monkeypatch.setattr(fit_certainty, "second_order_terms", second)

    given(0.99)
    order = certainty_of_fit(fit, best, law, reached, None).order
    assert (order.used, order.reason) == (False, NOT_DEFINITE) and len(order.notes) == 1
    given(0.02)
    kept = certainty_of_fit(fit, best, law, reached, None)
    assert (kept.order.used, kept.order.reason, kept.order.notes) == (False, TOO_LITTLE, [])
    assert kept.order.change["E1"] == pytest.approx(1 / 0.98 - 1, rel=1e-6)
    np.testing.assert_array_equal(kept.sigma["E1"], first.sigma["E1"])


def test_second_order_costs_no_analysis_where_only_noise_is_left(monkeypatch):
    fit = bubble_problem(CONSTANT, noise=0.05)
    y = CONSTANT.at(NEAR)
    best = fit.evaluate(y, True)
    assert best is not None
    # As if the model showed just what was measured but for the noise.
    quiet = replace(best, residual=0.05 / fit.scale)
    monkeypatch.setattr(fit_certainty, "second_order_terms", lambda *_: pytest.fail("looked at"))
    law = fit.unknowns.law(LAW, y)
    assert certainty_of_fit(fit, quiet, law, np.full(3, 0.08), None).order is None
    # Or the error of the mesh is all that is left.
    limit = FineMeshLimit(np.zeros_like(y), quiet.residual, np.zeros_like(best.residual))
    assert certainty_of_fit(fit, best, law, np.full(3, 0.08), limit).order is None


INFORMATION_LAW = HypoelasticLaw.linear(300.0, 200.0, 10.0)
INFORMATION_UNKNOWNS = Unknowns.of(
    INFORMATION_LAW.form, 0.24, [0.1] * 3,
    LawBounds.of_moduli({"E1": (1.0, 900.0), "E2": (1.0, 900.0), "G12": (0.1, 90.0)}),
)  # fmt: skip
Y = INFORMATION_UNKNOWNS.at(INFORMATION_LAW.beta[list(INFORMATION_UNKNOWNS.free)])


def test_information_without_nuisance_is_inverse_of_marginal_covariance():
    random = np.random.default_rng(1)
    slopes, sigma = random.standard_normal((40, 5)), random.uniform(0.5, 2.0, 40)
    offsets = (Nuisance("a", -2.0, 2.0, "mm", prior=0.3), Nuisance("b", -1e-2, 1e-2, "kPa"))
    # The second may lie anywhere within ten times the width of its bounds.
    before = np.diag([0.0, 0.0, 0.0, 0.3**-2, 0.2**-2])
    rows = slopes / sigma[:, None]
    whole = np.linalg.inv(rows.T @ rows + before)
    left = information(slopes, sigma, offsets)
    np.testing.assert_allclose(np.linalg.inv(left), whole[:3, :3], rtol=1e-9)
    # And it is less than without nuisance.
    alone = information(slopes[:, :3], sigma)
    np.testing.assert_allclose(alone, rows[:, :3].T @ rows[:, :3], rtol=1e-12)
    assert (np.linalg.eigvalsh(alone - left) > 0).all()


def test_values_explained_by_free_nuisance_carry_no_information():
    slopes = np.column_stack([np.ones(9), np.arange(9.0), np.ones(9)])
    left = information(slopes, 1.0, (Nuisance("offset", -1e6, 1e6, "mm"),))
    assert left[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert left[1, 1] == pytest.approx(60.0)


def test_information_on_a_product_determines_no_factor():
    """Each of G12, E2 and E1 is known to 1000 % before; E1 G12 and E2 are measured."""
    before = Posterior(INFORMATION_UNKNOWNS, Y, Y, np.diag(PRIOR * Y) ** 2)
    slope = np.array([[1 / Y[0], 0.0, 1 / Y[2]]])
    known = information(slope, 1e-3) + np.diag([0.0, (0.01 * Y[1]) ** -2, 0.0])
    sigma = np.sqrt(np.diag(before.with_information(known).covariance)) / Y
    assert sigma == pytest.approx([10 / np.sqrt(2), 0.01, 10 / np.sqrt(2)], rel=1e-4)


def test_prior_weighs_alike_beside_other_priors(tmp_path):
    weights = []
    for unknowns in ("nu12.prior = 0.05", "nu12.prior = 0.05\nthickness.prior = 0.04"):
        problem = fit_setup(project_with_unknowns(tmp_path, unknowns)).problem()
        residual = np.zeros(len(problem.scale))
        noise = Noise.from_residual(problem, residual)
        weight = weights_of(problem, residual, noise)
        weights.append(weight[problem.rows(2).stop] / weight[0])
    assert weights[0] == pytest.approx(weights[1])
