"""Strips run by a solver without derivatives, and analyses that fail."""

from __future__ import annotations

from typing import Any

import pytest
from bubblefit.inference.assessment import moduli_error
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.search import feasible_start, fit_from

from ...inference.cases import levenberg_marquardt
from .problems import CUBIC, LAW, Failing, found_beta, gauge_strains, joint, led, near, strips


@pytest.mark.parametrize("build", [strips, joint], ids=["strips", "joint"])
def test_the_membrane_leads_another_solver_of_strips(build: Any) -> None:
    fit = led(build())
    originals = [e.objective for e in fit.surrogate.comparisons]
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found is not None and found.value < 1e-5 and found.runs <= 8
    assert {e.solver.runs for e in fit.comparisons} == {found.runs}
    error = moduli_error(LAW.with_beta(found_beta(found)), LAW, gauge_strains(fit))
    assert max(error.values()) < 1e-3, error
    assert [e.objective for e in fit.surrogate.comparisons] == originals


def test_a_failed_run_of_a_strip_shortens_the_step() -> None:
    fit = led(strips(), fails=(2,))
    told: list[tuple[float | None, str]] = []
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert told[1] == (None, "warp: on purpose") and found.value < 1e-3 * told[0][0]


@pytest.mark.parametrize("number", range(4))
def test_a_test_that_fails_is_named_and_the_point_is_refused(number: int) -> None:
    fit = joint()
    told: list[tuple[float | None, str]] = []
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    fit.comparisons[number].solver = Failing([1])
    y = near(CUBIC, LAW)
    assert fit.evaluate(y, True) is None
    assert told == [(None, f"{fit.comparisons[number].name}: on purpose")]
    assert fit.evaluate(y, True) is not None and fit.analyses == 2


def test_a_single_strip_needs_no_name_in_its_failure() -> None:
    whole = strips()
    fit = FitProblem(whole.comparisons[:1], LAW, CUBIC)
    told: list[str] = []
    fit.watch = lambda y, value, status, solver: told.append(status)
    fit.comparisons[0].solver = Failing([1])
    fit.evaluate(near(CUBIC, LAW), False)
    assert told == ["on purpose"]


def test_a_fit_steps_round_strips_that_fail() -> None:
    fit = strips()
    fit.comparisons[2].solver = Failing([3, 5, 6])
    found = levenberg_marquardt(fit, feasible_start(strips(), 2, 0), 1e-7, 150)
    assert found is not None and found.value < 1e-5
