"""What strips, and a bubble, determine of the moduli."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.identification.assessment import certainty, pinned_by
from bubblefit.identification.methods.descent import descend
from bubblefit.materials.forms.base import COMPONENTS

from .problems import CONSTANT, CONSTANTS, CUBIC, LAW, STRIPS, joint, near, strips


def test_certainty_predicts_the_scatter_of_noisy_strip_fits() -> None:
    """Linear propagation against twelve fits to freshly drawn noise, one constant a modulus."""
    noise, found, predicted = 5.0, [], None
    for seed in range(12):
        fit = strips(CONSTANTS, CONSTANT, noise=noise, seed=seed)
        point = fit.evaluate(near(CONSTANTS, CONSTANT, 1.0), True)
        best, _ = descend(fit, point, 1e-7, 10**6)
        found.append(best.coefficients)
        predicted = certainty(fit, best, CONSTANT, np.array([0.1, 0.1, 0.1]))
    scatter = np.std(found, axis=0, ddof=1) / [20.0, 200.0, 500.0]
    sigma = [predicted.sigma[name][0] for name in ("G12", "E2", "E1")]
    assert scatter == pytest.approx(sigma, rel=0.6)
    assert set(predicted.noise) == set(STRIPS)
    assert np.mean(list(predicted.noise.values())) == pytest.approx(noise, rel=0.4)


def test_what_each_data_set_pins_down() -> None:
    fit = joint(noise=10.0, bubble_noise=0.1)
    point = fit.evaluate(CUBIC.at(LAW.beta), True)
    reached = np.array([0.1, 0.1, 0.3])
    bubble, uniaxial, both = (
        pinned_by(fit, point, LAW, reached, tests) for tests in ([0], [1, 2, 3], [0, 1, 2, 3])
    )
    for name in COMPONENTS:
        assert (both[name] <= bubble[name] * (1 + 1e-6)).all()
        assert (both[name] <= uniaxial[name] * (1 + 1e-6)).all()
    worst = {name: sigma.max() for name, sigma in bubble.items()}
    assert worst["G12"] > 2 * max(worst["E1"], worst["E2"])
    assert uniaxial["G12"].max() < 0.2 * bubble["G12"].max()
    # A pull along the warp says nothing of the fill or of shear.
    warp = pinned_by(fit, point, LAW, reached, [1])
    assert warp["E1"].max() < 0.5
    assert min(warp["E2"].min(), warp["G12"].min()) > 1.0
