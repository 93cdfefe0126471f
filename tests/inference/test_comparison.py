"""inference/comparison.py: a model, its solver and its objective run together."""

import pytest
from bubblefit.errors import SolverFailure
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import LAW, TIGHT, two_bubbles


class Plain:
    name, external = "plain", True

    def run(self, model, law, *unused):
        return MembraneSolver(TIGHT).run(model, law)


def test_solver_without_derivatives_runs_the_model_with_its_offset():
    fit = two_bubbles()
    plain = fit.with_solvers([Plain(), Plain()])
    y = fit.unknowns.at(LAW.beta)
    y[12:] = [0.5, 1.5, -0.3, -2.0]
    expected = fit.evaluate(y, False, warm=False).residual
    assert plain.evaluate(y, False).residual == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert fit.differentiates and not plain.differentiates
    with pytest.raises(SolverFailure, match="no derivatives"):
        plain.comparisons[0].differentiate(LAW, range(12), {"pressure_offset": 0.0}, False)
