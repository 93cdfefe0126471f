"""Fits to strips, alone and beside a bubble: derivatives, stages, certainty."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.experiments.strips.load_objective import LoadObjective
from bubblefit.inference.assessment import certainty, moduli_from
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.descent import descend
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.methods import FitOptions, method_named
from bubblefit.inference.noise import Noise
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.reported import moduli_error
from bubblefit.inference.search import (
    allowed,
    approach,
    coefficients_at,
    dimensions,
    feasible_start,
    fit_from,
)
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms.base import COMPONENTS, GRID, moduli_on_grid
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...inference.cases import Failing, Thicker, differentiated, fitted_by_lm, follows, scatter_of
from .cases import (
    CONSTANTS,
    CUBIC_UNKNOWNS,
    REGIONS,
    STRIP_LAW,
    STRIP_MODELS,
    exact_history,
    near_law,
    strip_problem,
    strip_tests,
)

# The strains that the tests of table 3.2 reached (logarithmic).
RANGE = (0.153, 0.232, 0.883)
BREAKS = np.array([[0.04, 0.1], [0.06, 0.15], [0.2, 0.5]])
TRILINEAR = HypoelasticLaw.trilinear(
    (800.0, 300.0, 600.0), (140.0, 110.0, 240.0), (20.0, 14.0, 60.0), BREAKS
)
CONSTANT = HypoelasticLaw.linear(500.0, 200.0, 20.0)
NUISANCE = (
    *(Nuisance(name, -20.0, 20.0, "mm") for name in OFFSETS),
    Nuisance("pressure_offset", -45.0, 50.0, "kPa", "pressure_offset", 1e-3),
)
SHIFTED = replace(
    CUBIC_UNKNOWNS,
    nuisance=NuisanceUnknowns({"bubble": NUISANCE, "warp": (), "fill": (), "bias": ()}),
)
FORMS = {
    "cubic": (CUBIC_UNKNOWNS, STRIP_LAW),
    "trilinear": (REGIONS, replace(TRILINEAR, strain_range=RANGE)),
    "constant": (CONSTANTS, CONSTANT),
}
BUBBLE = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, [0.05, 0.12, 0.2], [0.02, 0.05, 0.12, 0.2]
)
TIGHT = 1e-10
#: Strips along the yarns first, then the bias strip, then all.
STAGES = {"warp": 0, "fill": 0, "bias": 1, "bubble": 2}


def field_objective(fields: np.ndarray) -> FieldObjective:
    targets = [FieldTarget(p, u) for p, u in zip(BUBBLE.pressures, fields, strict=True)]
    return FieldObjective(targets, weight=1 / 9)


def joint_problem(
    unknowns: Unknowns = CUBIC_UNKNOWNS, law: HypoelasticLaw = STRIP_LAW, **how: Any
) -> Any:
    stages, noise = how.pop("stages", False), how.pop("bubble_noise", 0.0)
    fields = exact_history("bubble", law).displacement
    fields = fields + noise * np.random.default_rng(3).standard_normal(fields.shape)
    nuisance = unknowns.nuisance.comparisons.get("bubble", ())
    bubble = Comparison("bubble", BUBBLE, MembraneSolver(), field_objective(fields), nuisance)
    tests = (bubble, *strip_tests(law, True, **how))
    if stages:
        tests = tuple(replace(test, stage=STAGES[test.name]) for test in tests)
    return FitProblem(tests, law, unknowns)


def led_by_membrane(fit: FitProblem) -> FitProblem:
    tests = []
    for one in fit.comparisons:
        history, objective = Thicker().run(one.model, STRIP_LAW), one.objective
        if one.model is BUBBLE:
            objective = field_objective(history.displacement)
        else:
            u = one.model.elongations
            objective = LoadObjective(u, u, history.load, float(history.load.max()))
        tests.append(replace(one, solver=Thicker(), objective=objective))
    other = FitProblem(tuple(tests), STRIP_LAW, fit.unknowns)
    other.surrogate = other.with_solvers([MembraneSolver() for _ in tests])
    return other


@pytest.mark.parametrize("unknowns", [SHIFTED, CUBIC_UNKNOWNS], ids=["offsets", "moduli"])
def test_jacobian_of_a_joint_fit_against_finite_differences(unknowns: Unknowns):
    fit = joint_problem(unknowns)
    point = check_jacobian(fit, near_law(unknowns, STRIP_LAW))
    pieces = [fit.rows(k) for k in range(4)]
    assert np.r_[tuple(pieces)].tolist() == list(range(len(point.residual)))
    for experiment, rows, history in zip(fit.comparisons, pieces, point.histories, strict=True):
        if not unknowns.nuisance.names:
            expected = experiment.objective.residual(history, {})
            assert point.residual[rows] == pytest.approx(expected)
        assert fit.scale[rows] == pytest.approx(experiment.objective.scale)
    for rows in pieces[1:]:  # nothing that a strip knows of
        assert not point.jacobian[rows, unknowns.size :].any()
        assert point.jacobian[rows, : unknowns.size].any()
    if unknowns.nuisance.names:
        assert np.abs(point.jacobian[pieces[0], unknowns.size :]).max(axis=0).all()


@pytest.mark.parametrize("form", FORMS)
def test_jacobian_of_strips_against_finite_differences(form):
    unknowns, law = FORMS[form]
    check_jacobian(strip_problem(unknowns, law), near_law(unknowns, law))


def check_jacobian(fit, y):
    for experiment in fit.comparisons:
        experiment.solver = MembraneSolver(TIGHT)
    return differentiated(fit, y, floor=1e-4)


# Fits


def moduli_errors(fit, unknowns, law, y) -> list[float]:
    ends = [np.log(1 + m.elongations[-1] / m.gauge_length) for m in STRIP_MODELS.values()]
    return list(moduli_error(law.with_beta(unknowns.beta(y)), law, np.array(ends)).values())


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("form", [*FORMS, "bubble too"])
def test_fit_of_strips_finds_the_law_of_the_data(form, number):
    unknowns, law = FORMS.get(form, FORMS["cubic"])
    fit, tolerance = (
        (strip_problem(unknowns, law), 1e-7) if form in FORMS else (joint_problem(), 1e-9)
    )
    found = fitted_by_lm(fit, feasible_start(fit, 2, number), tolerance, 100)
    assert found.value < 100 * tolerance, found
    assert max(moduli_errors(fit, unknowns, law, found.best.unknowns)) < 1e-4


def test_warm_start_does_not_change_the_fit():
    """The same residual on the way, and the same optimum at its end."""
    fit, cold = strip_problem(), strip_problem()
    cold.warm_starts = False
    y = near_law(CUBIC_UNKNOWNS, STRIP_LAW)
    fit.evaluate(y, True)
    beside, alone = (f.evaluate(1.002 * y, True) for f in (fit, cold))
    assert beside.residual == pytest.approx(alone.residual, rel=1e-5, abs=1e-4)
    noisy, again = strip_problem(noise=20.0), strip_problem(noise=20.0)
    again.warm_starts = False
    start = near_law(CUBIC_UNKNOWNS, STRIP_LAW, 1.2)
    found, other = (fitted_by_lm(f, start, 1e-7, 200) for f in (noisy, again))
    assert found.value == pytest.approx(other.value, rel=1e-6)
    assert found.coefficients == pytest.approx(other.coefficients, rel=1e-2)


def law_of(unknowns, coefficients, nu12=0.24) -> HypoelasticLaw:
    beta = np.zeros(12)
    beta[list(unknowns.free)] = coefficients
    return HypoelasticLaw(beta, nu12, RANGE, "constant", unknowns.form)


@pytest.mark.parametrize("form", FORMS)
def test_strips_keep_the_law_positive_definite(form):
    """E1 E2 > (nu12 E2)^2 with the modulus across at zero strain, because a strip contracts."""
    unknowns, _ = FORMS[form]
    bounded = replace(unknowns, definite_nu12=0.4)
    share = np.random.default_rng(4).random((3000, dimensions(unknowns)))
    draws = coefficients_at(unknowns, share)
    a, c = bounded.inequalities
    agreed = {True: 0, False: 0}
    for coefficients in draws[allowed(unknowns, draws)][:200]:
        law = law_of(unknowns, coefficients, 0.4)
        grid = moduli_on_grid(unknowns.form, RANGE)
        e2, e1 = grid["E2"] @ law.beta, grid["E1"] @ law.beta
        worst = min((e1[0] / e2).min(), (e1 / e2[0]).min()) / 0.4**2
        inside = bool((a @ bounded.at(coefficients) >= c - 1e-12).all())
        assert inside == (worst >= 1.02)  # the margin of `definite_rows`
        agreed[inside] += 1
    assert min(agreed.values()) >= 5, agreed


def test_analyses_of_a_fit_stay_within_the_bounds():
    """Also where the data ask for more: E1 at its upper, E2 at its lower bound."""
    ranges = {"E1": (100.0, 700.0), "E2": (150.0, 500.0), "G12": (5.0, 300.0)}
    tight = replace(CUBIC_UNKNOWNS, bounds=LawBounds.of_moduli(ranges))
    seen = []
    fit = strip_problem(tight)
    fit.watch = lambda y, value, status, solver: seen.append(y)
    found = fitted_by_lm(fit, feasible_start(fit, 2, 0), 1e-7, 100)
    a, c = tight.inequalities
    assert len(seen) > 5 and all((a @ y >= c - 1e-9).all() for y in seen)
    law = STRIP_LAW.with_beta(tight.beta(found.best.unknowns))
    assert law.E1(np.linspace(0, RANGE[0], GRID)).max() == pytest.approx(700.0, rel=1e-6)
    assert law.E2(np.linspace(0, RANGE[1], GRID)).min() == pytest.approx(150.0, rel=1e-6)


def watched(*problems) -> list[tuple]:
    seen = []
    for problem in problems:
        problem.watch = lambda y, value, status, solver: seen.append((value, status, solver))
    return seen


@pytest.mark.parametrize("stages", [False, True], ids=["strips", "joint"])
def test_membrane_leads_another_solver_of_strips(stages):
    fit = led_by_membrane(joint_problem(stages=True) if stages else strip_problem())
    originals = [e.objective for e in fit.surrogate.comparisons]
    seen = watched(fit, fit.surrogate)
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found.value < 1e-5 and found.runs <= 8
    assert {e.solver.runs for e in fit.comparisons} == {found.runs}
    assert max(moduli_errors(fit, CUBIC_UNKNOWNS, STRIP_LAW, found.best.unknowns)) < 1e-3
    assert [e.objective for e in fit.surrogate.comparisons] == originals
    # The strips lead in by the membrane too.
    alone = {solver for _, status, solver in seen if " alone: " in status}
    assert alone == ({"membrane"} if stages else set())
    assert [c.stage for c in fit.surrogate.comparisons] == ([2, 0, 0, 1] if stages else [0] * 3)


@pytest.mark.parametrize("number", range(4))
def test_failed_test_is_named_and_its_point_refused(number):
    fit, y = joint_problem(), near_law(CUBIC_UNKNOWNS, STRIP_LAW)
    seen = watched(fit)
    fit.comparisons[number].solver = Failing(lambda run: run == 1)
    assert fit.evaluate(y, True) is None
    assert [one[:2] for one in seen] == [(None, f"{fit.comparisons[number].name}: on purpose")]
    assert fit.evaluate(y, True) is not None and fit.analyses == 2
    # A single one needs no name.
    single = FitProblem(fit.comparisons[number : number + 1], STRIP_LAW, CUBIC_UNKNOWNS)
    seen = watched(single)
    single.comparisons[0].solver = Failing(lambda run: run == 1)
    single.evaluate(y, False)
    assert [status for _, status, _ in seen] == ["on purpose"]


def test_strips_lead_into_a_joint_fit():
    """First the strips alone, named and counted; then all tests from their optimum."""
    fit = joint_problem(noise=5.0, bubble_noise=0.1, stages=True)
    start = feasible_start(fit, 2, 0)
    fit.reset()
    seen = watched(fit)
    y = approach(fit, start, method_named("lm"), FitOptions())
    groups = [status.split(" alone: ")[0] for _, status, _ in seen]
    assert list(dict.fromkeys(groups)) == ["warp, fill", "warp, fill, bias", "ok"]
    assert len(seen) == fit.analyses and groups.count("ok") == 1
    assert [value is None for value, *_ in seen] == [group != "ok" for group in groups]
    part = fit.part((1, 2, 3))
    assert part.evaluate(y, False).value < 0.05 * part.evaluate(start, False).value
    found = fit_from(fit, start, FitOptions())
    direct = fitted_by_lm(joint_problem(noise=5.0, bubble_noise=0.1), start, 1e-7, 200)
    assert found.value == pytest.approx(direct.value, rel=1e-3)


def test_joint_fit_starts_at_its_start_when_strips_lead_astray():
    fit = joint_problem(stages=True)
    start = near_law(CUBIC_UNKNOWNS, STRIP_LAW)
    fit.comparisons[0].solver = Failing(lambda run: run == 1)  # the bubble
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    fit.comparisons[1].solver = Failing(lambda run: True)
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    assert (approach(joint_problem(), start, method_named("lm"), FitOptions()) == start).all()


# Certainty


def test_certainty_predicts_the_scatter_of_noisy_strip_fits():
    """Sigma is the scatter of linear estimates from drawn noise; a real fit goes where they do."""
    noise, moduli = 5.0, np.array([20.0, 200.0, 500.0])
    fit, truth = (
        strip_problem(CONSTANTS, CONSTANT, noise=noise, seed=1),
        near_law(CONSTANTS, CONSTANT, 1.0),
    )
    point = fit.evaluate(truth, True)
    predicted = certainty(fit, point, CONSTANT, np.array([0.1, 0.1, 0.1]))
    # Ten loads a strip say their noise to 22 %; the scatter is that of the noise as it is said.
    assert set(predicted.noise.level) == set(STRIP_MODELS)
    assert np.mean(list(predicted.noise.level.values())) == pytest.approx(noise, rel=0.25)
    scatter = scatter_of(fit, point, predicted.noise.level)
    sigma = [predicted.linear_sigma[name][0] for name in ("G12", "E2", "E1")]
    assert sigma == pytest.approx(CONSTANTS.to_coefficients @ scatter / moduli, rel=0.03)
    best, _ = descend(fit, point, 1e-7, 10**6, norms=True)
    off = best.unknowns - truth - follows(fit, point, -point.residual)
    assert np.abs(off / scatter).max() < 0.05


def test_strips_and_bubble_determine_different_moduli():
    fit = joint_problem(noise=10.0, bubble_noise=0.1)
    point = fit.evaluate(CUBIC_UNKNOWNS.at(STRIP_LAW.beta), True)
    reached = np.array([0.1, 0.1, 0.3])
    noise = Noise.from_residual(fit, point.residual)
    posterior, sigma = posteriors_of(fit, point, noise)[0], noise.residual_sigma
    strains = {name: np.linspace(0.0, reached[c], 61) for name, c in COMPONENTS.items()}
    bubble, uniaxial, both, warp = (
        moduli_from(fit, point, posterior, STRIP_LAW, strains, tests, sigma)
        for tests in ([0], [1, 2, 3], [0, 1, 2, 3], [1])
    )
    for name in COMPONENTS:
        for alone in (bubble[name], uniaxial[name]):
            # But for what the draws between bounds leave to chance.
            assert (both[name].sigma <= 1.02 * alone.sigma)[alone.determined].all()
    worst = {name: modulus.sigma.max() for name, modulus in bubble.items()}
    assert worst["G12"] > 2 * max(worst["E1"], worst["E2"])
    assert uniaxial["G12"].sigma.max() < 0.2 * bubble["G12"].sigma.max()
    # A pull along the warp says nothing of the fill or of shear.
    assert warp["E1"].sigma.max() < 0.5
    assert not (warp["E2"].determined | warp["G12"].determined).any()
