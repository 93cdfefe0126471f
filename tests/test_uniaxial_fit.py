"""Fits to several tests at once: strips alone, and strips with a quarter bubble of 48 quads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.identification.approach import approach
from bubblefit.identification.assessment import certainty, moduli_error, pinned_by
from bubblefit.identification.blocks import Blocks
from bubblefit.identification.experiment import Experiment
from bubblefit.identification.feasibility import feasible_start
from bubblefit.identification.fit import levenberg_marquardt
from bubblefit.identification.least_squares import descend
from bubblefit.identification.loads import LoadObjective
from bubblefit.identification.methods import FitOptions, fit_from
from bubblefit.identification.objective import FieldObjective, FieldTarget
from bubblefit.identification.parameters import DEFINITE, ModuliParameters
from bubblefit.identification.problem import FitProblem
from bubblefit.materials.law import MODULI, HypoelasticLaw
from bubblefit.materials.positivity import GRID, modulus_grid
from bubblefit.meshes.disk import disk_mesh
from bubblefit.models.bubble import BubbleModel
from bubblefit.models.uniaxial import UniaxialModel, bias_strip, straight_strip
from bubblefit.solvers.base import History, SolverCheck
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CubicSpline
from threadpoolctl import threadpool_limits

# Thesis Table 3.2, GPa, and the strains that its tests reached (logarithmic).
TABLE_3_2 = [
    -7.96599e-3, 7.49311e-1, -1.50931e-1, 2.05148e-2,
    -1.13743e1, 1.07160e1, -6.17621e-1, 1.41287e-1,
    -4.78030e2, 2.11227e2, -2.02600e1, 8.15340e-1,
]  # fmt: skip
RANGE = (0.153, 0.232, 0.883)
LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2), 0.24, RANGE)
BREAKS = np.array([[0.04, 0.1], [0.06, 0.15], [0.2, 0.5]])
TRILINEAR = HypoelasticLaw.trilinear(
    (800.0, 300.0, 600.0), (140.0, 110.0, 240.0), (20.0, 14.0, 60.0), BREAKS
)
CONSTANT = HypoelasticLaw.linear(500.0, 200.0, 20.0)
# MPa: least and largest E1, E2, G12 anywhere on the range.
LEAST, LARGEST = np.array([20.0, 20.0, 2.0]), np.array([2000.0, 1000.0, 600.0])
CUBIC = ModuliParameters.between(3, RANGE, LEAST, LARGEST)
REGIONS = ModuliParameters.between(2, RANGE, LEAST, LARGEST, breaks=BREAKS)
CONSTANTS = ModuliParameters.between(0, RANGE, LEAST, LARGEST)
OFFSETS = replace(CUBIC, displacement_offset=True, pressure_offset=True, least_pressure=0.05)
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


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> Iterator[None]:
    """As in a study: BLAS threads on so small a band cost more than they bring."""
    with threadpool_limits(1):
        yield


def measured(model: UniaxialModel, law: HypoelasticLaw, noise: float = 0.0, seed: int = 0) -> Any:
    """Loads that the law gives, at every increment."""
    load = MembraneSolver(TIGHT).run(model, law).load
    return load + noise * np.random.default_rng(seed).standard_normal(len(load))


def strip_tests(
    law: HypoelasticLaw, relative: bool = False, noise: float = 0.0, seed: int = 0
) -> tuple[Experiment, ...]:
    tests = []
    for k, (name, model) in enumerate(STRIPS.items()):
        load = measured(model, law, noise, 10 * seed + k)
        scale = float(load.max()) if relative else 1.0
        objective = LoadObjective(model.elongations, model.elongations, load, scale)
        tests.append(Experiment(name, model, MembraneSolver(), objective, False))
    return tuple(tests)


def bubble_test(law: HypoelasticLaw, noise: float = 0.0) -> Experiment:
    fields = MembraneSolver(TIGHT).run(BUBBLE, law).displacement
    fields = fields + noise * np.random.default_rng(3).standard_normal(fields.shape)
    targets = [FieldTarget(p, u) for p, u in zip(BUBBLE.pressures, fields, strict=True)]
    objective = FieldObjective(targets, weight=1 / 9)
    return Experiment("bubble", BUBBLE, MembraneSolver(), objective)


def strips(parameters: ModuliParameters = CUBIC, law: HypoelasticLaw = LAW, **how: Any) -> Any:
    return FitProblem(strip_tests(law, **how), law, parameters)


def joint(parameters: ModuliParameters = CUBIC, law: HypoelasticLaw = LAW, **how: Any) -> Any:
    tests = (bubble_test(law, how.pop("bubble_noise", 0.0)), *strip_tests(law, True, **how))
    return FitProblem(tests, law, parameters)


def near(parameters: ModuliParameters, law: HypoelasticLaw, factor: float = 1.03) -> Any:
    """Unknowns a little off the law, offsets on."""
    y = parameters.unknowns(law.beta[parameters.places] * factor)
    y[parameters.size :] = [0.3, -0.2, 0.5, 1.5][: len(parameters.nuisance)]
    return y


# Objective


def test_the_objective_is_the_sum_of_rms_errors_as_printed() -> None:
    """Eqs 3.4 to 3.7: RMS of the differences, in N, direction by direction."""
    fit = strips(law=LAW)
    point = fit.evaluate(near(CUBIC, LAW), False)
    total = 0.0
    for experiment, history in zip(fit.experiments, point.histories, strict=True):
        difference = history.load - experiment.objective.load
        rms = np.sqrt(np.sum(difference**2) / len(difference))
        assert rms > 1.0
        assert experiment.objective.rms(history) == pytest.approx(rms)
        total += rms
    assert point.value == pytest.approx(total)


def test_loads_between_the_increments_lie_on_a_spline_from_the_origin() -> None:
    model = STRIPS["warp"]
    history = MembraneSolver().run(model, LAW)
    u = np.array([0.0, 0.111, 0.7, 0.71, 2.9, model.elongations[-1]])
    objective = LoadObjective(model.elongations, u, np.zeros(6))
    spline = CubicSpline([0.0, *model.elongations], [0.0, *history.load])
    assert objective.modelled(history) == pytest.approx(spline(u))
    assert objective.modelled(history)[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scale, weight", [(1.0, 2.0), (1400.0, 1.0), (1400.0, 0.25)])
def test_scale_and_weight_of_a_strip(scale: float, weight: float) -> None:
    model = STRIPS["fill"]
    history = MembraneSolver().run(model, LAW)
    load = history.load + np.linspace(-3, 9, 10)
    plain = LoadObjective(model.elongations, model.elongations, load)
    other = LoadObjective(model.elongations, model.elongations, load, scale, weight)
    norm = np.linalg.norm(other.residual(history))
    assert norm == pytest.approx(weight / scale * plain.rms(history))
    assert other.rms(history) == plain.rms(history)
    assert other.residual(history) * other.scale == pytest.approx(history.load - load)


@pytest.mark.parametrize(
    "elongation, words",
    [([], "no point"), ([-0.1], "got -0.1"), ([3.4], "got 3.4"), ([1.0, 1e6], "1e\\+06")],
)
def test_load_curves_outside_the_model_are_refused(elongation: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        LoadObjective(STRIPS["warp"].elongations, elongation, np.zeros(len(elongation)))


def test_blocks() -> None:
    random = np.random.default_rng(8)
    r, j = random.standard_normal(9), random.standard_normal((9, 4))
    blocks = Blocks([2, 3, 4])
    parts = r[:2], r[2:5], r[5:]
    assert blocks.norms(r) == pytest.approx([np.linalg.norm(p) for p in parts])
    assert blocks.value(r) == pytest.approx(sum(np.linalg.norm(p) for p in parts))
    assert blocks.of.tolist() == [0, 0, 1, 1, 1, 2, 2, 2, 2]
    step = 1e-6 * np.eye(4)
    numeric = [(blocks.value(r + j @ s) - blocks.value(r - j @ s)) / 2e-6 for s in step]
    assert blocks.gradient(r, j) == pytest.approx(numeric, rel=1e-6)
    r[2:5] = 0.0  # fits exactly: without a slope, and without a division by zero
    rest = Blocks([2, 4])
    keep = [0, 1, 5, 6, 7, 8]
    assert blocks.gradient(r, j) == pytest.approx(rest.gradient(r[keep], j[keep]))


def test_shifted_reckons_as_if_one_solver_gave_what_another_gives() -> None:
    model = STRIPS["bias"]
    here = MembraneSolver().run(model, LAW)
    there = MembraneSolver().run(model, LAW.with_beta(1.1 * LAW.beta))
    u = np.array([0.5, 4.0, 10.0])
    objective = LoadObjective(model.elongations, u, [30.0, 200.0, 900.0], 900.0, 0.5)
    moved = objective.shifted(here, there)
    assert moved.residual(there) == pytest.approx(objective.residual(here))
    assert objective.load.tolist() == [30.0, 200.0, 900.0]
    assert np.linalg.norm(moved.residual(here) - objective.residual(here)) > 1e-3


def test_rows_and_scale_belong_to_their_tests() -> None:
    fit = joint()
    point = fit.evaluate(near(CUBIC, LAW), False)
    pieces = [fit.rows(k) for k in range(4)]
    assert np.r_[tuple(pieces)].tolist() == list(range(len(point.residual)))
    for experiment, rows, history in zip(fit.experiments, pieces, point.histories, strict=True):
        expected = experiment.objective.residual(history)
        assert point.residual[rows] == pytest.approx(expected)
        assert fit.scale[rows] == pytest.approx(experiment.objective.scale)


@pytest.mark.parametrize("parameters", [OFFSETS, CUBIC], ids=["offsets", "moduli"])
def test_jacobian_of_a_joint_fit_against_finite_differences(parameters: ModuliParameters) -> None:
    fit = joint(parameters)
    check_jacobian(fit, near(parameters, LAW))
    jacobian = fit.evaluate(near(parameters, LAW), True).jacobian
    for number in (1, 2, 3):  # nothing that a strip knows of
        assert not jacobian[fit.rows(number), parameters.size :].any()
        assert jacobian[fit.rows(number), : parameters.size].any()
    if parameters.nuisance:
        assert np.abs(jacobian[fit.rows(0), parameters.size :]).max(axis=0).all()


@pytest.mark.parametrize("form", FORMS)
def test_jacobian_of_strips_against_finite_differences(form: str) -> None:
    parameters, law = FORMS[form]
    check_jacobian(strips(parameters, law), near(parameters, law))


def check_jacobian(fit: FitProblem, y: np.ndarray) -> None:
    """Every column, of the residual and of e."""
    for experiment in fit.experiments:
        experiment.solver = MembraneSolver(TIGHT)
    point = fit.evaluate(y, True)
    assert point is not None and point.jacobian is not None
    assert point.jacobian.shape == (len(point.residual), len(y))
    slope = fit.blocks.gradient(point.residual, point.jacobian)
    size = np.abs(point.jacobian).max()
    for k in range(len(y)):
        step = 1e-4 * max(1.0, abs(y[k])) * np.eye(len(y))[k]
        ahead, behind = (fit.evaluate(y + s, False, warm=False) for s in (step, -step))
        assert ahead is not None and behind is not None
        column = (ahead.residual - behind.residual) / (2 * step[k])
        off = np.abs(point.jacobian[:, k] - column).max()
        assert off < 2e-5 * max(np.abs(column).max(), 1e-4 * size), k
        e_slope = (ahead.value - behind.value) / (2 * step[k])
        assert slope[k] == pytest.approx(e_slope, rel=1e-3, abs=1e-5 * np.abs(slope).max())


# Known solutions


def gauge_strains(fit: FitProblem) -> np.ndarray:
    """Strains that the gauges reach, (3,): where a strip test can know the moduli."""
    warp, fill, bias = (STRIPS[d] for d in ("warp", "fill", "bias"))
    ends = [np.log(1 + m.elongations[-1] / m.gauge_length) for m in (warp, fill, bias)]
    return np.array([ends[0], ends[1], ends[2]])


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("form", FORMS)
def test_strips_find_the_law_that_made_them(form: str, number: int) -> None:
    parameters, law = FORMS[form]
    fit = strips(parameters, law)
    found = levenberg_marquardt(fit, feasible_start(fit, 2, number), 1e-7, 100)
    assert found is not None and found.value < 1e-5, found
    error = moduli_error(law.with_beta(parameters.beta(found.best.unknowns)), law,
                         gauge_strains(fit))  # fmt: skip
    assert max(error.values()) < 1e-4, error


@pytest.mark.parametrize("number", range(3))
def test_bubble_and_strips_find_the_law_that_made_them(number: int) -> None:
    fit = joint()
    found = levenberg_marquardt(fit, feasible_start(fit, 2, number), 1e-9, 100)
    assert found is not None and found.value < 1e-7, found
    error = moduli_error(LAW.with_beta(found_beta(found)), LAW, gauge_strains(fit))
    assert max(error.values()) < 1e-4, error


def found_beta(found: Any) -> np.ndarray:
    return np.asarray(CUBIC.beta(found.best.unknowns))


def test_offsets_of_the_bubble_are_found_beside_the_strips() -> None:
    fit = joint(OFFSETS)
    shift, offset = np.array([0.2, -0.1, 0.8]), 0.003
    moved = MembraneSolver(TIGHT).run(BUBBLE, LAW, pressure_offset=offset).displacement + shift
    targets = [FieldTarget(p, u) for p, u in zip(BUBBLE.pressures, moved, strict=True)]
    fit.experiments[0].objective = FieldObjective(targets, weight=1 / 9)
    found = levenberg_marquardt(fit, near(OFFSETS, LAW, 1.1), 1e-9, 100)
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


# Bounds on the moduli


@pytest.mark.parametrize("form", FORMS)
def test_starts_have_moduli_between_the_bounds_and_the_box_holds_them(form: str) -> None:
    parameters, _ = FORMS[form]
    draws = parameters.draw(np.random.default_rng(1), 4000)
    room = 1e-9 * (parameters.upper - parameters.lower)
    assert (draws >= parameters.lower - room).all() and (draws <= parameters.upper + room).all()
    allowed = draws[parameters.allowed(draws)]
    assert len(allowed) > 20
    a, c = parameters.inequalities
    for coefficients in allowed[:100]:
        law = HypoelasticLaw(full(parameters, coefficients), 0.24, RANGE, "constant",
                             parameters.breaks)  # fmt: skip
        for name, (_, component) in MODULI.items():
            values = law.modulus(name, np.linspace(0, RANGE[component], 101))
            place = ("E1", "E2", "G12").index(name)
            dip = 0.007 * values.max()  # between the strains of the grid, see GRID
            assert values.min() >= LEAST[place] - dip and values.max() <= LARGEST[place] + dip
        assert (a @ parameters.unknowns(coefficients) >= c - 1e-9).all()
    for coefficients in draws[~parameters.allowed(draws)][:100]:
        assert (a @ parameters.unknowns(coefficients) < c).any()


def full(parameters: ModuliParameters, coefficients: np.ndarray) -> np.ndarray:
    beta = np.zeros(12)
    beta[parameters.places] = coefficients
    return beta


def test_no_analysis_of_a_fit_leaves_the_bounds() -> None:
    """Also where the data ask for more: E1 at its upper, E2 at its lower bound."""
    tight = ModuliParameters.between(
        3, RANGE, np.array([100.0, 150.0, 5.0]), np.array([700.0, 500.0, 300.0])
    )
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
def test_strips_keep_the_law_positive_definite(form: str) -> None:
    """E1 E2 > (nu12 E2)^2 with the modulus across at zero strain, because a strip contracts."""
    parameters, _ = FORMS[form]
    bounded = replace(parameters, strip_nu12=0.4)
    draws = parameters.draw(np.random.default_rng(4), 3000)
    a, c = bounded.inequalities
    agreed = {True: 0, False: 0}
    for coefficients in draws[parameters.allowed(draws)][:200]:
        law = HypoelasticLaw(full(parameters, coefficients), 0.4, RANGE, "constant",
                             parameters.breaks)  # fmt: skip
        grid = modulus_grid(RANGE, parameters.breaks) @ law.beta
        e2, e1 = grid[GRID : 2 * GRID], grid[2 * GRID :]
        worst = min((e1[0] / e2).min(), (e1 / e2[0]).min()) / 0.4**2
        inside = bool((a @ bounded.unknowns(coefficients) >= c - 1e-12).all())
        assert inside == (worst >= DEFINITE)
        agreed[inside] += 1
    assert min(agreed.values()) >= 5, agreed


# A solver without derivatives, led by the membrane


class Thicker:
    """Stands for another finite element program: 2 % thicker and wavy in the load, no slopes."""

    name, external = "thicker", True

    def __init__(self, fails: Sequence[int] = ()) -> None:
        self.fails, self.runs = tuple(fails), 0
        self.membrane = MembraneSolver(TIGHT)

    def run(self, model: Any, law: HypoelasticLaw, *unused: object) -> History:
        self.runs += 1
        if self.runs in self.fails:
            raise SolverFailure("on purpose", self.name)
        history = self.membrane.run(replace(model, thickness=1.02 * model.thickness), law)
        if not isinstance(model, UniaxialModel):
            return history
        wave = 1.0 + 0.01 * np.sin(np.arange(len(history.load)))
        return replace(history, load=wave * history.load)

    def check(self) -> SolverCheck:
        return SolverCheck(self.name, True, "1", True)


def led(fit: FitProblem, fails: Sequence[int] = ()) -> FitProblem:
    """The same tests, measured and run by the other program."""
    tests = []
    for experiment in fit.experiments:
        history, objective = Thicker().run(experiment.model, LAW), experiment.objective
        if isinstance(experiment.model, UniaxialModel):
            u = experiment.model.elongations
            objective = LoadObjective(u, u, history.load, float(history.load.max()))
        else:
            targets = [
                FieldTarget(p, u)
                for p, u in zip(BUBBLE.pressures, history.displacement, strict=True)
            ]
            objective = FieldObjective(targets, weight=1 / 9)
        tests.append(replace(experiment, solver=Thicker(fails), objective=objective))
    other = FitProblem(tuple(tests), LAW, fit.parameters)
    other.surrogate = other.led_by([MembraneSolver() for _ in tests])
    return other


@pytest.mark.parametrize("build", [strips, joint], ids=["strips", "joint"])
def test_the_membrane_leads_another_solver_of_strips(build: Any) -> None:
    fit = led(build())
    originals = [e.objective for e in fit.surrogate.experiments]
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found is not None and found.value < 1e-5 and found.runs <= 8
    assert {e.solver.runs for e in fit.experiments} == {found.runs}
    error = moduli_error(LAW.with_beta(found_beta(found)), LAW, gauge_strains(fit))
    assert max(error.values()) < 1e-3, error
    assert [e.objective for e in fit.surrogate.experiments] == originals


def test_a_failed_run_of_a_strip_shortens_the_step() -> None:
    fit = led(strips(), fails=(2,))
    told: list[tuple[float | None, str]] = []
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert told[1] == (None, "warp: on purpose") and found.value < 1e-3 * told[0][0]


# Failure


class Failing(MembraneSolver):
    """Ends badly at the runs named."""

    def __init__(self, runs: Sequence[int]) -> None:
        super().__init__()
        self.bad, self.runs = set(runs), 0

    def _analyse(self, *arguments: Any) -> Any:
        self.runs += 1
        if self.runs in self.bad:
            raise SolverFailure("on purpose")
        return super()._analyse(*arguments)


@pytest.mark.parametrize("number", range(4))
def test_a_test_that_fails_is_named_and_the_point_is_refused(number: int) -> None:
    fit = joint()
    told: list[tuple[float | None, str]] = []
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    fit.experiments[number].solver = Failing([1])
    y = near(CUBIC, LAW)
    assert fit.evaluate(y, True) is None
    assert told == [(None, f"{fit.experiments[number].name}: on purpose")]
    assert fit.evaluate(y, True) is not None and fit.analyses == 2


def test_a_single_strip_needs_no_name_in_its_failure() -> None:
    whole = strips()
    fit = FitProblem(whole.experiments[:1], LAW, CUBIC)
    told: list[str] = []
    fit.watch = lambda y, value, status, solver: told.append(status)
    fit.experiments[0].solver = Failing([1])
    fit.evaluate(near(CUBIC, LAW), False)
    assert told == ["on purpose"]


def test_a_fit_steps_round_strips_that_fail() -> None:
    fit = strips()
    fit.experiments[2].solver = Failing([3, 5, 6])
    found = levenberg_marquardt(fit, feasible_start(strips(), 2, 0), 1e-7, 150)
    assert found is not None and found.value < 1e-5


# What the tests determine


def test_certainty_predicts_the_scatter_of_noisy_strip_fits() -> None:
    """Linear propagation against twelve fits to freshly drawn noise, one constant a modulus."""
    noise, found, predicted = 5.0, [], None
    for seed in range(12):
        fit = strips(CONSTANTS, CONSTANT, noise=noise, seed=seed)
        point = fit.evaluate(near(CONSTANTS, CONSTANT, 1.0), True)
        best, _ = descend(fit, point, 1e-7, 10**6)
        found.append(best.coefficients)
        predicted = certainty(fit, best, CONSTANT, np.array([0.1, 0.1, 0.1]))
    scatter = np.std(found, axis=0, ddof=1) / [20.0, 200.0, 500.0]
    sigma = [predicted.sigma[name][0] for name in ("G12", "E2", "E1")]
    assert scatter == pytest.approx(sigma, rel=0.6)
    assert set(predicted.noise) == set(STRIPS)
    assert np.mean(list(predicted.noise.values())) == pytest.approx(noise, rel=0.4)


def test_what_each_data_set_pins_down() -> None:
    fit = joint(noise=10.0, bubble_noise=0.1)
    point = fit.evaluate(CUBIC.unknowns(LAW.beta), True)
    reached = np.array([0.1, 0.1, 0.3])
    bubble, uniaxial, both = (
        pinned_by(fit, point, LAW, reached, tests) for tests in ([0], [1, 2, 3], [0, 1, 2, 3])
    )
    for name in MODULI:
        assert (both[name] <= bubble[name] * (1 + 1e-6)).all()
        assert (both[name] <= uniaxial[name] * (1 + 1e-6)).all()
    worst = {name: sigma.max() for name, sigma in bubble.items()}
    assert worst["G12"] > 2 * max(worst["E1"], worst["E2"])
    assert uniaxial["G12"].max() < 0.2 * bubble["G12"].max()
    # A pull along the warp says nothing of the fill or of shear.
    warp = pinned_by(fit, point, LAW, reached, [1])
    assert warp["E1"].max() < 0.5
    assert min(warp["E2"].min(), warp["G12"].min()) > 1.0


# The way to a joint fit


def test_strips_lead_into_a_joint_fit() -> None:
    """First the strips alone, told as such and counted; then all tests from their optimum."""
    fit = replace(joint(noise=5.0, bubble_noise=0.1), lead_in=((1, 2), (1, 2, 3)))
    told: list[tuple[float | None, str]] = []
    start = feasible_start(fit, 2, 0)
    fit.reset()
    fit.watch = lambda y, value, status, solver: told.append((value, status))
    y = approach(fit, start, 1e-7, 100)
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
    fit = replace(joint(), lead_in=((1, 2), (1, 2, 3)))
    start = near(CUBIC, LAW)
    fit.experiments[0].solver = Failing([1])  # the bubble, at the optimum of the strips
    assert (approach(fit, start, 1e-7, 100) == start).all()
    fit.experiments[1].solver = Failing(range(1, 1000))
    assert (approach(fit, start, 1e-7, 100) == start).all()
    assert (approach(joint(), start, 1e-7, 100) == start).all()


def test_the_surrogate_of_a_joint_fit_leads_in_too() -> None:
    fit = led(joint())
    fit.surrogate.lead_in = ((1, 2), (1, 2, 3))
    told: list[tuple[str, str]] = []
    for problem in (fit, fit.surrogate):
        problem.watch = lambda y, value, status, solver: told.append((solver, status))
    found = fit_from(fit, feasible_start(fit, 2, 1), FitOptions())
    assert found.value < 1e-5
    alone = [solver for solver, status in told if " alone: " in status]
    assert alone and set(alone) == {"membrane"}
    assert replace(joint(), lead_in=((1, 2),)).led_by([MembraneSolver()] * 4).lead_in == ((1, 2),)
