"""inference/likelihood.py: profiles of a modulus."""

import numpy as np
import pytest
from bubblefit.inference.likelihood import FAILED, THRESHOLD, profile_side
from bubblefit.inference.linear import LinearisedFit, posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.problem import WeightedProblem
from scipy.optimize import minimize

from .cases import CONSTANT, NEAR, bubble_problem, fitted_by_lm

#: mm: so much that G12 is off its first order.
NOISE = 0.3


@pytest.fixture(scope="module")
def noisy_constants():
    """A fit of constants to noisy fields: problem, optimum, and the fit to first order."""
    fit = bubble_problem(CONSTANT, noise=NOISE)
    found = fitted_by_lm(fit, CONSTANT.at(NEAR), 1e-9, 60)
    return fit, found.best, Noise.from_residual(fit, found.best.residual)


def test_profile_is_the_minimum_over_the_remaining_unknowns(noisy_constants):
    fit, best, noise = noisy_constants
    linear = LinearisedFit.of(fit, best, noise)
    row = fit.unknowns.modulus_row("G12", 0.0)
    assert row @ best.unknowns == pytest.approx(best.coefficients[0])
    own = WeightedProblem.of(fit, linear.weights / np.sqrt(linear.spread_over_curvature(row)))
    posterior, _ = posteriors_of(fit, best, noise)
    sigma = float(np.sqrt(row @ posterior.covariance @ row))
    side = profile_side(own, own.weighted(best), row, 1.0, sigma)
    assert side.reason == "" and side.ratios[-1] >= THRESHOLD > side.ratios[-2]
    # Few analyses a place, and the objective of the fit itself is left as it was.
    assert side.analyses <= 3 * len(side.values)
    assert fit.evaluate(best.unknowns, False).value == pytest.approx(best.value, rel=1e-9)

    value, ratio = side.values[3], side.ratios[3]
    held = value / row[0]

    def squares(others):
        point = own.evaluate(np.array([held, *others]), False)
        return np.inf if point is None else float(point.residual @ point.residual)

    found = minimize(squares, best.unknowns[1:], method="Nelder-Mead",
                     options={"xatol": 1e-5, "fatol": 1e-3, "maxfev": 60})  # fmt: skip
    seen = own.weighted(best).residual
    assert found.fun - seen @ seen == pytest.approx(ratio, abs=0.03)


def test_profile_side_ends_where_analyses_fail(noisy_constants, monkeypatch):
    fit, best, noise = noisy_constants
    linear = LinearisedFit.of(fit, best, noise)
    row = fit.unknowns.modulus_row("E1", 0.0)
    own = WeightedProblem.of(fit, linear.weights)
    whole, start = own.evaluate, float(row @ best.unknowns)
    sigma = 0.02 * start

    def fails(y, *rest):
        return None if row @ y > start + 0.7 * sigma else whole(y, *rest)

    monkeypatch.setattr(own, "evaluate", fails)
    side = profile_side(own, own.weighted(best), row, 1.0, sigma)
    assert side.reason == FAILED and side.end is None
    assert start + 0.5 * sigma <= side.values[-1] <= start + 0.7 * sigma
