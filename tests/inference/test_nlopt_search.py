"""inference/nlopt_search.py: SLSQP and COBYLA of NLopt."""

import nlopt
import numpy as np
import pytest
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.search import allowed, feasible_start, fit_from

from .cases import CUBIC, Failing, bubble_problem


def test_slsqp_with_differences_and_flags_improves_on_its_start():
    """Finite differences and boolean flags: published optima lay between 0.1 and 3."""
    fit = bubble_problem()
    start = feasible_start(fit, 1, 0)
    options = FitOptions("slsqp", "differences", "boolean", max_analyses=150)
    assert fit_from(fit, start, options).value < 0.8 * fit.evaluate(start, False).value


@pytest.mark.parametrize("how", ["", "failure", "nan"])
@pytest.mark.parametrize("algorithm", ["slsqp", "cobyla"])
@pytest.mark.parametrize("constraints", ["margin", "boolean"])
def test_nlopt_sees_finite_numbers_and_ends_no_worse_than_its_start(
    monkeypatch, how, algorithm, constraints
):
    seen = []

    class Listening(nlopt.opt):
        def set_min_objective(self, f):
            def heard(x, gradient):
                value = f(x, gradient)
                seen.append(np.array([value, *gradient, *x]))
                return value

            super().set_min_objective(heard)

    monkeypatch.setattr(nlopt, "opt", Listening)
    fit = bubble_problem()
    start = feasible_start(fit, 1, 1)
    first = fit.evaluate(start, False).value
    fit.comparisons[0].solver = Failing(lambda run: how and run > 1 and run % 3 == 0, how)
    limit = fit.analyses + 60
    options = FitOptions(algorithm, "exact", constraints, max_analyses=limit)
    optimum = fit_from(fit, start, options)
    assert seen and all(np.isfinite(values).all() for values in seen)
    assert optimum.value <= first and optimum.analyses <= fit.analyses <= limit
    assert allowed(CUBIC, optimum.coefficients[None]).all()
    a, c = CUBIC.inequalities
    assert (a @ optimum.best.unknowns >= c - 1e-7).all()
    again = bubble_problem().evaluate(optimum.best.unknowns, False, warm=False)
    assert again.value == pytest.approx(optimum.value, rel=1e-4)
