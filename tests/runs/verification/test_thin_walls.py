"""Closed forms of thin walls: small strains, equilibrium at large ones, and coarse meshes."""

import numpy as np
import pytest
from bubblefit.runs.verification.thin_walls import (
    ISOTROPIC,
    MODULUS,
    NU,
    RADIUS,
    THICKNESS,
    capped_strain,
    radius_and_stresses,
    sphere,
    sphere_strain,
    tube_model,
)
from bubblefit.solvers.membrane.solver import MembraneSolver


def test_small_strains_of_a_capped_tube_are_linear():
    pressure = 1e-4
    hoop = pressure * RADIUS / THICKNESS / MODULUS
    axial, around = capped_strain(ISOTROPIC, pressure, RADIUS, THICKNESS)
    assert axial == pytest.approx(hoop * (0.5 - NU), rel=1e-3)
    assert around == pytest.approx(hoop * (1 - 0.5 * NU), rel=1e-3)


def test_strains_of_a_capped_tube_are_in_equilibrium():
    pressure = 0.3
    axial, hoop = capped_strain(ISOTROPIC, pressure, RADIUS, THICKNESS)
    stress = pressure * RADIUS * np.exp(hoop) / THICKNESS
    plane = MODULUS / (1 - NU**2)
    assert plane * (hoop + NU * axial) == pytest.approx(stress, rel=1e-6)
    assert plane * (axial + NU * hoop) == pytest.approx(stress / 2, rel=1e-6)


def test_strain_of_a_sphere_is_in_equilibrium():
    strain = sphere_strain(0.8)
    stress = 0.8 * RADIUS * np.exp(strain) / (2 * THICKNESS)
    assert MODULUS / (1 - NU) * strain == pytest.approx(stress, rel=1e-9)


def test_coarse_tube_without_caps_has_hoop_stress_of_closed_form():
    model = tube_model(12, 3, 150.0, [0.001, 0.01], caps=False)
    solver = MembraneSolver(1e-9)
    history = solver.run(model, ISOTROPIC)
    radius, _, hoop = radius_and_stresses(model, history, solver.stress)
    assert radius > RADIUS
    assert hoop == pytest.approx(0.01 * radius / THICKNESS, rel=0.03)


def test_sphere_of_facets_has_radius_and_volume_of_closed_form():
    radius, volume, stress = sphere((0.01, 0.1))
    strain = sphere_strain(0.1)
    exact = RADIUS * np.exp(strain)
    assert radius == pytest.approx(exact, rel=5e-3)
    assert volume == pytest.approx(4 / 3 * np.pi * exact**3, rel=1e-2)
    assert stress == pytest.approx(MODULUS / (1 - NU) * strain, rel=1e-2)
