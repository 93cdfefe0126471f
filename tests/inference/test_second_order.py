"""inference/second_order.py: uncertainty to second order where a large residual is left."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.assessment import certainty
from bubblefit.inference.descent import DescentSettings, descend
from bubblefit.inference.linear import LinearisedFit, SecondOrderTerms, posteriors_of
from bubblefit.inference.mesh_limit import FineMeshLimit
from bubblefit.inference.noise import Noise
from bubblefit.inference.second_order import (
    NOT_DEFINITE,
    SECOND_ORDER,
    TOO_LITTLE,
    SecondOrderSettings,
    is_definite,
    second_order_terms,
)
from bubblefit.runs import certainty as fit_certainty
from bubblefit.runs.certainty import certainty_of_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import (
    CONSTANT,
    LAW,
    MODEL,
    NEAR,
    bubble_problem,
    fitted_by_lm,
    one_comparison_problem,
    reference,
    targets,
)

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
