"""Validation: inflated spheres and tubes against closed forms of thin walls."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.verification.thin_walls import (
    ISOTROPIC,
    NU,
    RADIUS,
    THICKNESS,
    capped_strain,
    radius_and_stresses,
)
from bubblefit.runs.verification.thin_walls import MODULUS as E
from bubblefit.runs.verification.thin_walls import sphere_model as sphere
from bubblefit.runs.verification.thin_walls import tube_model as tube
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.optimize import brentq

from ..builders.laws import TABLE_4_2

LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])


def inflate(model, law=ISOTROPIC, tolerance=1e-09):
    solver = MembraneSolver(tolerance)
    return solver.run(model, law), solver._prepared[1]


def order(errors, factor):
    return np.log(np.abs(np.divide(*errors[-2:]))) / np.log(factor)


def test_inflated_sphere_against_the_closed_form():
    """Cauchy stress p r/(2 t) = E/(1 - nu) log(r/R), constant thickness; second order."""
    pressures, errors = [0.01, 0.1, 0.4, 0.8], []

    def balance(strain, p):
        return E / (1 - NU) * strain - p * RADIUS * np.exp(strain) / (2 * THICKNESS)

    strain = np.array([brentq(balance, 0.0, 0.9, args=(p,)) for p in pressures])
    radius = RADIUS * np.exp(strain)
    for n in (4, 8, 12):
        history, m = inflate(sphere(n, pressures))
        found = np.linalg.norm(m.reference + history.displacement, axis=2).mean(axis=1)
        volume = history.cavity_volume / (4 / 3 * np.pi * radius**3) - 1
        mean = m.stress_old[..., :2].mean() / (E / (1 - NU) * strain[-1]) - 1
        errors.append((np.abs(found / radius - 1).max(), np.abs(volume).max(), abs(mean)))
    assert max(errors[-1]) < 5e-3
    assert order(errors, 12 / 8) == pytest.approx([2.0] * 3, abs=0.15)


@pytest.mark.parametrize(("law", "pressure"), [(ISOTROPIC, 0.02), (ISOTROPIC, 0.2), (LAW, 0.14)])
def test_inflated_tube_against_the_closed_form(law, pressure):
    """Middle of a tube with flat caps, from the slack state: hoop p r/t, axial half of it."""
    pressures = pressure * np.array([0.05, *np.arange(1, 11) / 10])
    strain, errors = capped_strain(law, pressure, RADIUS, THICKNESS), []
    radius = RADIUS * np.exp(strain[1])
    hoop = pressure * radius / THICKNESS
    for across in (8, 16, 24):
        model = tube(across, 12, 600.0, pressures)
        history, m = inflate(model, law)
        found = radius_and_stresses(model, history, m.stress_old) / np.array(
            [radius, hoop / 2, hoop]
        )
        z = model.mesh.points[:, 2]
        near = np.argmin(np.abs(z - 600.0 / 4))
        stretch = 1 + history.displacement[-1, near, 2] / z[near]
        errors.append([*(found - 1), stretch / np.exp(strain[0]) - 1])
    assert order(errors, 24 / 16)[1:3] == pytest.approx([2.0, 2.0], abs=0.1)
    assert np.abs(errors[-1]).max() < 5e-3
