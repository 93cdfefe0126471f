"""solvers/membrane/inflation.py: inflation by pressure and by volume."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import RigidSupports, inflated_cylinder
from bubblefit.runs.verification.thin_walls import ISOTROPIC, NU, RADIUS, THICKNESS
from bubblefit.runs.verification.thin_walls import MODULUS as E
from bubblefit.runs.verification.thin_walls import sphere_model as sphere
from bubblefit.runs.verification.thin_walls import tube_model as tube
from bubblefit.solvers.membrane import inflation
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.sensitivity import Neighbours
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.integrate import quad

from ...builders.laws import TABLE_3_2


def inflate(model, law=ISOTROPIC, tolerance=1e-09):
    solver = MembraneSolver(tolerance)
    return solver.run(model, law), solver._prepared[1]


def test_thickness_by_element_carries_hoop_force_in_equal_strain():
    """Two thicknesses side by side in one tube wall carry the hoop force in equal strain."""
    model = tube(16, 1, 20.0, [0.01], caps=False)
    thick = np.where(model.mesh.points[model.mesh.quads][..., 1].mean(axis=1) > 0, 1.6, 0.8)
    m, even = (inflate(one)[1] for one in (replace(model, thickness=thick), model))
    hoop = m.stress_old[..., 1].mean(axis=1) * thick
    # Without friction the hoop force is the same all around, p times the apothem.
    assert hoop == pytest.approx(np.full(len(hoop), hoop.mean()), rel=1e-3)
    assert hoop.mean() == pytest.approx(even.stress_old[..., 1].mean() * 0.8, rel=1e-2)
    assert np.ptp(even.stress_old[..., 1]) < 1e-6


def test_inflation_starts_from_its_unloaded_state_whatever_the_guess():
    model = sphere(2, [0.01])
    history = MembraneSolver().run(model, ISOTROPIC)
    guessed = MembraneSolver().run(model, ISOTROPIC, guess=1.5 * history.path)
    np.testing.assert_array_equal(guessed.displacement, history.displacement)


def test_inflation_refuses_loads_beyond_its_limit():
    # p = 2 t E e/((1 - nu) R exp(e)) has its maximum at e = 1.
    limit = 2 * THICKNESS * E / ((1 - NU) * RADIUS * np.e)
    with pytest.raises(SolverFailure, match="no equilibrium at"):
        MembraneSolver().run(sphere(2, [0.1, 0.5, 1.0, 2.0, 1.1 * limit]), ISOTROPIC)


def test_limit_pressure_is_passed_by_volume():
    """Fill modulus that falls under the stress and rises again: p R/t has a maximum on the way."""
    beta = 1e3 * np.array([0, 0, 0, 0.1, 81.7789, 15.6849, -4.03842, 0.181033, 0, 0, 0, 0.3])
    law = HypoelasticLaw(beta, 0.24, [0.2, 0.2, 0.2])
    history, m = inflate(tube(8, 1, 20.0, np.linspace(0.003, 0.09, 30), caps=False), law)
    assert any("snaps" in remark for remark in history.remarks)
    strain = m.strain_old[..., 1].mean()
    assert np.ptp(m.strain_old[..., 1]) < 1e-6
    apothem = RADIUS * np.cos(np.pi / 16) * np.exp(strain)
    assert m.stress_old[..., 1] == pytest.approx(0.09 * apothem / THICKNESS, rel=1e-6)
    rigidity = lambda e: law.E2(e) / (1 - 0.24**2 * law.E2(e) / law.E1(0.0))  # noqa: E731
    # The axial strain is zero, so that the stress is the integral of the modulus.
    exact = quad(rigidity, 0, strain)[0]
    assert m.stress_old[..., 1].mean() == pytest.approx(exact, rel=2e-3)
    assert min(rigidity(np.linspace(0, strain, 400))) < exact  # there is a limit pressure


@pytest.mark.parametrize("leaps", [False, True])
def test_inflation_before_a_bending_descends_through_folds(monkeypatch, leaps):
    membrane = inflate(tube(8, 1, 20.0, [0.01], caps=False))[1]
    u = np.zeros_like(membrane.reference)
    searches = []
    for name in ("rest", "equilibrium"):

        def search(_, u, level, *settings, name=name):
            searches.append((name, level))
            return u

        monkeypatch.setattr(ClosedMembrane, name, search)
    filling = inflation.Filling(membrane, Neighbours(membrane, ()), leaps)
    assert filling.first_equilibrium(0.01) == pytest.approx(u)
    assert filling.reach(0.01, u, 0.02, u, filling.max_halvings) is u
    name = "rest" if leaps else "equilibrium"
    assert searches == [(name, 0.01), (name, 0.02)] and not filling.snaps


def test_folding_wall_is_inflated_and_bent_in_few_evaluations():
    """Newton's iteration with a viscous motion where it failed took 726."""
    model = inflated_cylinder(
        250.0, 0.05, 0.81, 40.0, 500.0, supports=RigidSupports(300.0), deflections=[4.0]
    )
    law = HypoelasticLaw(1e3 * np.array(TABLE_3_2), strain_range=[0.153, 0.232, 0.7])
    history = MembraneSolver(wall="stiff").run(model, law)
    finer = replace(model, inflation=np.linspace(0.0, 0.05, 31)[1:])
    assert history.iterations < 250
    load = MembraneSolver(wall="stiff").run(finer, law).load[1]
    assert history.load[1] == pytest.approx(load, rel=1e-3)


@pytest.mark.parametrize(
    ("by_strain", "snaps"), [([0.0, 0.0, 0.0, 20.0], False), ([900.0, -300.0, 0.0, 20.0], True)]
)
def test_derivatives_hold_beyond_increments_in_which_the_volume_leaps(by_strain, snaps):
    """They depend on the strain path, which is followed in small steps there."""
    beta = np.array([0.0, 0.0, 0.0, 8.0, *by_strain, 0.0, 0.0, -50.0, 30.0])
    law = HypoelasticLaw(beta, 0.24, [0.5, 0.5, 0.5])
    model = tube(8, 1, 20.0, [0.02, 0.05], caps=False)
    history, slopes = MembraneSolver(1e-10).run_with_sensitivity(model, law, ["beta_7", "beta_11"])
    assert any("snaps" in remark for remark in history.remarks) is snaps
    assert history.cavity_volume[1] > 1.3 * history.cavity_volume[0]
    for column, index in enumerate((7, 11)):
        step = 1e-4 * beta[index]
        ends = []
        for sign in (1.0, -1.0):
            changed = beta.copy()
            changed[index] += sign * step
            ends.append(MembraneSolver(1e-10).run(model, replace(law, beta=changed)).displacement)
        expected = (ends[0] - ends[1]) / (2 * step)
        error = np.abs(slopes[..., column] - expected).max(axis=(1, 2))
        assert (error < 2e-4 * np.abs(expected).max(axis=(1, 2))).all()
