"""inference/bounded_step.py: steps of quadratic programmes within the bounds of the unknowns."""

from dataclasses import replace

import numpy as np
import pytest
import scipy
from bubblefit.inference.bounded_step import bounded_step

from .cases import CUBIC, LAW

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
