"""SLSQP and COBYLA: what they see, and what they may end with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import nlopt
import numpy as np
import pytest
from bubblefit.inference.methods.base import FitOptions
from bubblefit.inference.search import feasible_start, fit_from

from .cases import CUBIC, Failing, problem


@pytest.mark.parametrize("number", [0, 1])
def test_slsqp_with_exact_gradient_and_margin(number: int) -> None:
    fit = problem()
    options = FitOptions("slsqp", max_analyses=600)
    optimum = fit_from(fit, feasible_start(fit, 1, number), options)
    assert optimum is not None and optimum.value < 1e-5
    a, c = CUBIC.inequalities
    assert (a @ optimum.best.unknowns >= c - 1e-7).all()


@pytest.mark.parametrize("constraints", ["margin", "boolean"])
@pytest.mark.parametrize("algorithm", ["cobyla", "slsqp"])
def test_nlopt_never_ends_worse_than_it_began(algorithm: Any, constraints: Any) -> None:
    fit = problem()
    start = feasible_start(fit, 1, 2)
    first = fit.evaluate(start, False).value
    options = FitOptions(algorithm, "exact", constraints, max_analyses=fit.analyses + 80)
    optimum = fit_from(fit, start, options)
    assert optimum is not None and optimum.value <= first
    assert optimum.analyses <= fit.analyses
    assert CUBIC.is_positive(optimum.coefficients)
    a, c = CUBIC.inequalities
    assert (a @ optimum.best.unknowns >= c - 1e-7).all()
    assert fit.evaluate(optimum.best.unknowns, False, warm=False).value == pytest.approx(
        optimum.value, rel=1e-4
    )


def test_differences_and_flags_improve_on_its_start() -> None:
    """Finite differences and boolean flags: published optima lay between 0.1 and 3."""
    fit = problem()
    start = feasible_start(fit, 1, 0)
    first = fit.evaluate(start, False).value
    options = FitOptions("slsqp", "differences", "boolean", max_analyses=150)
    optimum = fit_from(fit, start, options)
    assert optimum is not None and optimum.value < 0.8 * first


@pytest.mark.parametrize("how", ["failure", "nan"])
@pytest.mark.parametrize("algorithm", ["slsqp", "cobyla"])
@pytest.mark.parametrize("constraints", ["margin", "boolean"])
def test_nlopt_sees_only_finite_numbers(
    monkeypatch: pytest.MonkeyPatch, how: str, algorithm: Any, constraints: Any
) -> None:
    seen: list[np.ndarray] = []

    class Listening(nlopt.opt):
        def set_min_objective(self, f: Callable) -> None:
            def heard(x: np.ndarray, gradient: np.ndarray) -> float:
                value = f(x, gradient)
                seen.append(np.array([value, *gradient, *x]))
                return value

            super().set_min_objective(heard)

    monkeypatch.setattr(nlopt, "opt", Listening)
    fit = problem()
    start = feasible_start(fit, 1, 1)
    fit.comparisons[0].solver = Failing(lambda run: run > 1 and run % 3 == 0, how)
    limit = fit.analyses + 60
    options = FitOptions(algorithm, "exact", constraints, max_analyses=limit)
    optimum = fit_from(fit, start, options)
    assert seen and all(np.isfinite(values).all() for values in seen)
    assert optimum is not None and np.isfinite(optimum.value)
    assert fit.analyses <= limit
