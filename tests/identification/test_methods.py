"""Optimisers by name: what holds for all of them, and how one is added."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.inference.methods import METHODS
from bubblefit.inference.methods.base import FitOptions
from bubblefit.inference.problem import FitProblem, Optimum
from bubblefit.inference.search import feasible_start, fit_from
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CUBIC, LAW, Failing, problem, reference


def test_methods_by_name() -> None:
    fit = problem()
    start = fit.unknowns.at(LAW.beta * 1.001)
    for method in METHODS:
        optimum = fit_from(fit, start, FitOptions(method, max_analyses=fit.analyses + 5))
        assert optimum is not None and np.isfinite(optimum.value)
    with pytest.raises(InputError, match="lm, slsqp, cobyla"):
        fit_from(fit, start, FitOptions("powell"))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("how", ["failure", "nan"])
def test_a_start_whose_analysis_fails_gives_none(method: str, how: str) -> None:
    fit = problem()
    fit.comparisons[0].solver = Failing(lambda run: True, how)
    assert fit_from(fit, CUBIC.at(LAW.beta), FitOptions(method)) is None


@pytest.mark.parametrize("method", METHODS)
def test_the_number_of_analyses_is_a_limit(method: str) -> None:
    fit = problem()
    start = feasible_start(fit, 1, 0)
    before = fit.analyses
    optimum = fit_from(fit, start, FitOptions(method, max_analyses=before + 6))
    assert optimum is not None and optimum.analyses == fit.analyses
    assert fit.analyses <= before + 6


class Halving:
    """Towards the first unknowns that fit better, by half a step whenever they do not."""

    name, needs_slope = "halving", False

    def minimise(self, problem: FitProblem, start: np.ndarray, options: FitOptions) -> Any:
        best = problem.evaluate(start, False)
        step = 0.1 * np.random.default_rng(1).standard_normal(len(start))
        while best is not None and problem.analyses < options.max_analyses:
            point = problem.evaluate(best.unknowns + step, False)
            good = point is not None and point.stable and point.value < best.value
            best, step = (point, step) if good else (best, -0.5 * step)
        return None if best is None else Optimum(best, "analyses used up", problem.analyses)


def test_an_optimiser_is_a_class_and_a_line_in_the_registry(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(METHODS, "halving", Halving())
    fit = problem()
    start = feasible_start(fit, 1, 0)
    first = fit.evaluate(start, False).value
    options = FitOptions("halving", max_analyses=fit.analyses + 12)
    optimum = fit_from(fit, start, options)
    assert optimum.value < first and fit.analyses == options.max_analyses
    with pytest.raises(InputError, match="lm, slsqp, cobyla, halving"):
        fit_from(fit, start, FitOptions("powell"))


class Tempting(MembraneSolver):
    """Beyond a border of E1, towards the truth, equilibria are unstable and fit nearly exactly."""

    def __init__(self, border: float, sign: float) -> None:
        super().__init__()
        self.border, self.sign, self.unstable = border, sign, 0

    def _analyse(self, model: Any, law: Any, *others: Any) -> Any:
        history, rates = super()._analyse(model, law, *others)
        if self.sign * (law.E1(0.05) - self.border) < 0:
            return history, rates
        self.unstable += 1
        # Not quite: e must stay above the tolerance, or the fit would end there.
        return replace(
            history, unstable=("300 kPa",), displacement=1.001 * reference().displacement
        ), rates


@pytest.mark.parametrize("constraints", ["margin", "boolean"])
@pytest.mark.parametrize("method", METHODS)
def test_an_unstable_trial_is_never_accepted(method: str, constraints: Any) -> None:
    fit = problem()
    start = feasible_start(fit, 1, 2)
    fit.reset()
    here, truth = LAW.with_beta(CUBIC.beta(start)).E1(0.05), LAW.E1(0.05)
    solver = Tempting(0.9 * here + 0.1 * truth, float(np.sign(truth - here)))
    fit.comparisons[0].solver = solver
    optimum = fit_from(fit, start, FitOptions(method, "exact", constraints, max_analyses=80))
    assert solver.unstable > 0
    assert optimum.best.stable
    again = problem().evaluate(optimum.best.unknowns, False, warm=False)
    assert optimum.value == pytest.approx(again.value, rel=1e-3)
