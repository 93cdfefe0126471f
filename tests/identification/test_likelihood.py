"""Profile likelihood of a bubble: beside a search over the other unknowns, and its failures."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference.likelihood import FAILED, THRESHOLD, extreme, modulus_row, profile_side
from bubblefit.inference.linear import Linear, posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.problem import WeightedProblem
from scipy.optimize import minimize

from .cases import CONSTANT, EVERYTHING, levenberg_marquardt, problem

#: mm: so much that G12 is off its first order.
NOISE = 0.3


@pytest.fixture(scope="module")
def bubble():
    """A fit of constants to noisy fields: problem, optimum, and the fit to first order."""
    fit = problem(CONSTANT, noise=NOISE)
    found = levenberg_marquardt(fit, CONSTANT.at(np.array([15.0, 190.0, 330.0])), 1e-9, 60)
    return fit, found.best, Noise.of(fit, found.best.residual)


def test_a_profile_is_the_least_over_the_other_unknowns(bubble) -> None:
    fit, best, noise = bubble
    linear = Linear.of(fit, best, noise)
    row = modulus_row(fit.unknowns, "G12", 0.0)
    assert row @ best.unknowns == pytest.approx(best.coefficients[0])
    own = WeightedProblem.of(fit, linear.weights / np.sqrt(linear.spread_over_curvature(row)))
    posterior, _ = posteriors_of(fit, best, noise)
    sigma = float(np.sqrt(row @ posterior.covariance @ row))
    side = profile_side(own, own.seen(best), row, 1.0, sigma)
    assert side.why == "" and side.ratios[-1] >= THRESHOLD > side.ratios[-2]
    # Few analyses a place, and the objective of the fit itself is left as it was.
    assert side.analyses <= 3 * len(side.values)
    assert fit.evaluate(best.unknowns, False).value == pytest.approx(best.value, rel=1e-9)

    value, ratio = side.values[3], side.ratios[3]
    held = value / row[0]

    def squares(others: np.ndarray) -> float:
        point = own.evaluate(np.array([held, *others]), False)
        return np.inf if point is None else float(point.residual @ point.residual)

    start = best.unknowns[1:]
    found = minimize(squares, start, method="Nelder-Mead",
                     options={"xatol": 1e-5, "fatol": 1e-3, "maxfev": 60})  # fmt: skip
    seen = own.seen(best).residual
    assert found.fun - seen @ seen == pytest.approx(ratio, abs=0.03)


def test_bounds_of_a_modulus(bubble) -> None:
    unknowns = bubble[0].unknowns
    row = modulus_row(unknowns, "E1", 0.05)
    assert extreme(unknowns, row, -1.0) == pytest.approx(50.0, rel=1e-6)
    assert extreme(unknowns, row, 1.0) == pytest.approx(1500.0, rel=1e-6)
    # Nuisance is no part of a modulus.
    whole = modulus_row(EVERYTHING, "G12", 0.02)
    assert len(whole) == EVERYTHING.count and not whole[EVERYTHING.size :].any()


def test_a_side_ends_where_no_analysis_does(bubble, monkeypatch) -> None:
    fit, best, noise = bubble
    linear = Linear.of(fit, best, noise)
    row = modulus_row(fit.unknowns, "E1", 0.0)
    own = WeightedProblem.of(fit, linear.weights)
    whole, start = own.evaluate, float(row @ best.unknowns)
    sigma = 0.02 * start

    def fails(y: np.ndarray, *rest: bool):
        return None if row @ y > start + 0.7 * sigma else whole(y, *rest)

    monkeypatch.setattr(own, "evaluate", fails)
    side = profile_side(own, own.seen(best), row, 1.0, sigma)
    assert side.why == FAILED and side.end is None
    assert start + 0.5 * sigma <= side.values[-1] <= start + 0.7 * sigma
