"""inference/methods/lm.py: Levenberg-Marquardt on bubbles, past failures and instability."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.descent import descend
from bubblefit.inference.methods import FitOptions, lm
from bubblefit.inference.reported import moduli_error
from bubblefit.inference.search import allowed, feasible_start, fit_from
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..cases import (
    CUBIC,
    LAW,
    PRESSURES,
    Failing,
    bubble_problem,
    fitted_by_lm,
    one_comparison_problem,
    reference,
    targets,
)


@pytest.mark.parametrize("number", range(4))
def test_lm_finds_the_known_solution(number):
    fit = bubble_problem()
    optimum = fitted_by_lm(fit, feasible_start(fit, 1, number), 1e-7, 100)
    assert optimum.status == "converged" and optimum.value < 1e-6
    assert optimum.analyses == fit.analyses <= 60
    error = moduli_error(LAW.with_beta(optimum.coefficients), LAW, reference().strain_max)
    assert error["E1"] < 1e-4 and error["E2"] < 1e-4 and error["G12"] < 1e-3
    assert allowed(CUBIC, optimum.coefficients[None]).all()


@pytest.mark.parametrize("how", ["failure", "nan"])
def test_lm_steps_round_failed_analyses(how):
    fit = bubble_problem()
    start = feasible_start(fit, 1, 3)
    fit.comparisons[0].solver = Failing(lambda run: run % 4 == 2, how)
    optimum = fitted_by_lm(fit, start, 1e-7, 150)
    assert optimum is not None and optimum.value < 1e-6


@pytest.mark.parametrize("seed, number", [(3, 41), (4, 10), (5, 10), (6, 1), (3, 43)])
def test_lm_gets_past_folded_membranes(seed, number):
    """The example's mesh and starts, of 400, that ended at a folded membrane or met it most."""
    model = BubbleModel(
        disk_mesh(100.0, 800, "quarter"), 0.81, PRESSURES, default_increments(PRESSURES)
    )
    fields = MembraneSolver().run(model, LAW).displacement
    fit = one_comparison_problem(
        model, MembraneSolver(), LAW, FieldObjective(targets(fields)), CUBIC
    )
    optimum = fitted_by_lm(fit, feasible_start(fit, seed, number), 1e-7, 100)
    assert fit.last_unstable > 0
    assert optimum is not None and optimum.value < 1e-6 and optimum.best.stable


@pytest.mark.parametrize(("number", "at_border"), [(1, False), (2, True)])
def test_lm_restarts_at_the_border_end_early_with_equal_result(monkeypatch, number, at_border):
    fit, ends = bubble_problem(noise=0.1), []
    start = feasible_start(fit, 1, number)
    for limit in (lm.SETTINGS.same_squares, -1.0):  # the latter is never near enough
        monkeypatch.setattr(lm, "SETTINGS", replace(lm.SETTINGS, same_squares=limit))
        fit.reset()
        ends.append(fitted_by_lm(fit, start, 1e-7, 200))
        assert fit.last_unstable > 0
    early, late = ends
    assert late.analyses - early.analyses >= 5 if at_border else late.analyses == early.analyses
    assert early.value == pytest.approx(late.value, rel=1e-6)
    law, other = (LAW.with_beta(end.coefficients) for end in ends)
    assert max(moduli_error(law, other, reference().strain_max).values()) < 1e-3


def test_lm_reweights_blocks_to_lower_e_on_noisy_data():
    """Least squares of the blocks is not the least e; the second stage goes on to that."""
    fit = bubble_problem(noise=0.1)
    truth = fit.evaluate(CUBIC.at(LAW.beta), False).value
    start = feasible_start(fit, 1, 0)
    first, status = descend(fit, fit.evaluate(start, True), 1e-7, 100)
    assert status == "settled"
    fit.reset()
    whole = fitted_by_lm(fit, start, 1e-7, 200)
    assert whole.value < first.value * (1 - 1e-6) and 0.9 * truth < whole.value < truth
    # At the least of e no feasible direction goes down: compare with SLSQP from there.
    options = FitOptions("slsqp", max_analyses=fit.analyses + 80)
    polished = fit_from(fit, whole.best.unknowns, options)
    assert whole.value == pytest.approx(polished.value, rel=2e-3)


def test_second_stage_has_all_analyses_of_the_start():
    """The least |z0| of a prior is a kink, to which the second stage goes in many small steps."""
    heights = [8.7, 10.93, 12.6, 13.87, 14.93, 15.94, 16.8, 17.55, 18.32, 18.96]
    bubble = bf.Bubble.heights(
        np.linspace(0.01, 0.1, 10),
        heights,
        radius=100.0,
        elements=108,
        symmetry="quarter",
        sheet=bf.Sheet(modes=1, prior=0.5),
    )
    bounds = {"E1": [100, 2600], "G12": [1, 200]}
    law = bf.Law("constant", symmetry="balanced", bounds=bounds, strain_range=[0.02, 0.02, 0.017])
    fabric = bf.Fabric("apex", thickness=0.8)
    with pytest.warns(bf.BubblefitWarning, match="G12"):
        fit = bf.fit([bubble], law, fabric=fabric, starts=1, seed=3, jobs=1)
    (start,) = fit.best.ranked
    assert start.status == "converged" and 51 < start.analyses < 99
