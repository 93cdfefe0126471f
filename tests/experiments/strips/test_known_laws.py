"""Fits to loads that a law gave, alone and beside a bubble, find the law."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.inference.assessment import moduli_error
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.search import feasible_start, fit_from
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...inference.cases import levenberg_marquardt
from .problems import (
    BUBBLE,
    CUBIC,
    FORMS,
    LAW,
    SHIFTED,
    TIGHT,
    found_beta,
    gauge_strains,
    joint,
    near,
    strips,
)


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("form", FORMS)
def test_strips_find_the_law_that_made_them(form: str, number: int) -> None:
    unknowns, law = FORMS[form]
    fit = strips(unknowns, law)
    found = levenberg_marquardt(fit, feasible_start(fit, 2, number), 1e-7, 100)
    assert found is not None and found.value < 1e-5, found
    error = moduli_error(law.with_beta(unknowns.beta(found.best.unknowns)), law,
                         gauge_strains(fit))  # fmt: skip
    assert max(error.values()) < 1e-4, error


@pytest.mark.parametrize("number", range(3))
def test_bubble_and_strips_find_the_law_that_made_them(number: int) -> None:
    fit = joint()
    found = levenberg_marquardt(fit, feasible_start(fit, 2, number), 1e-9, 100)
    assert found is not None and found.value < 1e-7, found
    error = moduli_error(LAW.with_beta(found_beta(found)), LAW, gauge_strains(fit))
    assert max(error.values()) < 1e-4, error


def test_offsets_of_the_bubble_are_found_beside_the_strips() -> None:
    fit = joint(SHIFTED)
    shift, offset = np.array([0.2, -0.1, 0.8]), 0.003
    model = BUBBLE.with_parameters({"pressure_offset": offset})
    moved = MembraneSolver(TIGHT).run(model, LAW).displacement + shift
    targets = [FieldTarget(p, u) for p, u in zip(BUBBLE.pressures, moved, strict=True)]
    fit.comparisons[0].objective = FieldObjective(targets, weight=1 / 9)
    found = levenberg_marquardt(fit, near(SHIFTED, LAW, 1.1), 1e-9, 100)
    assert found is not None and found.value < 1e-7
    assert found.best.unknowns[12:] == pytest.approx([*shift, 1e3 * offset], abs=1e-4)


@pytest.mark.parametrize("method, share", [("slsqp", 0.05), ("cobyla", 1.0)])
def test_other_methods_go_down_on_strips(method: str, share: float) -> None:
    fit = strips()
    start = feasible_start(fit, 2, 0)
    first = fit.evaluate(start, False).value
    found = fit_from(fit, start, FitOptions(method, max_analyses=fit.analyses + 100))
    assert found is not None and found.value < share * first


def test_a_warm_start_changes_nothing() -> None:
    """The same residual on the way, and the same optimum at its end."""
    fit, cold = strips(), strips()
    cold.warm_starts = False
    y = near(CUBIC, LAW)
    fit.evaluate(y, True)
    beside = fit.evaluate(1.002 * y, True)
    alone = cold.evaluate(1.002 * y, True)
    assert beside.residual == pytest.approx(alone.residual, rel=1e-5, abs=1e-4)
    noisy, again = strips(noise=20.0), strips(noise=20.0)
    again.warm_starts = False
    start = near(CUBIC, LAW, 1.2)
    found, other = (levenberg_marquardt(f, start, 1e-7, 200) for f in (noisy, again))
    assert found.value == pytest.approx(other.value, rel=1e-6)
    assert found.coefficients == pytest.approx(other.coefficients, rel=1e-2)
