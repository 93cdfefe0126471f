"""Closed-form moduli from pressure and apex height: Hencky's membrane, and the membrane solver."""

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.cap import cap_estimate, hencky_apex
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

RADIUS = 100.0


def apex_heights(law, pressures, thickness=0.5):
    mesh = elliptic_disk_mesh(Outline.circle(RADIUS), 240, "quarter", "blocks")
    model = BubbleModel(mesh, thickness, pressures, default_increments(pressures))
    centre = np.argmin(np.hypot(*mesh.points[:, :2].T))
    return MembraneSolver().run(model, law).displacement[:, centre, 2]


def test_apex_of_hencky_membrane_has_published_height_and_force():
    # Fichter 1997, Poisson's ratio 0.3: b = 1.7244, and 0.653 for the height.
    apex = hencky_apex(0.3)
    assert apex.strain == pytest.approx(0.7 * 1.7244 / (4 * 0.653**2), rel=4e-3)
    assert apex.tension == pytest.approx(1.7244 * 0.653, rel=4e-3)
    assert hencky_apex(0.99) == hencky_apex(0.9)


def test_stiffness_of_isotropic_sheet_is_known_from_apex_heights():
    law = HypoelasticLaw.linear(200.0, 200.0, 200.0 / 2.6, 0.3)
    pressures = np.array([1e-4, 1e-3, 1e-2, 0.03])
    heights = apex_heights(law, pressures)
    estimate = cap_estimate(pressures, heights, RADIUS, 0.5, 0.3)
    np.testing.assert_allclose(estimate.modulus, 200.0, rtol=0.03)
    np.testing.assert_allclose(0.7 * estimate.stress / estimate.strain, 200.0, rtol=0.015)
    # Twice the thickness has half the stress.
    thick = cap_estimate(pressures, heights, RADIUS, 1.0, 0.3)
    np.testing.assert_allclose(thick.modulus, 0.5 * estimate.modulus)


def test_thickness_that_keeps_the_volume_raises_the_stress_by_the_area():
    pressures, heights = [0.1, 0.2], [30.0, 45.0]
    constant = cap_estimate(pressures, heights, RADIUS, 0.5)
    thinner = cap_estimate(pressures, heights, RADIUS, 0.5, thickness_change="incompressible")
    np.testing.assert_allclose(thinner.stress, constant.stress * np.exp(2 * constant.strain))


def test_estimate_sorts_pairs_and_leaves_out_those_without_rise():
    estimate = cap_estimate([0.2, 0.1, 0.3, 0.0], [45.0, 30.0, -1.0, 5.0], RADIUS, 0.5)
    assert len(estimate.strain) == 2 and (np.diff(estimate.strain) > 0).all()
    assert estimate.words.startswith("closed form, E1 = E2, MPa: ")
    with pytest.raises(InputError, match="apex height"):
        cap_estimate([0.1], [-1.0], RADIUS, 0.5)


def test_modulus_is_that_of_a_power_of_strain_and_positive():
    assert (cap_estimate([0.1, 0.12, 0.121], [10.0, 30.0, 60.0], RADIUS, 0.5).modulus > 0).all()
    apex = hencky_apex(0.24)
    heights = np.array([10.0, 20.0, 40.0])
    strain = np.log1p(apex.strain * (heights / RADIUS) ** 2)
    forces = apex.tension * (RADIUS**2 + heights**2) / (4 * heights)
    estimate = cap_estimate(500.0 * strain**1.5 / forces, heights, RADIUS, 1.0)
    np.testing.assert_allclose(estimate.modulus, 0.76 * 1.5 * 500.0 * strain**0.5)
    assert cap_estimate([0.1], [10.0], RADIUS, 0.5).modulus[0] > 0
