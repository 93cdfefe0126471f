"""inference/descent.py: steps with curvature of the residuals."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.inference import descent
from bubblefit.inference.descent import DescentSettings, descend
from bubblefit.inference.objective import Blocks
from bubblefit.inference.problem import Evaluation

PRECISE = DescentSettings(negligible_decrease=1e-12)


class BrownAndDennis:
    """Their function (J. J. More and others, ACM Trans. Math. Softw. 7 (1981) 17, no. 16).

    20 residuals of four unknowns of which much is left, in two blocks; bounds are far.
    """

    start = np.array([25.0, 5.0, -5.0, -1.0])

    def __init__(self):
        self.blocks, self.analyses = Blocks([10, 10]), 0
        wide = np.vstack([np.eye(4), -np.eye(4)]), np.full(8, -1e6)
        self.unknowns = SimpleNamespace(inequalities=wide, within_work=lambda y: True)

    def evaluate(self, y, with_jacobian):
        self.analyses += 1
        t = np.arange(1, 21) / 5
        a, b = y[0] + y[1] * t - np.exp(t), y[2] + y[3] * np.sin(t) - np.cos(t)
        slopes = 2 * np.column_stack([a, a * t, b, b * np.sin(t)])
        r = a**2 + b**2
        return Evaluation(y, y, r, self.blocks.value(r), slopes, ())


@pytest.mark.parametrize(
    ("norms", "most"), [pytest.param(False, 40, id="squares"), pytest.param(True, 40, id="norms")]
)
def test_descent_with_curvature_reaches_published_minimum_of_brown_and_dennis(
    monkeypatch, norms, most
):
    """Published is the least sum of squares, 85822.2; the least of the norms is Nelder-Mead's."""
    least = [85822.2, 394.155168][norms]
    for without in (False, True):
        if without:
            monkeypatch.setattr(descent, "_is_positive_definite", lambda matrix: False)
        own = BrownAndDennis()
        point = own.evaluate(own.start, True)
        end, _ = descend(own, point, 1e-9, 200, norms, settings=PRECISE)
        value = end.value if norms else np.sum(end.residual**2)
        assert (value > 2 * least) if without else (value == pytest.approx(least, rel=1e-6))
        assert (own.analyses == 200) if without else (own.analyses < most)


def test_blocks_below_their_least_norm_are_fitted_by_squares():
    """Norms alone would fit the three values of the second block, and their noise, exactly."""

    class Lines(BrownAndDennis):
        start = np.array([0.0, 0.0, 0.0])

        def __init__(self, least_norms):
            self.blocks, self.analyses = Blocks([20, 3], least_norms), 0
            wide = np.vstack([np.eye(3), -np.eye(3)]), np.full(6, -1e6)
            self.unknowns = SimpleNamespace(inequalities=wide, within_work=lambda y: True)
            random = np.random.default_rng(3)
            self.slopes = random.standard_normal((23, 3))
            self.sigma = np.r_[np.full(20, 0.1), np.full(3, 0.02)]
            self.values = self.sigma * random.standard_normal(23)

        def evaluate(self, y, with_jacobian):
            self.analyses += 1
            r = self.slopes @ y - self.values
            return Evaluation(y, y, r, self.blocks.value(r), self.slopes, ())

    variances = np.array([0.1, 0.02]) ** 2
    weighted = Lines(1e3 * variances)
    point = weighted.evaluate(weighted.start, True)
    end, _ = descend(weighted, point, 1e-9, 200, norms=True, settings=PRECISE)
    slopes, values = (a.T / weighted.sigma for a in (weighted.slopes, weighted.values))
    expected = np.linalg.lstsq(slopes.T, values, rcond=None)[0]
    np.testing.assert_allclose(end.unknowns, expected, atol=1e-6)
    by_norms = Lines(None)
    end, _ = descend(by_norms, by_norms.evaluate(point.unknowns, True), 1e-9, 200, norms=True)
    assert by_norms.blocks.norms(end.residual)[1] < 1e-4
    # Above its least a norm counts itself, with the same value and slope where both meet.
    residual = np.r_[np.full(20, 1.0), np.full(3, 0.01)]
    blocks = Blocks([20, 3], np.array([1.0, 0.1]))
    norms = blocks.norms(residual)
    assert blocks.merit(residual) == pytest.approx(norms[0] + norms[1] ** 2 / 0.2 + 0.05)


def test_secant_update_gives_back_change_of_slopes():
    """It gives back the change of the slopes along the step, and an exact one stays."""
    random = np.random.default_rng(0)
    own = random.standard_normal((4, 4))
    own, step, change = own + own.T, random.standard_normal(4), random.standard_normal(4)
    change *= np.sign(change @ step)
    turned = random.standard_normal(4)
    found = descent._secant_update(own, step, turned, change)
    assert found @ step == pytest.approx(turned)
    assert found == pytest.approx(found.T)
    assert descent._secant_update(found, step, turned, change) == pytest.approx(found)
    assert (descent._secant_update(own, step, turned, -change) == own).all()  # that is no curvature
