"""The best of all starts is run again: same objective, second try of an external program."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.runs import best
from bubblefit.runs.best import best_fit, noise_of

from ..support.refusals import raised


def test_best_start_is_run_again(fitted):
    good = fitted.best.ranked[0]
    unknowns = tuple(1.02 * u for u in good.unknowns)
    others = [
        best.replace(good, objective=good.objective + 0.1, unknowns=unknowns),
        best.replace(good, objective=None, unknowns=()),
    ]
    for k in range(3):
        records = [*others[:k], good, *others[k:]]
        records = [best.replace(r, number=number) for number, r in enumerate(records)]
        again = best.best_fit(fitted.problem, records, fitted.project.fit.tolerance)
        assert again.ranked[0].number == k
        # All records, in their order, and the best with the objective of the repeated run.
        assert [r.number for r in again.records] == [r.number for r in records]
        assert [r is again.ranked[0] for r in again.records] == [r.number == k for r in records]
        np.testing.assert_array_equal(again.law.beta, fitted.law.beta)
        assert again.ranked[0].objective == pytest.approx(fitted.objective, abs=1e-9)


@pytest.mark.parametrize(("external", "tries"), [(True, 2), (False, 1)])
def test_external_program_gets_second_try(strips_fit, external, tries):
    problem = strips_fit.setup.problem()
    asked = []

    def fail(*_, **__):
        asked.append(True)
        problem.failure = "no licence"

    problem.evaluate = fail
    problem.solver.external = external
    said = "the best fit does not run again: no licence; its starts are kept, --resume goes on"
    raised(SolverFailure, said, best_fit, problem, strips_fit.best.records, 0.0)
    assert len(asked) == tries


@pytest.mark.parametrize(("off", "fails"), [(0.9, False), (1.1, True), (-0.9, False), (-1.1, True)])
def test_repeated_run_must_give_objective_within_tolerance_and_noise(strips_fit, off, fails):
    problem, first = strips_fit.setup.problem(), strips_fit.best.ranked[0]
    noise = noise_of(problem)
    assert first.objective is not None
    limit = 1e-5 * first.objective + 1e-6 * sum(noise.values())
    other = replace(first, objective=first.objective + off * limit)
    if fails:
        with pytest.raises(SolverFailure, match="start 0 ended with an objective of"):
            best_fit(problem, [replace(other, number=0)], 0.0)
    else:
        assert best_fit(problem, [other], 0.0).ranked[0].objective == first.objective


def test_noise_is_residual_of_perfect_law(strips_fit):
    noise = noise_of(strips_fit.setup.problem())
    for prepared, shares in zip(strips_fit.setup.tests, ((0.5, 0.5), (3.0,)), strict=True):
        for direction, share in zip(prepared.test.matched, shares, strict=True):
            strip = prepared.test.strips[direction]
            expected = share * strip.scatter / strip.points[1].max()
            assert noise[prepared.part(direction)] == pytest.approx(expected)
