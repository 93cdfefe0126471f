"""Comparisons with unknowns of their own: who they belong to, what they are called."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.inference.comparison import Comparison, Nuisance
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import Unknowns
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..complaints import complaint
from .cases import CUBIC, LAW, RANGE, levenberg_marquardt

TIGHT = 1e-10
PRESSURE = Nuisance("pressure_offset", -18.0, 50.0, "kPa", "pressure_offset", 1e-3)
SHIFTS = tuple(Nuisance(f"offset_{axis}", -20.0, 20.0, "mm") for axis in "xyz")
SMALL = BubbleModel(disk_mesh(100.0, 96, "quarter"), 0.81, [0.05, 0.12, 0.2])
OTHER = BubbleModel(disk_mesh(80.0, 96, "quarter"), 0.81, [0.06, 0.15])


def comparison(name: str, model: BubbleModel, *nuisance: Nuisance, **other: Any) -> Comparison:
    """Data of the known law, a little disturbed."""
    fields = MembraneSolver(TIGHT).run(model, LAW).displacement
    fields = fields + 0.02 * np.random.default_rng(5).standard_normal(fields.shape)
    objective = FieldObjective(targets_of(model, fields))
    return Comparison(name, model, MembraneSolver(TIGHT), objective, nuisance, **other)


def targets_of(model: BubbleModel, fields: np.ndarray) -> list[Any]:
    return [FieldTarget(p, u) for p, u in zip(model.pressures, fields, strict=True)]


def fit_of(*comparisons: Comparison) -> FitProblem:
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, comparisons)
    return FitProblem(comparisons, LAW, unknowns)


def two() -> FitProblem:
    """The nuisance of the first: what the objective knows on both sides of what the solver does."""
    first = comparison("bubble 1", SMALL, SHIFTS[2], PRESSURE, SHIFTS[0])
    return fit_of(first, comparison("bubble 2", OTHER, PRESSURE))


def test_nuisance_belongs_to_its_comparison_and_is_called_so() -> None:
    fit = two()
    assert fit.unknowns.nuisance_names == (
        "bubble 1: offset_z",
        "bubble 1: pressure_offset",
        "bubble 1: offset_x",
        "bubble 2: pressure_offset",
    )
    assert fit.unknowns.count == 16
    y = np.concatenate([np.ones(12), [0.1, 2.0, 0.3, -4.0]])
    assert fit.unknowns.nuisance_values("bubble 1", y) == {
        "offset_z": 0.1,
        "pressure_offset": 2.0,
        "offset_x": 0.3,
    }
    assert fit.unknowns.nuisance_values("bubble 2", y) == {"pressure_offset": -4.0}
    assert fit.unknowns.nuisance_values("bubble 3", y) == {}
    alone = fit_of(comparison("bubble 1", SMALL, PRESSURE))
    assert alone.unknowns.nuisance_names == ("pressure_offset",)


def test_every_derivative_of_two_comparisons_with_nuisance_each() -> None:
    fit = two()
    y = fit.unknowns.at(LAW.beta * 1.02)
    y[12:] = [0.5, 1.5, -0.3, -2.0]
    point = fit.evaluate(y, True)
    assert point is not None and point.jacobian is not None
    assert point.jacobian.shape == (len(point.residual), 16)
    for k in range(16):
        step = 1e-4 * max(1.0, abs(y[k])) * np.eye(16)[k]
        ahead, behind = (fit.evaluate(y + s, False, warm=False) for s in (step, -step))
        column = (ahead.residual - behind.residual) / (2 * step[k])
        assert np.abs(point.jacobian[:, k] - column).max() < 2e-5 * np.abs(column).max(), k
    own = fit.rows(0), fit.rows(1)
    assert not point.jacobian[own[1], 12:15].any() and not point.jacobian[own[0], 15].any()
    assert point.jacobian[own[0], 12:15].any(axis=0).all() and point.jacobian[own[1], 15].any()


def test_both_offsets_and_the_law_are_found() -> None:
    fit = two()
    truth = {"bubble 1": (0.8, 2.0, 0.2), "bubble 2": (-3.0,)}
    for one in fit.comparisons:
        values = dict(zip((n.name for n in one.nuisance), truth[one.name], strict=True))
        offset = {"pressure_offset": 1e-3 * values["pressure_offset"]}
        moved = one.solver.run(one.model.with_parameters(offset), LAW)
        shift = [values.get(f"offset_{axis}", 0.0) for axis in "xyz"]
        one.objective = FieldObjective(targets_of(one.model, moved.displacement + shift))
    optimum = levenberg_marquardt(fit, fit.unknowns.at(LAW.beta * 1.05), 1e-8, 60)
    assert optimum.value < 1e-7
    assert optimum.best.unknowns[12:] == pytest.approx([0.8, 2.0, 0.2, -3.0], abs=1e-4)


def test_nuisance_stays_inside_its_bounds() -> None:
    unknowns = two().unknowns
    a, c = unknowns.inequalities
    y = unknowns.at(LAW.beta)
    assert (a @ y >= c).all()
    for k, end in ((12, 20.1), (13, -18.1), (14, -20.1), (15, 50.1)):
        outside = y.copy()
        outside[k] = end
        assert (a @ outside < c).any()


class Plain:
    """A solver without derivatives, which is given a model, not an offset."""

    name, external = "plain", True

    def run(self, model: Any, law: Any, *unused: Any) -> History:
        return MembraneSolver(TIGHT).run(model, law)


def test_a_solver_without_derivatives_runs_a_model_with_the_offset() -> None:
    fit = two()
    plain = fit.with_solvers([Plain(), Plain()])
    y = fit.unknowns.at(LAW.beta)
    y[12:] = [0.5, 1.5, -0.3, -2.0]
    expected = fit.evaluate(y, False, warm=False).residual
    assert plain.evaluate(y, False).residual == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert fit.differentiates and not plain.differentiates
    with pytest.raises(SolverFailure, match="no derivatives"):
        plain.comparisons[0].differentiate(LAW, range(12), {"pressure_offset": 0.0}, False)


def test_a_problem_says_what_does_not_go_together() -> None:
    first, second = comparison("bubble 1", SMALL, PRESSURE), comparison("bubble 2", OTHER)
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, [second])
    assert "nuisance of bubble 1" in complaint(FitProblem, (first, second), LAW, unknowns)
    assert "a name of their own" in complaint(FitProblem, (second, second), LAW, unknowns)
    assert "expected comparisons" in complaint(FitProblem, (), LAW, unknowns)
    with pytest.raises(InputError, match="knows no tilt"):
        second.objective.nuisance_columns(["tilt"])


def test_what_contracts_asks_for_a_positive_definite_law() -> None:
    strip = comparison("strip", SMALL, contracts=True)
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, [strip])
    assert unknowns.definite_nu12 == 0.24 and CUBIC.definite_nu12 is None
    assert len(unknowns.inequalities[0]) > len(CUBIC.inequalities[0])
    assert (
        replace(unknowns, definite_nu12=None).inequalities[0].shape == CUBIC.inequalities[0].shape
    )


def test_only_a_near_guess_is_a_warm_start() -> None:
    """A change of at most a fiftieth of the largest displacement, whichever way."""
    plain = Comparison("bar", None, Plain(), None)  # type: ignore[arg-type]
    assert plain._guess(np.zeros(2)) is None
    path = np.array([[0.5, -4.0], [1.0, 2.0]])
    slope = np.zeros((2, 2, 1))
    slope[0, 1, 0] = 1.0
    plain._last = np.array([3.0]), path, slope
    for change in (0.0799, -0.0799):
        guess = plain._guess(np.array([3.0 + change]))
        assert guess is not None
        np.testing.assert_allclose(guess, [[0.5, -4.0 + change], [1.0, 2.0]])
    plain._last = np.array([0.0]), path, slope
    assert plain._guess(np.array([0.08])) is not None  # the limit itself
    for change in (0.0801, -0.0801, 5.0):
        assert plain._guess(np.array([change])) is None
    plain.forget()
    assert plain._guess(np.zeros(1)) is None


def test_limits_of_a_comparison_that_is_not_told_otherwise() -> None:
    plain = Comparison("bar", None, Plain(), None)  # type: ignore[arg-type]
    assert (plain.stage, plain.contracts, plain.must_be_stable) == (0, False, True)
