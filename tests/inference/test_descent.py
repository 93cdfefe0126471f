"""inference/descent.py: steps with curvature of the residuals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy
from bubblefit.inference import descent
from bubblefit.inference.descent import DescentSettings, bounded_step, descend
from bubblefit.inference.objective import Blocks
from bubblefit.inference.problem import Evaluation

from .cases import CUBIC, LAW

PRECISE = DescentSettings(negligible_decrease=1e-12)


class BrownAndDennis:
    """Their function (J. J. More and others, ACM Trans. Math. Softw. 7 (1981) 17, no. 16).

    20 residuals of four unknowns of which much is left, in two blocks; bounds are far.
    """

    start = np.array([25.0, 5.0, -5.0, -1.0])

    def __init__(self):
        self.blocks, self.analyses = Blocks([10, 10]), 0
        wide = np.vstack([np.eye(4), -np.eye(4)]), np.full(8, -1e6)
        self.unknowns = SimpleNamespace(inequalities=wide, within_work=lambda y: True)

    def evaluate(self, y, with_jacobian):
        self.analyses += 1
        t = np.arange(1, 21) / 5
        a, b = y[0] + y[1] * t - np.exp(t), y[2] + y[3] * np.sin(t) - np.cos(t)
        slopes = 2 * np.column_stack([a, a * t, b, b * np.sin(t)])
        r = a**2 + b**2
        return Evaluation(y, y, r, self.blocks.value(r), slopes, ())


@pytest.mark.parametrize(
    ("norms", "most"), [pytest.param(False, 40, id="squares"), pytest.param(True, 40, id="norms")]
)
def test_descent_with_curvature_reaches_published_minimum_of_brown_and_dennis(
    monkeypatch, norms, most
):
    """Published is the least sum of squares, 85822.2; the least of the norms is Nelder-Mead's."""
    least = [85822.2, 394.155168][norms]
    for without in (False, True):
        if without:
            monkeypatch.setattr(descent, "_is_positive_definite", lambda matrix: False)
        own = BrownAndDennis()
        point = own.evaluate(own.start, True)
        end, _ = descend(own, point, 1e-9, 200, norms, settings=PRECISE)
        value = end.value if norms else np.sum(end.residual**2)
        assert (value > 2 * least) if without else (value == pytest.approx(least, rel=1e-6))
        assert (own.analyses == 200) if without else (own.analyses < most)


def test_blocks_below_their_least_norm_are_fitted_by_squares():
    """Norms alone would fit the three values of the second block, and their noise, exactly."""

    class Lines(BrownAndDennis):
        start = np.array([0.0, 0.0, 0.0])

        def __init__(self, least_norms):
            self.blocks, self.analyses = Blocks([20, 3], least_norms), 0
            wide = np.vstack([np.eye(3), -np.eye(3)]), np.full(6, -1e6)
            self.unknowns = SimpleNamespace(inequalities=wide, within_work=lambda y: True)
            random = np.random.default_rng(3)
            self.slopes = random.standard_normal((23, 3))
            self.sigma = np.r_[np.full(20, 0.1), np.full(3, 0.02)]
            self.values = self.sigma * random.standard_normal(23)

        def evaluate(self, y, with_jacobian):
            self.analyses += 1
            r = self.slopes @ y - self.values
            return Evaluation(y, y, r, self.blocks.value(r), self.slopes, ())

    variances = np.array([0.1, 0.02]) ** 2
    weighted = Lines(1e3 * variances)
    point = weighted.evaluate(weighted.start, True)
    end, _ = descend(weighted, point, 1e-9, 200, norms=True, settings=PRECISE)
    slopes, values = (a.T / weighted.sigma for a in (weighted.slopes, weighted.values))
    expected = np.linalg.lstsq(slopes.T, values, rcond=None)[0]
    np.testing.assert_allclose(end.unknowns, expected, atol=1e-6)
    by_norms = Lines(None)
    end, _ = descend(by_norms, by_norms.evaluate(point.unknowns, True), 1e-9, 200, norms=True)
    assert by_norms.blocks.norms(end.residual)[1] < 1e-4
    # Above its least a norm counts itself, with the same value and slope where both meet.
    residual = np.r_[np.full(20, 1.0), np.full(3, 0.01)]
    blocks = Blocks([20, 3], np.array([1.0, 0.1]))
    norms = blocks.norms(residual)
    assert blocks.merit(residual) == pytest.approx(norms[0] + norms[1] ** 2 / 0.2 + 0.05)


def test_secant_update_gives_back_change_of_slopes():
    """It gives back the change of the slopes along the step, and an exact one stays."""
    random = np.random.default_rng(0)
    own = random.standard_normal((4, 4))
    own, step, change = own + own.T, random.standard_normal(4), random.standard_normal(4)
    change *= np.sign(change @ step)
    turned = random.standard_normal(4)
    found = descent._secant_update(own, step, turned, change)
    assert found @ step == pytest.approx(turned)
    assert found == pytest.approx(found.T)
    assert descent._secant_update(found, step, turned, change) == pytest.approx(found)
    assert (descent._secant_update(own, step, turned, -change) == own).all()  # that is no curvature


Y = CUBIC.at(LAW.beta)
RANDOM = np.random.default_rng(0)
ROOT = RANDOM.standard_normal((len(Y), len(Y))) / Y
HESSIAN = ROOT.T @ ROOT + np.diag(0.1 / Y**2)


def value(step, gradient):
    return gradient @ step + 0.5 * step @ HESSIAN @ step


def test_step_without_a_bound_in_its_way_is_newtons():
    newton = -1e-3 * Y
    step = bounded_step(CUBIC, HESSIAN, -HESSIAN @ newton, Y)
    np.testing.assert_allclose(step, newton, rtol=1e-6)


def test_step_against_bounds_is_the_minimum_that_scipy_finds():
    gradient = HESSIAN @ (3.0 * Y)  # towards moduli below zero
    step = bounded_step(CUBIC, HESSIAN, gradient, Y)
    rows, limits = CUBIC.inequalities
    assert (rows @ (Y + step) - limits).min() > -1e-6
    bound = scipy.optimize.LinearConstraint(rows * Y, limits - rows @ Y, np.inf)
    known = scipy.optimize.minimize(
        lambda share: value(share * Y, gradient),
        np.zeros(len(Y)),
        jac=lambda share: Y * (gradient + HESSIAN @ (share * Y)),
        constraints=bound,
        method="trust-constr",
        options={"maxiter": 2000, "gtol": 1e-9, "xtol": 1e-12},
    )
    assert value(step, gradient) == pytest.approx(known.fun, rel=1e-4)


def test_equation_and_further_inequality_are_kept():
    first = np.eye(len(Y))[0]
    last = np.eye(len(Y))[-1]
    gradient = HESSIAN @ (0.5 * Y)
    step = bounded_step(CUBIC, HESSIAN, gradient, Y, [(last, 0.98 * Y[-1])], (first, 0.99 * Y[0]))
    assert (Y + step)[0] == pytest.approx(0.99 * Y[0], rel=1e-9)
    assert (Y + step)[-1] >= 0.98 * Y[-1] - 1e-9
    free = bounded_step(CUBIC, HESSIAN, gradient, Y)
    assert (Y + free)[-1] < 0.97 * Y[-1] and abs((Y + free)[0] / Y[0] - 0.99) > 0.01


def test_programme_without_a_solution_gives_none():
    first = np.eye(len(Y))[0]
    cuts = [(first, 0.9 * Y[0])]
    plane = first, 0.8 * Y[0]
    assert bounded_step(CUBIC, HESSIAN, np.zeros(len(Y)), Y, cuts, plane) is None


def test_work_of_a_closed_path_is_kept_by_the_step():
    largest = 1.01 * np.abs(CUBIC.work(Y)).max()
    unknowns = replace(CUBIC, bounds=replace(CUBIC.bounds, work=largest))
    slope = (unknowns.work(1.001 * Y) - unknowns.work(Y)).ravel()
    assert np.any(slope != 0)
    for direction in (-1.0, 1.0):
        gradient = direction * HESSIAN @ (0.3 * RANDOM.standard_normal(len(Y)) * Y)
        step = bounded_step(unknowns, HESSIAN, gradient, Y)
        assert step is not None and unknowns.within_work(Y + step)
