"""Residuals of strips: RMS errors as printed, weights, blocks, derivatives."""

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.strips.prepared import LoadObjective
from bubblefit.inference.comparison import Blocks
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import Unknowns
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CubicSpline

from .problems import CUBIC, FORMS, LAW, SHIFTED, STRIPS, TIGHT, joint, near, strips


def test_the_objective_is_the_sum_of_rms_errors_as_printed():
    """Eqs 3.4 to 3.7: RMS of the differences, in N, direction by direction."""
    fit = strips(law=LAW)
    point = fit.evaluate(near(CUBIC, LAW), False)
    total = 0.0
    for experiment, history in zip(fit.comparisons, point.histories, strict=True):
        difference = history.load - experiment.objective.load
        rms = np.sqrt(np.sum(difference**2) / len(difference))
        assert rms > 1.0
        assert experiment.objective.rms(history) == pytest.approx(rms)
        total += rms
    assert point.value == pytest.approx(total)


def test_loads_between_the_increments_lie_on_a_spline_from_the_origin():
    model = STRIPS["warp"]
    history = MembraneSolver().run(model, LAW)
    u = np.array([0.0, 0.111, 0.7, 0.71, 2.9, model.elongations[-1]])
    objective = LoadObjective(model.elongations, u, np.zeros(6))
    spline = CubicSpline([0.0, *model.elongations], [0.0, *history.load])
    assert objective.modelled(history) == pytest.approx(spline(u))
    assert objective.modelled(history)[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scale, weight", [(1.0, 2.0), (1400.0, 1.0), (1400.0, 0.25)])
def test_scale_and_weight_of_a_strip(scale: float, weight: float):
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
    [
        ([], "no point"),
        ([-0.1], "expected elongations from 0 to 3.307 mm, got -0.1$"),
        ([3.4], "got 3.4$"),
        ([1.0, 1e6], "1e\\+06"),
    ],
)
def test_load_curves_outside_the_model_are_refused(elongation: list[float], words: str):
    with pytest.raises(InputError, match=words):
        LoadObjective(STRIPS["warp"].elongations, elongation, np.zeros(len(elongation)))


def test_an_elongation_at_the_model_s_end_is_inside_it():
    """Also where another sum of the same steps is larger by rounding."""
    end = float(STRIPS["warp"].elongations[-1])
    objective = LoadObjective(STRIPS["warp"].elongations, [0.0, end * (1 + 1e-12)], np.zeros(2))
    assert objective.sample[1] == pytest.approx([*[0.0] * 9, 1.0], abs=1e-9)
    assert objective.unit == "N"


def test_blocks():
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


def test_shifted_reckons_as_if_one_solver_gave_what_another_gives():
    model = STRIPS["bias"]
    here = MembraneSolver().run(model, LAW)
    there = MembraneSolver().run(model, LAW.with_beta(1.1 * LAW.beta))
    u = np.array([0.5, 4.0, 10.0])
    objective = LoadObjective(model.elongations, u, [30.0, 200.0, 900.0], 900.0, 0.5)
    moved = objective.shifted(here, there)
    assert moved.residual(there) == pytest.approx(objective.residual(here))
    assert objective.load.tolist() == [30.0, 200.0, 900.0]
    assert np.linalg.norm(moved.residual(here) - objective.residual(here)) > 1e-3


def test_rows_and_scale_belong_to_their_tests():
    fit = joint()
    point = fit.evaluate(near(CUBIC, LAW), False)
    pieces = [fit.rows(k) for k in range(4)]
    assert np.r_[tuple(pieces)].tolist() == list(range(len(point.residual)))
    for experiment, rows, history in zip(fit.comparisons, pieces, point.histories, strict=True):
        expected = experiment.objective.residual(history)
        assert point.residual[rows] == pytest.approx(expected)
        assert fit.scale[rows] == pytest.approx(experiment.objective.scale)


@pytest.mark.parametrize("unknowns", [SHIFTED, CUBIC], ids=["offsets", "moduli"])
def test_jacobian_of_a_joint_fit_against_finite_differences(unknowns: Unknowns):
    fit = joint(unknowns)
    check_jacobian(fit, near(unknowns, LAW))
    jacobian = fit.evaluate(near(unknowns, LAW), True).jacobian
    for number in (1, 2, 3):  # nothing that a strip knows of
        assert not jacobian[fit.rows(number), unknowns.size :].any()
        assert jacobian[fit.rows(number), : unknowns.size].any()
    if unknowns.nuisance_names:
        assert np.abs(jacobian[fit.rows(0), unknowns.size :]).max(axis=0).all()


@pytest.mark.parametrize("form", FORMS)
def test_jacobian_of_strips_against_finite_differences(form: str):
    unknowns, law = FORMS[form]
    check_jacobian(strips(unknowns, law), near(unknowns, law))


def check_jacobian(fit: FitProblem, y: np.ndarray):
    """Every column, of the residual and of e."""
    for experiment in fit.comparisons:
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
