"""inference/methods: optimisers found by name, their limits, no unstable trial accepted."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.inference import methods
from bubblefit.inference.methods import FitOptions, lm, method_names
from bubblefit.inference.search import feasible_start, fit_from
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.refusals import complaint
from .cases import CUBIC, LAW, Failing, bubble_problem, reference


@pytest.mark.parametrize("method", method_names())
def test_methods_keep_the_limit_of_analyses_and_return_none_after_failures(method):
    fit = bubble_problem()
    start = feasible_start(fit, 1, 0)
    before = fit.analyses
    optimum = fit_from(fit, start, FitOptions(method, max_analyses=before + 6))
    assert np.isfinite(optimum.value) and optimum.analyses == fit.analyses <= before + 6
    for how in ("failure", "nan"):
        fit.comparisons[0].solver = Failing(lambda run: True, how)
        assert fit_from(fit, CUBIC.at(LAW.beta), FitOptions(method)) is None


def test_methods_are_found_by_name_of_their_module(monkeypatch):
    names = (*method_names(), "own")
    monkeypatch.setattr(methods, "method_names", lambda: names)
    module = SimpleNamespace(METHOD=lm.LevenbergMarquardt())
    monkeypatch.setitem(sys.modules, "bubblefit.inference.methods.own", module)
    fit = bubble_problem()
    start = feasible_start(fit, 1, 0)
    first = fit.evaluate(start, False).value
    options = FitOptions("own", max_analyses=fit.analyses + 12)
    optimum = fit_from(fit, start, options)
    assert optimum.value < first and fit.analyses == options.max_analyses
    assert "lm, cobyla, slsqp, own" in complaint(fit_from, fit, start, FitOptions("powell"))


class Tempting(MembraneSolver):
    """Beyond a border of E1, towards the truth, equilibria are unstable and fit nearly exactly."""

    def __init__(self, border, sign):
        super().__init__()
        self.border, self.sign, self.unstable = border, sign, 0

    def _analyse(self, model, law, *others):
        history, rates = super()._analyse(model, law, *others)
        if self.sign * (law.E1(0.05) - self.border) < 0:
            return history, rates
        self.unstable += 1
        # Not quite: e must stay above the tolerance, or the fit would end there.
        return replace(
            history, unstable=("300 kPa",), displacement=1.001 * reference().displacement
        ), rates


@pytest.mark.parametrize("constraints", ["margin", "boolean"])
@pytest.mark.parametrize("method", method_names())
def test_unstable_trial_is_never_accepted(method, constraints):
    fit = bubble_problem()
    start = feasible_start(fit, 1, 2)
    fit.reset()
    here, truth = LAW.with_beta(CUBIC.beta(start)).E1(0.05), LAW.E1(0.05)
    solver = Tempting(0.9 * here + 0.1 * truth, float(np.sign(truth - here)))
    fit.comparisons[0].solver = solver
    optimum = fit_from(fit, start, FitOptions(method, "exact", constraints, max_analyses=80))
    assert solver.unstable > 0
    assert optimum.best.stable
    again = bubble_problem().evaluate(optimum.best.unknowns, False, warm=False)
    assert optimum.value == pytest.approx(again.value, rel=1e-3)
