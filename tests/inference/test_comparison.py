"""inference/comparison.py: a model, its solver and its objective run together."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.inference.comparison import WarmStart
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import LAW, TIGHT, two_bubbles


def test_warm_start_is_near_by_or_the_same():
    """A path may change by a fiftieth of its largest value, with derivatives."""
    start = WarmStart(np.array([1.0, 2.0]), np.array([10.0, -50.0]), np.array([[3.0, 0.0], [0, 9]]))
    np.testing.assert_allclose(start.guess(np.array([1.3, 2.1])), [10.9, -49.1])
    assert start.guess(np.array([1.34, 2.0])) is None
    assert start.guess(np.array([1.0, 1.88])) is None
    without = replace(start, slope=None)
    assert without.guess(np.array([1.0, 2.0])) is start.path
    assert without.guess(np.array([1.0, 2.0 + 1e-9])) is None


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
