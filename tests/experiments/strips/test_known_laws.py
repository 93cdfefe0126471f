"""Residuals of strips and their derivatives; fits, alone and beside a bubble; their certainty."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.load_objective import (
    PLACES_OF_SPECIMEN,
    SPECIMENS_OF_POLYNOMIAL,
    LoadObjective,
    correlated_loads,
    independent_loads,
)
from bubblefit.inference.assessment import certainty, moduli_from
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.descent import descend
from bubblefit.inference.feasible_start import feasible_start
from bubblefit.inference.law_bounds import LawBounds
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.methods import FitOptions, method_named
from bubblefit.inference.moduli import moduli_error
from bubblefit.inference.noise import Noise
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.objective import Blocks
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.search import approach, fit_from
from bubblefit.inference.starts import allowed, coefficients_at, dimensions
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.forms import polynomial
from bubblefit.materials.forms.base import COMPONENTS, GRID, moduli_on_grid
from bubblefit.materials.forms.spline import TriLinear
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.project.project import read_project
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial, specimen_deviation
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CubicSpline

from ...builders.laws import TABLE_3_2
from ...builders.projects import constant_strips
from ...inference.cases import Failing, Thicker, differentiated, fitted_by_lm, follows, scatter_of

# The strains that the tests of table 3.2 reached (logarithmic).
RANGE = (0.153, 0.232, 0.883)
LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2), 0.24, RANGE)
BREAKS = np.array([[0.04, 0.1], [0.06, 0.15], [0.2, 0.5]])
TRILINEAR = HypoelasticLaw.trilinear(
    (800.0, 300.0, 600.0), (140.0, 110.0, 240.0), (20.0, 14.0, 60.0), BREAKS
)
CONSTANT = HypoelasticLaw.linear(500.0, 200.0, 20.0)
# MPa: least and largest E1, E2, G12 anywhere on the range.
LEAST, LARGEST = np.array([20.0, 20.0, 2.0]), np.array([2000.0, 1000.0, 600.0])
BOUNDS = LawBounds.of_moduli(dict(zip(COMPONENTS, zip(LEAST, LARGEST, strict=True), strict=True)))
CUBIC, REGIONS, CONSTANTS = (
    Unknowns.of(form, 0.24, RANGE, BOUNDS)
    for form in (polynomial.CUBIC, TriLinear.at(BREAKS), polynomial.CONSTANT)
)
NUISANCE = (
    *(Nuisance(name, -20.0, 20.0, "mm") for name in OFFSETS),
    Nuisance("pressure_offset", -45.0, 50.0, "kPa", "pressure_offset", 1e-3),
)
SHIFTED = replace(
    CUBIC, nuisance=NuisanceUnknowns({"bubble": NUISANCE, "warp": (), "fill": (), "bias": ()})
)
FORMS = {
    "cubic": (CUBIC, LAW),
    "trilinear": (REGIONS, replace(TRILINEAR, strain_range=RANGE)),
    "constant": (CONSTANTS, CONSTANT),
}
# Thesis Table 3.1, mm; ten increments and few quads.
STRIPS = {
    "warp": straight_strip("warp", 20.022, 23.329, 0.81, increments=10),
    "fill": straight_strip("fill", 22.780, 28.721, 0.81, increments=10),
    "bias": bias_strip(19.767, 30.734, 0.81, increments=10, across=4, along=6),
}
BUBBLE = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, [0.05, 0.12, 0.2], [0.02, 0.05, 0.12, 0.2]
)
TIGHT = 1e-10
#: Strips along the yarns first, then the bias strip, then all.
STAGES = {"warp": 0, "fill": 0, "bias": 1, "bubble": 2}


@cache
def exact(part: str, law: HypoelasticLaw) -> History:
    return MembraneSolver(TIGHT).run(BUBBLE if part == "bubble" else STRIPS[part], law)


def strip_tests(law, relative: bool = False, noise: float = 0.0, seed: int = 0):
    for k, (name, model) in enumerate(STRIPS.items()):
        load = exact(name, law).load
        load = load + noise * np.random.default_rng(10 * seed + k).standard_normal(len(load))
        scale = float(load.max()) if relative else 1.0
        objective = LoadObjective(model.elongations, model.elongations, load, scale)
        yield Comparison(name, model, MembraneSolver(), objective, must_be_stable=False)


def field_objective(fields: np.ndarray) -> FieldObjective:
    targets = [FieldTarget(p, u) for p, u in zip(BUBBLE.pressures, fields, strict=True)]
    return FieldObjective(targets, weight=1 / 9)


def strips(unknowns: Unknowns = CUBIC, law: HypoelasticLaw = LAW, **how: Any) -> Any:
    return FitProblem(tuple(strip_tests(law, **how)), law, unknowns)


def joint(unknowns: Unknowns = CUBIC, law: HypoelasticLaw = LAW, **how: Any) -> Any:
    stages, noise = how.pop("stages", False), how.pop("bubble_noise", 0.0)
    fields = exact("bubble", law).displacement
    fields = fields + noise * np.random.default_rng(3).standard_normal(fields.shape)
    nuisance = unknowns.nuisance.comparisons.get("bubble", ())
    bubble = Comparison("bubble", BUBBLE, MembraneSolver(), field_objective(fields), nuisance)
    tests = (bubble, *strip_tests(law, True, **how))
    if stages:
        tests = tuple(replace(test, stage=STAGES[test.name]) for test in tests)
    return FitProblem(tests, law, unknowns)


def near(unknowns: Unknowns, law: HypoelasticLaw, factor: float = 1.03) -> Any:
    y = unknowns.at(law.beta[list(unknowns.free)] * factor)
    y[unknowns.size :] = [0.3, -0.2, 0.5, 1.5][: len(unknowns.nuisance.names)]
    return y


def led(fit: FitProblem) -> FitProblem:
    tests = []
    for one in fit.comparisons:
        history, objective = Thicker().run(one.model, LAW), one.objective
        if one.model is BUBBLE:
            objective = field_objective(history.displacement)
        else:
            u = one.model.elongations
            objective = LoadObjective(u, u, history.load, float(history.load.max()))
        tests.append(replace(one, solver=Thicker(), objective=objective))
    other = FitProblem(tuple(tests), LAW, fit.unknowns)
    other.surrogate = other.with_solvers([MembraneSolver() for _ in tests])
    return other


# Residuals


def test_the_objective_is_the_sum_of_rms_errors_as_printed():
    """Eqs 3.4 to 3.7: RMS of the differences, in N, direction by direction."""
    fit = strips(law=LAW)
    point = fit.evaluate(near(CUBIC, LAW), False)
    total = 0.0
    for experiment, history in zip(fit.comparisons, point.histories, strict=True):
        difference = history.load - experiment.objective.measured
        rms = np.sqrt(np.sum(difference**2) / len(difference))
        assert rms > 1.0
        assert experiment.objective.rms(history) == pytest.approx(rms)
        total += rms
    assert point.value == pytest.approx(total)


def test_loads_between_the_increments_lie_on_a_spline_from_the_origin():
    model, history = STRIPS["warp"], exact("warp", LAW)
    end = model.elongations[-1]
    u = np.array([0.0, 0.111, 0.7, 0.71, 2.9, end])
    objective = LoadObjective(model.elongations, u, np.zeros(6))
    spline = CubicSpline([0.0, *model.elongations], [0.0, *history.load])
    assert objective.modelled(history) == pytest.approx(spline(u))
    assert objective.modelled(history)[0] == pytest.approx(0.0, abs=1e-9)
    # The model's end is inside it, also where another sum of the same steps is larger by rounding.
    objective = LoadObjective(model.elongations, [0.0, end * (1 + 1e-12)], np.zeros(2))
    assert objective.sample[1] == pytest.approx([*[0.0] * 9, 1.0], abs=1e-9)
    assert objective.unit == "N"


def test_a_block_that_fits_exactly_has_no_slope():
    random = np.random.default_rng(8)
    r, j = random.standard_normal(9), random.standard_normal((9, 4))
    r[2:5] = 0.0
    keep = [0, 1, 5, 6, 7, 8]
    rest = Blocks([2, 4]).gradient(r[keep], j[keep])
    assert Blocks([2, 3, 4]).gradient(r, j) == pytest.approx(rest)


@pytest.mark.parametrize("unknowns", [SHIFTED, CUBIC], ids=["offsets", "moduli"])
def test_jacobian_of_a_joint_fit_against_finite_differences(unknowns: Unknowns):
    fit = joint(unknowns)
    point = check_jacobian(fit, near(unknowns, LAW))
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
    check_jacobian(strips(unknowns, law), near(unknowns, law))


def check_jacobian(fit, y):
    for experiment in fit.comparisons:
        experiment.solver = MembraneSolver(TIGHT)
    return differentiated(fit, y, floor=1e-4)


# Fits


def errors(fit, unknowns, law, y) -> list[float]:
    ends = [np.log(1 + m.elongations[-1] / m.gauge_length) for m in STRIPS.values()]
    return list(moduli_error(law.with_beta(unknowns.beta(y)), law, np.array(ends)).values())


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("form", [*FORMS, "bubble too"])
def test_the_law_that_made_the_data_is_found(form, number):
    unknowns, law = FORMS.get(form, FORMS["cubic"])
    fit, tolerance = (strips(unknowns, law), 1e-7) if form in FORMS else (joint(), 1e-9)
    found = fitted_by_lm(fit, feasible_start(fit, 2, number), tolerance, 100)
    assert found.value < 100 * tolerance, found
    assert max(errors(fit, unknowns, law, found.best.unknowns)) < 1e-4


def test_a_warm_start_changes_nothing():
    """The same residual on the way, and the same optimum at its end."""
    fit, cold = strips(), strips()
    cold.warm_starts = False
    y = near(CUBIC, LAW)
    fit.evaluate(y, True)
    beside, alone = (f.evaluate(1.002 * y, True) for f in (fit, cold))
    assert beside.residual == pytest.approx(alone.residual, rel=1e-5, abs=1e-4)
    noisy, again = strips(noise=20.0), strips(noise=20.0)
    again.warm_starts = False
    start = near(CUBIC, LAW, 1.2)
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


def test_no_analysis_of_a_fit_leaves_the_bounds():
    """Also where the data ask for more: E1 at its upper, E2 at its lower bound."""
    ranges = {"E1": (100.0, 700.0), "E2": (150.0, 500.0), "G12": (5.0, 300.0)}
    tight = replace(CUBIC, bounds=LawBounds.of_moduli(ranges))
    seen = []
    fit = strips(tight)
    fit.watch = lambda y, value, status, solver: seen.append(y)
    found = fitted_by_lm(fit, feasible_start(fit, 2, 0), 1e-7, 100)
    a, c = tight.inequalities
    assert len(seen) > 5 and all((a @ y >= c - 1e-9).all() for y in seen)
    law = LAW.with_beta(tight.beta(found.best.unknowns))
    assert law.E1(np.linspace(0, RANGE[0], GRID)).max() == pytest.approx(700.0, rel=1e-6)
    assert law.E2(np.linspace(0, RANGE[1], GRID)).min() == pytest.approx(150.0, rel=1e-6)


def watched(*problems) -> list[tuple]:
    seen = []
    for problem in problems:
        problem.watch = lambda y, value, status, solver: seen.append((value, status, solver))
    return seen


@pytest.mark.parametrize("stages", [False, True], ids=["strips", "joint"])
def test_the_membrane_leads_another_solver_of_strips(stages):
    fit = led(joint(stages=True) if stages else strips())
    originals = [e.objective for e in fit.surrogate.comparisons]
    seen = watched(fit, fit.surrogate)
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found.value < 1e-5 and found.runs <= 8
    assert {e.solver.runs for e in fit.comparisons} == {found.runs}
    assert max(errors(fit, CUBIC, LAW, found.best.unknowns)) < 1e-3
    assert [e.objective for e in fit.surrogate.comparisons] == originals
    # The strips lead in by the membrane too.
    alone = {solver for _, status, solver in seen if " alone: " in status}
    assert alone == ({"membrane"} if stages else set())
    assert [c.stage for c in fit.surrogate.comparisons] == ([2, 0, 0, 1] if stages else [0] * 3)


@pytest.mark.parametrize("number", range(4))
def test_a_test_that_fails_is_named_and_the_point_is_refused(number):
    fit, y = joint(), near(CUBIC, LAW)
    seen = watched(fit)
    fit.comparisons[number].solver = Failing(lambda run: run == 1)
    assert fit.evaluate(y, True) is None
    assert [one[:2] for one in seen] == [(None, f"{fit.comparisons[number].name}: on purpose")]
    assert fit.evaluate(y, True) is not None and fit.analyses == 2
    # A single one needs no name.
    single = FitProblem(fit.comparisons[number : number + 1], LAW, CUBIC)
    seen = watched(single)
    single.comparisons[0].solver = Failing(lambda run: run == 1)
    single.evaluate(y, False)
    assert [status for _, status, _ in seen] == ["on purpose"]


def test_strips_lead_into_a_joint_fit():
    """First the strips alone, named and counted; then all tests from their optimum."""
    fit = joint(noise=5.0, bubble_noise=0.1, stages=True)
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
    direct = fitted_by_lm(joint(noise=5.0, bubble_noise=0.1), start, 1e-7, 200)
    assert found.value == pytest.approx(direct.value, rel=1e-3)


def test_a_joint_fit_starts_where_it_was_told_when_the_strips_lead_astray():
    fit = joint(stages=True)
    start = near(CUBIC, LAW)
    fit.comparisons[0].solver = Failing(lambda run: run == 1)  # the bubble
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    fit.comparisons[1].solver = Failing(lambda run: True)
    assert (approach(fit, start, method_named("lm"), FitOptions()) == start).all()
    assert (approach(joint(), start, method_named("lm"), FitOptions()) == start).all()


# Certainty


def test_certainty_predicts_the_scatter_of_noisy_strip_fits():
    """Sigma is the scatter of linear estimates from drawn noise; a real fit goes where they do."""
    noise, moduli = 5.0, np.array([20.0, 200.0, 500.0])
    fit, truth = strips(CONSTANTS, CONSTANT, noise=noise, seed=1), near(CONSTANTS, CONSTANT, 1.0)
    point = fit.evaluate(truth, True)
    predicted = certainty(fit, point, CONSTANT, np.array([0.1, 0.1, 0.1]))
    # Ten loads a strip say their noise to 22 %; the scatter is that of the noise as it is said.
    assert set(predicted.noise.level) == set(STRIPS)
    assert np.mean(list(predicted.noise.level.values())) == pytest.approx(noise, rel=0.25)
    scatter = scatter_of(fit, point, predicted.noise.level)
    sigma = [predicted.linear_sigma[name][0] for name in ("G12", "E2", "E1")]
    assert sigma == pytest.approx(CONSTANTS.to_coefficients @ scatter / moduli, rel=0.03)
    best, _ = descend(fit, point, 1e-7, 10**6, norms=True)
    off = best.unknowns - truth - follows(fit, point, -point.residual)
    assert np.abs(off / scatter).max() < 0.05


def test_what_each_data_set_pins_down():
    fit = joint(noise=10.0, bubble_noise=0.1)
    point = fit.evaluate(CUBIC.at(LAW.beta), True)
    reached = np.array([0.1, 0.1, 0.3])
    noise = Noise.from_residual(fit, point.residual)
    posterior, sigma = posteriors_of(fit, point, noise)[0], noise.residual_sigma
    strains = {name: np.linspace(0.0, reached[c], 61) for name, c in COMPONENTS.items()}
    bubble, uniaxial, both, warp = (
        moduli_from(fit, point, posterior, LAW, strains, tests, sigma)
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


ELONGATION = np.linspace(0.1, 3.0, 30)
WHOLE = 100.0 * ELONGATION


def strip(loads: np.ndarray) -> Strip:
    curves = [LoadCurve("warp", str(k), ELONGATION, f, None) for k, f in enumerate(loads)]
    points = np.tile(ELONGATION, len(loads)), loads.ravel()
    polynomial = fit_load_polynomial(*points, 2, True)
    scatter = specimen_deviation(*points, polynomial)
    return Strip("warp", 20.0, 23.0, polynomial, tuple(curves), scatter)


def test_specimens_count_as_specimens_and_single_errors_by_themselves():
    factors = np.array([0.9, 0.97, 1.0, 1.02, 1.11])
    assert independent_loads(strip(factors[:, None] * WHOLE)) == pytest.approx(4.0, rel=1e-6)
    noise = 5.0 * np.random.default_rng(4).standard_normal((6, len(WHOLE)))
    assert independent_loads(strip(WHOLE + noise)) > 0.6 * 5 * len(WHOLE)


def test_sigma_is_the_scatter_of_what_specimens_say():
    """Of 300 sets of five specimens, each stiffer by its own factor and a little uneven."""
    random = np.random.default_rng(6)
    shape = WHOLE / np.sqrt(WHOLE @ WHOLE)
    said, found = [], []
    for _ in range(300):
        factor = 1.0 + 0.05 * random.standard_normal((5, 1))
        loads = factor * WHOLE + 1.0 * random.standard_normal((5, len(WHOLE)))
        own = strip(loads)
        # The best factor of all loads, and one sigma of it as a fit reckons it.
        found.append(float(np.mean(loads @ shape)))
        said.append(own.scatter * np.sqrt(correlated_loads(own, loads.size, None) / 5))
    assert np.sqrt(np.mean(np.square(said))) == pytest.approx(np.std(found), rel=0.15)


def test_what_nobody_knows():
    """One curve, or a polynomial: a few places of it; as many times as specimens are said."""
    one = strip(WHOLE[None] + 1.0)
    assert (
        independent_loads(one) == PLACES_OF_SPECIMEN
        and independent_loads(one, 4) == 3 * PLACES_OF_SPECIMEN
    )
    polynomial = Strip("warp", 20.0, 23.0, one.polynomial)
    assert independent_loads(polynomial) == (SPECIMENS_OF_POLYNOMIAL - 1) * PLACES_OF_SPECIMEN
    assert (
        independent_loads(polynomial, 1) == independent_loads(polynomial, 2) == PLACES_OF_SPECIMEN
    )
    # Noise that is given is that of single loads; where specimens are told, they count.
    assert correlated_loads(one, 30, 2.0) == correlated_loads(one, 1, None) == 1.0
    assert correlated_loads(one, 30, None) == 30 / PLACES_OF_SPECIMEN
    assert correlated_loads(one, 30, 2.0, specimens=3) == 30 / (2 * PLACES_OF_SPECIMEN)
    # Specimens that agree to the last digit.
    assert independent_loads(strip(np.tile(WHOLE, (3, 1)))) >= 2.0


def test_a_fit_reckons_with_specimens(tmp_path):
    """Two specimens of constant moduli: all of their loads count as one."""

    def problem(*changes):
        project = read_project(constant_strips(tmp_path, *changes))
        return prepare_fit(project, [project.tests["one"]]).problem()

    fit = problem()
    point = fit.evaluate(fit.unknowns.at(np.array([10.0, 190.0, 330.0])), False)
    noise = Noise.from_residual(fit, point.residual)
    assert noise.correlated_count["one: warp"] == pytest.approx(22.0, rel=1e-6)
    # A polynomial of the same points says no more, though it has as many values as increments.
    warp, fill = problem(('"points"', '"polynomial"')).comparisons
    assert warp.objective.correlated_count == pytest.approx(8.0) == fill.objective.correlated_count
