"""solvers/membrane/homogeneous_tube.py: tension and torsion, by closed forms and energy."""

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.meshes.strip_models import TubeModel
from bubblefit.runs.verification.bubbles import table_4_2_law
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...experiments.tube.cases import LINEAR, LOADED, RADIUS, THICKNESS, strains_of_tube
from ...support.refusals import raised


def test_small_loads_of_a_thin_tube_in_closed_form():
    """Axial p R/2 + F/(2 pi R), hoop p R, shear T/(2 pi R^2), all over moduli times thickness."""
    pressure, force, torque = 1e-6, 0.01, 1.0
    (found,) = strains_of_tube([(pressure, force, torque)])
    axial = 0.5 * pressure * RADIUS + force / (2 * np.pi * RADIUS)
    hoop, nu = pressure * RADIUS, 0.24
    wanted = [
        (axial / 400 - nu * hoop / 400) / THICKNESS,
        (hoop / 300 - nu * axial / 400) / THICKNESS,
        torque / (2 * np.pi * RADIUS**2 * THICKNESS * 20),
    ]
    assert found == pytest.approx(wanted, rel=1e-4)


def test_equilibrium_of_a_tube_is_a_stationary_energy():
    """Pressure, pull and torque are derivatives of an elastic energy by volume, length, twist."""
    model = TubeModel([(0.02, 500.0, 4e4)], RADIUS, THICKNESS)
    solver = MembraneSolver()
    history = solver.run(model, table_4_2_law())
    (axial, hoop, twist), stress = model.strains(history.displacement)[0], solver.stress[0, 0]
    a, b, s = 1 + axial, 1 + hoop, twist * (1 + hoop)
    # Cauchy stress of the wall in space: the corotated frame turned to the tube's.
    gradient = np.array([[a, 0.0], [s, b]])
    left, _, right = np.linalg.svd(gradient)
    turn = left @ right
    tensor = turn @ np.array([[stress[0], stress[2]], [stress[2], stress[1]]]) @ turn.T
    radius = RADIUS * b
    around = tensor * THICKNESS
    assert around[1, 1] == pytest.approx(0.02 * radius, rel=1e-8)
    pull = 0.02 * np.pi * radius**2 + 500.0
    assert 2 * np.pi * radius * around[0, 0] == pytest.approx(pull, rel=1e-8)
    assert 2 * np.pi * radius**2 * around[0, 1] == pytest.approx(4e4, rel=1e-8)


@pytest.mark.parametrize("law", [LINEAR, table_4_2_law()])
def test_derivatives_of_a_tube_against_differences(law):
    model = TubeModel(LOADED, RADIUS, THICKNESS)
    solver = MembraneSolver()
    names = [*(f"beta_{i}" for i in law.form.free), "nu12"]
    history, slope = solver.run_with_sensitivity(model, law, names)
    found = model.strain_slopes(history.displacement, slope)
    for k, i in enumerate(law.form.free):
        step = 1e-3 * max(abs(law.beta[i]), 1.0)
        ends = []
        for sign in (1, -1):
            beta = law.beta.copy()
            beta[i] += sign * step
            ends.append(strains_of_tube(LOADED, law.with_beta(beta)))
        wanted = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(found[:, :, k] - wanted).max() < 1e-4 * np.abs(wanted).max(), i


def test_tube_that_cannot_carry_its_loads_is_a_failure():
    assert "load 1" in raised(SolverFailure, "", strains_of_tube, [(5.0, 0.0, 0.0)]).reason
