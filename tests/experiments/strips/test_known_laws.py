"""Fits to loads that a law gave, alone and beside a bubble, find the law."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.inference.assessment import moduli_error
from bubblefit.inference.methods import FitOptions, method_named
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.search import approach, feasible_start, fit_from
from bubblefit.inference.unknowns import LawBounds, Unknowns, allowed, draw
from bubblefit.materials.forms.base import COMPONENTS, GRID, moduli_on_grid
from bubblefit.materials.law import DEFINITE, HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...inference.cases import levenberg_marquardt
from .problems import (
    BUBBLE,
    CUBIC,
    FORMS,
    LARGEST,
    LAW,
    LEAST,
    RANGE,
    SHIFTED,
    TIGHT,
    Failing,
    found_beta,
    gauge_strains,
    joint,
    led,
    near,
    strips,
)


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("form", FORMS)
def test_strips_find_the_law_that_made_them(form: str, number: int):
    unknowns, law = FORMS[form]
    fit = strips(unknowns, law)
    found = levenberg_marquardt(fit, feasible_start(fit, 2, number), 1e-7, 100)
    assert found is not None and found.value < 1e-5, found
    error = moduli_error(law.with_beta(unknowns.beta(found.best.unknowns)), law,
                         gauge_strains(fit))  # fmt: skip
    assert max(error.values()) < 1e-4, error


@pytest.mark.parametrize("number", range(3))
def test_bubble_and_strips_find_the_law_that_made_them(number: int):
    fit = joint()
    found = levenberg_marquardt(fit, feasible_start(fit, 2, number), 1e-9, 100)
    assert found is not None and found.value < 1e-7, found
    error = moduli_error(LAW.with_beta(found_beta(found)), LAW, gauge_strains(fit))
    assert max(error.values()) < 1e-4, error


def test_offsets_of_the_bubble_are_found_beside_the_strips():
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
def test_other_methods_go_down_on_strips(method: str, share: float):
    fit = strips()
    start = feasible_start(fit, 2, 0)
    first = fit.evaluate(start, False).value
    found = fit_from(fit, start, FitOptions(method, max_analyses=fit.analyses + 100))
    assert found is not None and found.value < share * first


def test_a_warm_start_changes_nothing():
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


@pytest.mark.parametrize("form", FORMS)
def test_starts_have_moduli_between_the_bounds_and_the_box_holds_them(form: str):
    unknowns, _ = FORMS[form]
    draws = draw(unknowns, np.random.default_rng(1), 4000)
    lower, upper = unknowns.box
    room = 1e-9 * (upper - lower)
    assert (draws >= lower - room).all() and (draws <= upper + room).all()
    good = draws[allowed(unknowns, draws)]
    assert len(good) > 20
    a, c = unknowns.inequalities
    for coefficients in good[:100]:
        law = HypoelasticLaw(full(unknowns, coefficients), 0.24, RANGE, "constant",
                             unknowns.form)  # fmt: skip
        for name, component in COMPONENTS.items():
            values = law.modulus(name, np.linspace(0, RANGE[component], 101))
            place = ("E1", "E2", "G12").index(name)
            dip = 0.007 * values.max()  # between the strains of the grid, see GRID
            assert values.min() >= LEAST[place] - dip and values.max() <= LARGEST[place] + dip
        assert (a @ unknowns.at(coefficients) >= c - 1e-9).all()
    for coefficients in draws[~allowed(unknowns, draws)][:100]:
        assert (a @ unknowns.at(coefficients) < c).any()


def full(unknowns: Unknowns, coefficients: np.ndarray) -> np.ndarray:
    beta = np.zeros(12)
    beta[list(unknowns.free)] = coefficients
    return beta


def test_no_analysis_of_a_fit_leaves_the_bounds():
    """Also where the data ask for more: E1 at its upper, E2 at its lower bound."""
    ranges = {"E1": (100.0, 700.0), "E2": (150.0, 500.0), "G12": (5.0, 300.0)}
    tight = replace(CUBIC, bounds=LawBounds.of_moduli(ranges))
    seen: list[np.ndarray] = []
    fit = strips(tight)
    fit.watch = lambda y, value, status, solver: seen.append(y)
    found = levenberg_marquardt(fit, feasible_start(fit, 2, 0), 1e-7, 100)
    a, c = tight.inequalities
    assert len(seen) > 5 and all((a @ y >= c - 1e-9).all() for y in seen)
    law = LAW.with_beta(tight.beta(found.best.unknowns))
    assert law.E1(np.linspace(0, RANGE[0], GRID)).max() == pytest.approx(700.0, rel=1e-6)
    assert law.E2(np.linspace(0, RANGE[1], GRID)).min() == pytest.approx(150.0, rel=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_strips_keep_the_law_positive_definite(form: str):
    """E1 E2 > (nu12 E2)^2 with the modulus across at zero strain, because a strip contracts."""
    unknowns, _ = FORMS[form]
    bounded = replace(unknowns, definite_nu12=0.4)
    draws = draw(unknowns, np.random.default_rng(4), 3000)
    a, c = bounded.inequalities
    agreed = {True: 0, False: 0}
    for coefficients in draws[allowed(unknowns, draws)][:200]:
        law = HypoelasticLaw(full(unknowns, coefficients), 0.4, RANGE, "constant",
                             unknowns.form)  # fmt: skip
        grid = moduli_on_grid(unknowns.form, RANGE)
        e2, e1 = grid["E2"] @ law.beta, grid["E1"] @ law.beta
        worst = min((e1[0] / e2).min(), (e1 / e2[0]).min()) / 0.4**2
        inside = bool((a @ bounded.at(coefficients) >= c - 1e-12).all())
        assert inside == (worst >= DEFINITE)
        agreed[inside] += 1
    assert min(agreed.values()) >= 5, agreed


@pytest.mark.parametrize("build", [strips, joint], ids=["strips", "joint"])
def test_the_membrane_leads_another_solver_of_strips(build: Any):
    fit = led(build())
    originals = [e.objective for e in fit.surrogate.comparisons]
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found is not None and found.value < 1e-5 and found.runs <= 8
    assert {e.solver.runs for e in fit.comparisons} == {found.runs}
    error = moduli_error(LAW.with_beta(found_beta(found)), LAW, gauge_strains(fit))
    assert max(error.values()) < 1e-3, error
    assert [e.objective for e in fit.surrogate.comparisons] == originals


def test_a_failed_run_of_a_strip_shortens_the_step():
    fit = led(strips(), fails=(2,))
    told: list[tuple[float | None, str]] = []
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert told[1] == (None, "warp: on purpose") and found.value < 1e-3 * told[0][0]


@pytest.mark.parametrize("number", range(4))
def test_a_test_that_fails_is_named_and_the_point_is_refused(number: int):
    fit = joint()
    told: list[tuple[float | None, str]] = []
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    fit.comparisons[number].solver = Failing([1])
    y = near(CUBIC, LAW)
    assert fit.evaluate(y, True) is None
    assert told == [(None, f"{fit.comparisons[number].name}: on purpose")]
    assert fit.evaluate(y, True) is not None and fit.analyses == 2


def test_a_single_strip_needs_no_name_in_its_failure():
    whole = strips()
    fit = FitProblem(whole.comparisons[:1], LAW, CUBIC)
    told: list[str] = []
    fit.watch = lambda y, value, status, solver: told.append(status)
    fit.comparisons[0].solver = Failing([1])
    fit.evaluate(near(CUBIC, LAW), False)
    assert told == ["on purpose"]


def test_a_fit_steps_round_strips_that_fail():
    fit = strips()
    fit.comparisons[2].solver = Failing([3, 5, 6])
    found = levenberg_marquardt(fit, feasible_start(strips(), 2, 0), 1e-7, 150)
    assert found is not None and found.value < 1e-5


def test_strips_lead_into_a_joint_fit():
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


def test_a_joint_fit_starts_where_it_was_told_when_the_strips_lead_astray():
    fit = joint(stages=True)
    start = near(CUBIC, LAW)
    fit.comparisons[0].solver = Failing([1])  # the bubble, at the optimum of the strips
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    fit.comparisons[1].solver = Failing(range(1, 1000))
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    assert (approach(joint(), start, method_named("lm"), FitOptions()) == start).all()


def test_the_surrogate_of_a_joint_fit_leads_in_too():
    fit = led(joint(stages=True))
    told: list[tuple[str, str]] = []
    for problem in (fit, fit.surrogate):
        problem.watch = lambda y, value, status, solver: told.append((solver, status))
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found.value < 1e-5
    alone = [solver for solver, status in told if " alone: " in status]
    assert alone and set(alone) == {"membrane"}
    assert [c.stage for c in fit.surrogate.comparisons] == [2, 0, 0, 1]
