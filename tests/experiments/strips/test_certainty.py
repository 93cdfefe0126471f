"""What strips, and a bubble, determine of the moduli."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference.assessment import certainty, uncertainty_from
from bubblefit.inference.descent import descend
from bubblefit.inference.noise import Noise
from bubblefit.materials.forms.base import COMPONENTS

from ...inference.scatter import follows, scatter_of
from .problems import CONSTANT, CONSTANTS, CUBIC, LAW, STRIPS, joint, near, strips


def test_certainty_predicts_the_scatter_of_noisy_strip_fits() -> None:
    """Sigma is the scatter of linear estimates from drawn noise; a real fit goes where they do."""
    noise, moduli = 5.0, np.array([20.0, 200.0, 500.0])
    fit, truth = strips(CONSTANTS, CONSTANT, noise=noise, seed=1), near(CONSTANTS, CONSTANT, 1.0)
    point = fit.evaluate(truth, True)
    predicted = certainty(fit, point, CONSTANT, np.array([0.1, 0.1, 0.1]))
    # Ten loads a strip say their noise to 22 %; the scatter is that of the noise as it is said.
    assert set(predicted.noise) == set(STRIPS)
    assert np.mean(list(predicted.noise.values())) == pytest.approx(noise, rel=0.25)
    scatter = scatter_of(fit, point, predicted.noise)
    sigma = [predicted.sigma[name][0] for name in ("G12", "E2", "E1")]
    assert sigma == pytest.approx(CONSTANTS.to_coefficients @ scatter / moduli, rel=0.03)
    best, _ = descend(fit, point, 1e-7, 10**6, norms=True)
    off = best.unknowns - truth - follows(fit, point, -point.residual)
    assert np.abs(off / scatter).max() < 0.05


def test_what_each_data_set_pins_down() -> None:
    fit = joint(noise=10.0, bubble_noise=0.1)
    point = fit.evaluate(CUBIC.at(LAW.beta), True)
    reached, noise = np.array([0.1, 0.1, 0.3]), Noise.of(fit, point.residual).rows
    bubble, uniaxial, both = (
        uncertainty_from(fit, point, LAW, reached, tests, noise)
        for tests in ([0], [1, 2, 3], [0, 1, 2, 3])
    )
    for name in COMPONENTS:
        assert (both[name] <= bubble[name] * (1 + 1e-6)).all()
        assert (both[name] <= uniaxial[name] * (1 + 1e-6)).all()
    worst = {name: sigma.max() for name, sigma in bubble.items()}
    assert worst["G12"] > 2 * max(worst["E1"], worst["E2"])
    assert uniaxial["G12"].max() < 0.2 * bubble["G12"].max()
    # A pull along the warp says nothing of the fill or of shear.
    warp = uncertainty_from(fit, point, LAW, reached, [1], noise)
    assert warp["E1"].max() < 0.5
    assert min(warp["E2"].min(), warp["G12"].min()) > 1.0
