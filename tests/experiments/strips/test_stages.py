"""The way to a fit of strips and a bubble: strips along the yarns lead in."""

from __future__ import annotations

import pytest
from bubblefit.inference.methods import FitOptions, method_named
from bubblefit.inference.search import approach, feasible_start, fit_from

from ...inference.cases import levenberg_marquardt
from .problems import CUBIC, LAW, Failing, joint, led, near


def test_strips_lead_into_a_joint_fit() -> None:
    """First the strips alone, told as such and counted; then all tests from their optimum."""
    fit = joint(noise=5.0, bubble_noise=0.1, stages=True)
    told: list[tuple[float | None, str]] = []
    start = feasible_start(fit, 2, 0)
    fit.reset()
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    y = approach(fit, start, method_named("lm"), FitOptions())
    groups = [words.split(" alone: ")[0] for _, words in told]
    assert list(dict.fromkeys(groups)) == ["warp, fill", "warp, fill, bias", "ok"]
    assert len(told) == fit.analyses and groups.count("ok") == 1
    assert [value is None for value, _ in told] == [group != "ok" for group in groups]
    part = fit.part((1, 2, 3))
    assert part.evaluate(y, False).value < 0.05 * part.evaluate(start, False).value
    found = fit_from(fit, start, FitOptions())
    direct = levenberg_marquardt(joint(noise=5.0, bubble_noise=0.1), start, 1e-7, 200)
    assert found.value == pytest.approx(direct.value, rel=1e-3)


def test_a_joint_fit_starts_where_it_was_told_when_the_strips_lead_astray() -> None:
    fit = joint(stages=True)
    start = near(CUBIC, LAW)
    fit.comparisons[0].solver = Failing([1])  # the bubble, at the optimum of the strips
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    fit.comparisons[1].solver = Failing(range(1, 1000))
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    assert (approach(joint(), start, method_named("lm"), FitOptions()) == start).all()


def test_the_surrogate_of_a_joint_fit_leads_in_too() -> None:
    fit = led(joint(stages=True))
    told: list[tuple[str, str]] = []
    for problem in (fit, fit.surrogate):
        problem.watch = lambda y, value, status, solver: told.append((solver, status))
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found.value < 1e-5
    alone = [solver for solver, status in told if " alone: " in status]
    assert alone and set(alone) == {"membrane"}
    assert [c.stage for c in fit.surrogate.comparisons] == [2, 0, 0, 1]
