"""Levenberg-Marquardt on a quarter bubble of 45 quads with a known solution."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.assessment import moduli_error
from bubblefit.inference.methods.base import FitOptions
from bubblefit.inference.methods.descent import descend
from bubblefit.inference.search import feasible_start, fit_from
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import (
    CONSTANT,
    CUBIC,
    EVERYTHING,
    LAW,
    MODEL,
    PRESSURES,
    Failing,
    levenberg_marquardt,
    problem,
    reference,
    single,
    targets,
)

known = pytest.mark.parametrize("number", range(4))


def reached_error(coefficients: np.ndarray) -> dict[str, float]:
    return moduli_error(LAW.with_beta(coefficients), LAW, reference().strain_max)


@known
def test_levenberg_marquardt_finds_the_known_solution(number: int) -> None:
    fit = problem()
    optimum = levenberg_marquardt(fit, feasible_start(fit, 1, number), 1e-7, 100)
    assert optimum is not None and optimum.status == "converged"
    assert optimum.value < 1e-6
    assert optimum.analyses == fit.analyses <= 60
    error = reached_error(optimum.coefficients)
    assert error["E1"] < 1e-4 and error["E2"] < 1e-4 and error["G12"] < 1e-3
    assert CUBIC.is_positive(optimum.coefficients)


@pytest.mark.parametrize("how", ["failure", "nan"])
def test_levenberg_marquardt_steps_round_failures(how: str) -> None:
    fit = problem()
    start = feasible_start(fit, 1, 3)
    fit.comparisons[0].solver = Failing(lambda run: run % 4 == 2, how)
    optimum = levenberg_marquardt(fit, start, 1e-7, 150)
    assert optimum is not None and optimum.value < 1e-6


@pytest.mark.parametrize("seed, number", [(3, 41), (4, 10), (5, 10), (6, 1), (3, 43)])
def test_fits_that_meet_instability_get_past_it(seed: int, number: int) -> None:
    """The example's mesh and starts, of 400, that ended at a folded membrane or met it most."""
    model = BubbleModel(
        disk_mesh(100.0, 800, "quarter"), 0.81, PRESSURES, default_increments(PRESSURES)
    )
    fields = MembraneSolver().run(model, LAW).displacement
    fit = single(model, MembraneSolver(), LAW, FieldObjective(targets(fields)), CUBIC)
    optimum = levenberg_marquardt(fit, feasible_start(fit, seed, number), 1e-7, 100)
    assert fit.unstable > 0
    assert optimum is not None and optimum.value < 1e-6 and optimum.best.stable


def test_linear_orthotropic_constants_are_recovered() -> None:
    """Degree 0: three constants."""
    law = HypoelasticLaw.linear(400.0, 250.0, 12.0)
    fields = MembraneSolver(1e-10).run(MODEL, law).displacement
    objective = FieldObjective(targets(fields))
    fit = single(MODEL, MembraneSolver(), law, objective, CONSTANT)
    for number in range(3):
        fit.reset()
        optimum = levenberg_marquardt(fit, feasible_start(fit, 7, number), 1e-7, 60)
        assert optimum is not None and optimum.value < 1e-6
        assert optimum.coefficients == pytest.approx([12.0, 250.0, 400.0], rel=1e-5)


def test_offsets_are_recovered_with_the_moduli() -> None:
    shift, offset = np.array([0.0, 0.0, 0.8]), 0.002
    moved = MembraneSolver(1e-10).run(MODEL.with_parameters({"pressure_offset": offset}), LAW)
    objective = FieldObjective(targets(moved.displacement + shift))
    fit = single(MODEL, MembraneSolver(), LAW, objective, EVERYTHING)
    optimum = levenberg_marquardt(fit, feasible_start(fit, 1, 0), 1e-7, 100)
    assert optimum is not None and optimum.value < 1e-6
    assert optimum.best.unknowns[12:] == pytest.approx([*shift, 1e3 * offset], abs=1e-4)


def test_reweighting_lowers_e_on_noisy_data() -> None:
    """Least squares of the blocks is not the least e; the second stage goes on to that."""
    fit = problem(noise=0.1)
    start = feasible_start(fit, 1, 0)
    point = fit.evaluate(start, True)
    first, status = descend(fit, point, 1e-7, 100)
    assert status == "settled"
    fit.reset()
    whole = levenberg_marquardt(fit, start, 1e-7, 200)
    assert whole is not None and whole.value < first.value * (1 - 1e-6)
    # At the least of e no feasible direction goes down: compare with SLSQP from there.
    options = FitOptions("slsqp", max_analyses=fit.analyses + 80)
    polished = fit_from(fit, whole.best.unknowns, options)
    assert whole.value == pytest.approx(polished.value, rel=2e-3)


def test_noise_in_e_is_about_what_was_put_in() -> None:
    fit = problem(noise=0.1)
    truth = fit.evaluate(CUBIC.at(LAW.beta), False).value
    optimum = levenberg_marquardt(fit, CUBIC.at(LAW.beta), 1e-7, 100)
    assert optimum is not None and 0.9 * truth < optimum.value < truth
