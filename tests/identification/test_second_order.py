"""Uncertainty to second order: beside the scatter of refits where much is left of the residual."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.linear import (
    NOT_DEFINITE,
    TOO_LITTLE,
    Linear,
    Second,
    definite,
    posteriors_of,
    second_of,
)
from bubblefit.inference.methods.descent import descend
from bubblefit.inference.noise import Noise
from bubblefit.inference.problem import FitProblem
from bubblefit.notes import NoteKind
from bubblefit.runs import best as budget
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CONSTANT, LAW, MODEL, levenberg_marquardt, problem, reference, single, targets

#: mm of noise beside 0.5 mm that constants leave of the fields of cubics.
NOISE, REFITS = 0.02, 40


def noisy(number: int) -> FitProblem:
    """Constants fitted to fields of cubics with noise."""
    random = np.random.default_rng(number)
    fields = reference().displacement
    fields = fields + NOISE * random.standard_normal(fields.shape)
    return single(MODEL, MembraneSolver(), LAW, FieldObjective(targets(fields), "e"), CONSTANT)


@pytest.fixture(scope="module")
def wrong() -> Any:
    """A fit of constants to the fields of cubics: problem, optimum, and the noise that there is."""
    fit = problem(CONSTANT)
    found = levenberg_marquardt(fit, CONSTANT.at(np.array([15.0, 190.0, 330.0])), 1e-9, 60)
    best = fit.evaluate(found.best.unknowns, True)
    assert best is not None
    rows = NOISE / fit.scale
    return fit, best, replace(Noise.of(fit, best.residual), rows=rows, least=rows)


def test_sigma_is_the_scatter_of_refits_of_a_wrong_law(wrong) -> None:
    """The first derivatives alone say a third less."""
    fit, best, noise = wrong
    second = second_of(fit, best, noise)
    assert second.directions == second.analyses == 3
    assert definite(Linear.of(fit, best, noise), second)
    first, whole = (posteriors_of(fit, best, noise, None, s)[0].sigma for s in (None, second))
    found = []
    for number in range(REFITS):
        own = noisy(number)
        point = own.evaluate(best.unknowns, True)
        found.append(descend(own, point, 1e-9, 60, norms=True, damping=1e-6)[0].unknowns)
    scatter = np.std(found, axis=0, ddof=1)
    # Forty refits say it to 11 %.
    assert whole == pytest.approx(scatter, rel=0.25)
    assert (first < 0.75 * scatter).all()


def test_curvature_is_that_of_the_objective(wrong) -> None:
    """Beside differences of the gradient of e itself, along directions of its own."""
    fit, best, noise = wrong
    second = second_of(fit, best, replace(noise, least=0 * noise.least))
    linear = Linear.of(fit, best, replace(noise, least=0 * noise.least))
    back = (linear.sharp * linear.curvature) @ linear.sharp.T + second.added
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-4 * linear.sizes[k]  # the sheet nearly folds: a larger step sees another
        ends = [fit.evaluate(best.unknowns + way * step, True) for way in (1, -1)]
        up, down = (fit.blocks.gradient(e.residual, e.jacobian) for e in ends)
        expected = linear.sizes * (up - down) / 2e-4
        np.testing.assert_allclose(back[:, k], expected, atol=0.02 * np.abs(back).max())


def test_which_order_a_fit_is_of(wrong, monkeypatch: pytest.MonkeyPatch) -> None:
    """Much is left: of second order. What is no minimum, and what changes little, is said."""
    fit, best, _ = wrong
    reached = np.full(3, 0.08)
    law = fit.unknowns.law(LAW, best.unknowns)
    sure = budget._certainty(fit, best, law, reached, None)
    assert sure.order is not None and sure.order.used and sure.second is not None
    first = budget.certainty(fit, best, law, reached)
    for name, by in sure.order.change.items():
        assert by > 0.1
        np.testing.assert_allclose(sure.sigma[name] / first.sigma[name] - 1, by, rtol=1e-6)
    (note,) = sure.order.notes
    assert note.kind == NoteKind.SECOND_ORDER and sure.order.words in note
    assert sure.order.numbers["order"] == 2 and sure.order.analyses <= 8

    def given(share: float) -> None:
        def second(fit: FitProblem, best: Any, noise: Noise) -> Second:
            linear = Linear.of(fit, best, noise)
            added = -share * (linear.sharp * linear.curvature) @ linear.sharp.T
            return Second(added, np.zeros(len(best.residual)), 3, 3)

        monkeypatch.setattr(budget, "second_of", second)

    given(0.99)
    order = budget._certainty(fit, best, law, reached, None).order
    assert (order.used, order.why) == (False, NOT_DEFINITE) and len(order.notes) == 1
    given(0.02)
    kept = budget._certainty(fit, best, law, reached, None)
    assert (kept.order.used, kept.order.why, kept.order.notes) == (False, TOO_LITTLE, [])
    assert kept.order.change["E1"] == pytest.approx(1 / 0.98 - 1, rel=1e-6)
    np.testing.assert_array_equal(kept.sigma["E1"], first.sigma["E1"])


def test_no_analysis_is_spent_where_noise_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    fit = problem(CONSTANT, noise=0.05)
    y = CONSTANT.at(np.array([15.0, 190.0, 330.0]))
    best = fit.evaluate(y, True)
    assert best is not None
    # As if the model showed just what was measured but for the noise.
    quiet = replace(best, residual=0.05 / fit.scale)
    monkeypatch.setattr(budget, "second_of", lambda *_: pytest.fail("looked at"))
    law = fit.unknowns.law(LAW, y)
    assert budget._certainty(fit, quiet, law, np.full(3, 0.08), None).order is None
