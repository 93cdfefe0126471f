"""A solver without derivatives, led by the membrane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.assessment import moduli_error
from bubblefit.inference.methods.base import FitOptions
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.search import feasible_start, fit_from
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.solvers.base import History, SolverCheck
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CUBIC, LAW, MODEL, single, targets


class Thicker:
    """Stands for another finite element program: 2 % thicker, rounded to `digits`, no slopes.

    fails : numbers of the runs that do. unstable_from : the first whose equilibrium is not stable.
    """

    name, external, progress, identity = "thicker", True, None, "thicker"

    def __init__(
        self, digits: int = 12, fails: tuple[int, ...] = (), unstable_from: int = 1000
    ) -> None:
        self.digits, self.fails, self.runs = digits, fails, 0
        self.unstable_from = unstable_from
        self.membrane = MembraneSolver()

    def run(self, model: BubbleModel, law: HypoelasticLaw, *unused: object) -> History:
        self.runs += 1
        if self.runs in self.fails:
            raise SolverFailure("on purpose", self.name)
        history = self.membrane.run(replace(model, thickness=1.02 * model.thickness), law)
        displacement = np.round(history.displacement, self.digits)
        return replace(
            history,
            displacement=displacement,
            unstable=() if self.runs < self.unstable_from else ("300 kPa",),
        )

    def check(self) -> SolverCheck:
        return SolverCheck(self.name, True, "1", True)


def led(solver: Thicker) -> FitProblem:
    fields = solver.membrane.run(replace(MODEL, thickness=1.02 * MODEL.thickness), LAW)
    objective = FieldObjective(targets(fields.displacement))
    fit = single(MODEL, solver, LAW, objective, CUBIC)
    fit.surrogate = fit.with_solvers([MembraneSolver()])
    return fit


@pytest.mark.parametrize("number", range(3))
def test_the_membrane_leads_another_solver_in_few_runs(number: int) -> None:
    fit = led(Thicker())
    heard: list[tuple[str, float]] = []
    fit.watch = lambda y, value, status, solver: heard.append((solver, value))
    optimum = fit_from(fit, feasible_start(fit, 1, number), FitOptions())
    assert optimum is not None and optimum.status == "converged" and optimum.value < 1e-7
    assert optimum.runs == fit.solver.runs == len(heard) <= 7
    errors = [value for _, value in heard]
    assert errors[2] < 1e-3 and errors[3] < 1e-4
    law = LAW.with_beta(CUBIC.beta(optimum.best.unknowns))
    assert max(moduli_error(law, LAW, np.full(3, 0.1)).values()) < 1e-5
    assert fit.surrogate.comparisons[0].objective is fit.comparisons[0].objective


def test_a_rounded_solver_settles_at_its_rounding() -> None:
    fit = led(Thicker(digits=4))
    rounding = fit.evaluate(CUBIC.at(LAW.beta), False).value
    fit.reset()
    optimum = fit_from(fit, feasible_start(fit, 1, 0), FitOptions())
    assert optimum.status == "settled" and optimum.value < 1.5 * rounding and optimum.runs <= 6


def test_a_failed_run_shortens_the_step_and_the_fit_goes_on() -> None:
    fit = led(Thicker(fails=(2,)))
    told: list[float | None] = []
    fit.watch = lambda y, value, status, solver: told.append(value)
    optimum = fit_from(fit, feasible_start(fit, 1, 0), FitOptions())
    assert told[1] is None and optimum.value < 1e-6
    at_first = led(Thicker(fails=(1,)))
    assert fit_from(at_first, feasible_start(at_first, 1, 0), FitOptions()).value < 1e-6
    never = led(Thicker(fails=tuple(range(1, 20))))
    assert fit_from(never, feasible_start(never, 1, 0), FitOptions()) is None
    assert never.solver.runs == 4


def test_an_unstable_run_is_never_the_result() -> None:
    """From the second run on equilibria are unstable, and fit better and better."""
    fit = led(Thicker(unstable_from=2))
    heard: list[tuple[float | None, str]] = []
    fit.watch = lambda y, value, status, solver: heard.append((value, status))
    optimum = fit_from(fit, feasible_start(fit, 1, 0), FitOptions())
    assert [status for _, status in heard[:2]] == [
        "ok", "unstable equilibrium at 300 kPa",
    ]  # fmt: skip
    assert min(value for value, _ in heard[1:]) < heard[0][0]
    assert optimum.best.stable and optimum.value == heard[0][0]


def test_the_best_run_is_returned_when_runs_are_used_up() -> None:
    fit = led(Thicker())
    optimum = fit_from(fit, feasible_start(fit, 1, 0), FitOptions(max_runs=2))
    assert optimum.status == "runs used up" and optimum.runs == 2 and 1e-4 < optimum.value < 1e-2


def test_nlopt_takes_differences_where_there_are_no_derivatives() -> None:
    fit = led(Thicker())
    start = feasible_start(fit, 1, 0)
    options = FitOptions("slsqp", max_analyses=150)
    optimum = fit_from(fit, start, options)
    assert optimum is not None and optimum.value < 0.5 * fit.evaluate(start, False).value
