"""inference/objective.py: members of an objective that have a default."""

import numpy as np
import pytest
from bubblefit.inference.assessment import discrepancies
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.noise import Noise, correlated_count_of, misfits
from bubblefit.inference.objective import Blocks, Objective
from bubblefit.inference.resampling import rows_of
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.refusals import complaint
from .cases import CUBIC, LAW, MODEL, one_comparison_problem


class HeightOfTheApex(Objective):
    """Rise of the highest node at each pressure, mm: the members without a default only."""

    unit, least_noise = "mm", 0.1
    sizes = (len(MODEL.pressures),)
    scale = np.full(len(MODEL.pressures), 2.0)

    @property
    def data(self):
        return (np.full(len(MODEL.pressures), 20.0),)

    def residual(self, history, nuisance):
        return (history.displacement[:, :, 2].max(axis=1) - self.data[0]) / self.scale

    def jacobian(self, history, slope):
        apex = history.displacement[:, :, 2].argmax(axis=1)
        rises = slope[np.arange(len(apex)), apex, 2]
        return rises / self.scale[:, None]

    def shifted(self, external, surrogate):
        return self


def test_objective_has_defaults_for_optional_members():
    objective = HeightOfTheApex()
    fit = one_comparison_problem(MODEL, MembraneSolver(), LAW, objective, CUBIC)
    point = fit.evaluate(CUBIC.at(LAW.beta), True)
    assert point.jacobian.shape == (len(MODEL.pressures), 12)
    (misfit,) = misfits(fit, point.residual).values()
    assert misfit.noise_is == "assumed" and misfit.noise == 0.1
    assert correlated_count_of(objective, point.residual) == 1.0
    assert Noise.from_residual(fit, point.residual).correlated_count == {"bubble": 1.0}
    assert discrepancies(fit, point.residual, None, point, lambda step: 0.0) == {}
    points = {"bubble": np.ones(len(MODEL.pressures), dtype=bool)}
    assert "bubble does not tell which of its values" in complaint(rows_of, fit, points)


def test_objective_without_a_residual_cannot_be_made():
    class Empty(Objective):
        unit = "mm"

    with pytest.raises(TypeError, match="abstract"):
        Empty()
    assert Comparison("bubble", MODEL, MembraneSolver(), HeightOfTheApex()).nuisance == ()


def test_block_that_fits_exactly_has_no_slope():
    random = np.random.default_rng(8)
    r, j = random.standard_normal(9), random.standard_normal((9, 4))
    r[2:5] = 0.0
    keep = [0, 1, 5, 6, 7, 8]
    rest = Blocks([2, 4]).gradient(r[keep], j[keep])
    assert Blocks([2, 3, 4]).gradient(r, j) == pytest.approx(rest)


def test_gram_of_blocks_leaves_out_unknowns_on_which_none_depends():
    random = np.random.default_rng(0)
    r, j = random.standard_normal(9), random.standard_normal((9, 4))
    j[:5, 2:] = 0.0
    blocks = Blocks([2, 3, 4], columns=[np.arange(2), np.arange(2), np.arange(4)])
    weights = np.array([2.0, 0.5, 3.0])
    rows = j * np.sqrt(weights)[blocks.block_of][:, None]
    for of_blocks in (blocks, Blocks([2, 3, 4])):
        np.testing.assert_allclose(of_blocks.gram(j, weights), rows.T @ rows)
        gradients = of_blocks.gradients(r, j)
        assert gradients.sum(axis=0) == pytest.approx(j.T @ r)
        assert gradients[1] == pytest.approx(j[2:5].T @ r[2:5])
