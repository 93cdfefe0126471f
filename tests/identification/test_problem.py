"""A fit as a function of its unknowns: residual, Jacobian, what is told of an analysis."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.unknowns import Unknowns
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CONSTANT, CUBIC, EVERYTHING, LAW, MODEL, Failing, problem, single, targets


@pytest.mark.parametrize("unknowns", [CUBIC, EVERYTHING, CONSTANT], ids=["12", "16", "3"])
def test_jacobian_against_finite_differences(unknowns: Unknowns) -> None:
    """Through the whole chain: solver, Chebyshev values, units, nuisance parameters."""
    fit = problem(unknowns, noise=0.02)
    fit.comparisons[0].solver = MembraneSolver(1e-10)
    coefficients = LAW.beta[list(unknowns.free)] * 1.02
    y = unknowns.at(coefficients)
    if unknowns.nuisance_names:
        y[unknowns.size :] = [0.3, -0.2, 0.5, 1.5]
    point = fit.evaluate(y, True)
    assert point is not None and point.jacobian is not None
    assert point.jacobian.shape == (len(point.residual), len(y))
    slope = fit.blocks.gradient(point.residual, point.jacobian)
    for j in range(len(y)):
        step = 1e-4 * max(1.0, abs(y[j]))
        ahead, behind = (
            fit.evaluate(y + s * np.eye(len(y))[j], False, warm=False) for s in (step, -step)
        )
        column = (ahead.residual - behind.residual) / (2 * step)
        assert np.abs(point.jacobian[:, j] - column).max() < 2e-5 * np.abs(column).max()
        e_slope = (ahead.value - behind.value) / (2 * step)
        assert slope[j] == pytest.approx(e_slope, rel=1e-3, abs=1e-5 * np.abs(slope).max())


def test_nuisance_parameters_do_what_they_say() -> None:
    """A shift of the data in z and of the pressure is taken back by the offsets."""
    offset, shift = 0.003, np.array([0.2, -0.1, 1.0])
    moved = MembraneSolver(1e-10).run(MODEL.with_parameters({"pressure_offset": offset}), LAW)
    objective = FieldObjective(targets(moved.displacement + shift))
    fit = single(MODEL, MembraneSolver(1e-10), LAW, objective, EVERYTHING)
    y = EVERYTHING.at(LAW.beta)
    y[12:] = [*shift, 1e3 * offset]
    assert fit.evaluate(y, False).value < 1e-7
    assert EVERYTHING.nuisance_names == ("offset_x", "offset_y", "offset_z", "pressure_offset")


def test_watch_hears_of_every_analysis() -> None:
    heard: list[tuple[float | None, str]] = []
    fit = problem(watch=lambda y, value, status, solver: heard.append((value, status)))
    fit.comparisons[0].solver = Failing(lambda run: run == 2)
    y = CUBIC.at(LAW.beta)
    fit.evaluate(y, True)
    assert fit.evaluate(y, False) is None
    assert len(heard) == fit.analyses == 2
    assert heard[0][1] == "ok" and heard[1] == (None, "on purpose")
