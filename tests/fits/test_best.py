"""The best start, run again: by which solver, with which derivatives, and what it may differ by."""

from __future__ import annotations

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.runs.best import best_fit, noise_of, with_certainty


def test_one_analysis_serves_both(together: bf.Fit) -> None:
    """Where the solver that counts differentiates itself."""
    problem = together.setup.problem()
    again = best_fit(problem, together.best.records, 0.0)
    assert again.differentiated is again.point and again.point.jacobian is not None
    sure, known = with_certainty(together.setup, problem, again).certainty, together.best.certainty
    assert again.certainty is None and sure is not None and known is not None
    for name, sigma in sure.sigma.items():
        np.testing.assert_allclose(sigma, known.sigma[name], rtol=1e-12)


def test_a_surrogate_gives_the_derivatives(together: bf.Fit) -> None:
    """Where there is one; without them nothing is said of certainty."""
    problem, surrogate = together.setup.problem(), together.setup.problem()
    problem.surrogate = surrogate
    again = best_fit(problem, together.best.records, 0.0)
    assert again.point.jacobian is None
    assert again.differentiated is not None and again.differentiated.jacobian is not None
    assert with_certainty(together.setup, problem, again).certainty is not None
    surrogate.evaluate = lambda *_, **__: None  # type: ignore[method-assign]
    again = best_fit(problem, together.best.records, 0.0)
    assert again.differentiated is None
    assert with_certainty(together.setup, problem, again) is again


@pytest.mark.parametrize(("external", "tries"), [(True, 2), (False, 1)])
def test_another_program_gets_a_second_try(together: bf.Fit, external: bool, tries: int) -> None:
    problem = together.setup.problem()
    asked: list[bool] = []

    def fail(*_: object, **__: object) -> None:
        asked.append(True)
        problem.failure = "no licence"

    problem.evaluate = fail  # type: ignore[method-assign, assignment]
    problem.solver.external = external  # type: ignore[misc]
    said = "the best fit does not run again: no licence; its starts are kept, --resume goes on"
    with pytest.raises(SolverFailure, match=said):
        best_fit(problem, together.best.records, 0.0)
    assert len(asked) == tries


@pytest.mark.parametrize(("off", "fails"), [(0.9, False), (1.1, True), (-0.9, False), (-1.1, True)])
def test_what_counts_as_the_same_objective(together: bf.Fit, off: float, fails: bool) -> None:
    """1e-5 of it, and a millionth of what the noise adds."""
    problem, first = together.setup.problem(), together.best.ranked[0]
    noise = noise_of(problem)
    assert first.objective is not None
    limit = 1e-5 * first.objective + 1e-6 * sum(noise.values())
    other = replace(first, objective=first.objective + off * limit)
    if fails:
        with pytest.raises(SolverFailure, match="start 0 ended with an objective of"):
            best_fit(problem, [replace(other, number=0)], 0.0)
    else:
        assert best_fit(problem, [other], 0.0).objective == first.objective


def test_noise_is_what_a_perfect_law_leaves(together: bf.Fit) -> None:
    """The scatter over the largest load, weighted: half of the first test, thrice the second."""
    noise = noise_of(together.setup.problem())
    for prepared, shares in zip(together.setup.tests, ((0.5, 0.5), (3.0,)), strict=True):
        for direction, share in zip(prepared.test.matched, shares, strict=True):
            strip = prepared.test.strips[direction]
            expected = share * strip.scatter / strip.points[1].max()
            assert noise[prepared.part(direction)] == pytest.approx(expected)
