"""inference/mesh_limit.py: the optimum in the limit of ever finer meshes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.inference.mesh_limit import limit_of, residual_of

from .cases import CONSTANT, bubble_problem


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
