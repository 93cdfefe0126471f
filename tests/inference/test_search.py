"""inference/search.py: the membrane leads a fit with another solver."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.reported import moduli_error
from bubblefit.inference.search import fit_from
from bubblefit.inference.starts import feasible_start
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CUBIC, LAW, MODEL, Thicker, one_comparison_problem, targets


def led_by_membrane(solver):
    fields = solver.membrane.run(replace(MODEL, thickness=1.02 * MODEL.thickness), LAW)
    fit = one_comparison_problem(
        MODEL, solver, LAW, FieldObjective(targets(fields.displacement)), CUBIC
    )
    fit.surrogate = fit.with_solvers([MembraneSolver()])
    return fit


@pytest.mark.parametrize("number", range(3))
def test_membrane_leads_another_solver_in_few_runs(number):
    fit = led_by_membrane(Thicker())
    heard = []
    fit.watch = lambda y, value, status, solver: heard.append((solver, value))
    optimum = fit_from(fit, feasible_start(fit, 1, number), FitOptions())
    assert optimum.status == "converged" and optimum.value < 1e-7
    assert optimum.runs == fit.solver.runs == len(heard) <= 7
    errors = [value for _, value in heard]
    assert errors[2] < 1e-3 and errors[3] < 1e-4
    law = LAW.with_beta(CUBIC.beta(optimum.best.unknowns))
    assert max(moduli_error(law, LAW, np.full(3, 0.1)).values()) < 1e-5
    assert fit.surrogate.comparisons[0].objective is fit.comparisons[0].objective


def test_correction_settles_at_rounding_of_the_solver():
    fit = led_by_membrane(Thicker(digits=4))
    rounding = fit.evaluate(CUBIC.at(LAW.beta), False).value
    fit.reset()
    optimum = fit_from(fit, feasible_start(fit, 1, 0), FitOptions())
    assert optimum.status == "settled" and optimum.value < 1.5 * rounding and optimum.runs <= 6


def test_correction_shortens_the_step_after_a_failed_run():
    fit = led_by_membrane(Thicker(fails=(2,)))
    told = []
    fit.watch = lambda y, value, status, solver: told.append(value)
    optimum = fit_from(fit, feasible_start(fit, 1, 0), FitOptions())
    assert told[1] is None and optimum.value < 1e-6


def test_correction_goes_on_after_a_failed_first_run():
    at_first = led_by_membrane(Thicker(fails=(1,)))
    assert fit_from(at_first, feasible_start(at_first, 1, 0), FitOptions()).value < 1e-6


def test_correction_ends_after_four_failed_runs():
    never = led_by_membrane(Thicker(fails=tuple(range(1, 20))))
    assert fit_from(never, feasible_start(never, 1, 0), FitOptions()) is None
    assert never.solver.runs == 4


def test_correction_never_returns_an_unstable_run():
    fit = led_by_membrane(Thicker(unstable_from=2))
    heard = []
    fit.watch = lambda y, value, status, solver: heard.append((value, status))
    optimum = fit_from(fit, feasible_start(fit, 1, 0), FitOptions())
    assert [status for _, status in heard[:2]] == ["ok", "unstable equilibrium at 300 kPa"]
    assert min(value for value, _ in heard[1:]) < heard[0][0]
    assert optimum.best.stable and optimum.value == heard[0][0]


def test_correction_returns_best_run_when_runs_are_used_up():
    fit = led_by_membrane(Thicker())
    start = feasible_start(fit, 1, 0)
    optimum = fit_from(fit, start, FitOptions(max_runs=2))
    assert optimum.status == "runs used up" and optimum.runs == 2 and 1e-4 < optimum.value < 1e-2


def test_nlopt_takes_differences_of_a_solver_without_derivatives():
    fit = led_by_membrane(Thicker())
    start = feasible_start(fit, 1, 0)
    # NLopt takes differences where there are no derivatives.
    optimum = fit_from(fit, start, FitOptions("slsqp", max_analyses=150))
    assert optimum.value < 0.5 * fit.evaluate(start, False).value
