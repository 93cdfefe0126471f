"""solvers/membrane/patch.py: the biaxial patch."""

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import SIDE, PatchModel, elongations, straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.biaxial_tests import BENT_LAW
from ...builders.laws import TABLE_4_2

LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
LOADS = np.outer(np.linspace(2, 30, 8), [1.0, 0.5])


def test_corners_of_a_patch_move_as_the_law_with_derivatives():
    names, model = ("beta_7", "beta_11", "nu12"), PatchModel(LOADS, 0.8)
    history, slope = MembraneSolver().run_with_sensitivity(model, BENT_LAW, names)
    wanted, u = biaxial_response(BENT_LAW, LOADS, 0.8, names), history.displacement
    np.testing.assert_allclose(elongations(u), wanted.elongation, rtol=1e-13)
    np.testing.assert_allclose(u[:, [1, 3], [0, 1]], SIDE * wanted.elongation)
    assert (u[:, 0] == 0).all() and (u[..., 2] == 0).all()
    step = 1e-3 * np.eye(12)[7]
    ahead, behind = (
        elongations(MembraneSolver().run(model, BENT_LAW.with_beta(BENT_LAW.beta + s)).displacement)
        for s in (step, -step)
    )
    by_e2 = (ahead - behind) / 2e-3
    np.testing.assert_allclose(elongations(slope)[..., 0], by_e2, atol=1e-7 * np.abs(by_e2).max())
    assert slope.shape == (8, 4, 3, 3)
    np.testing.assert_allclose(history.strain_max[:2], wanted.strain.max(axis=0))
    np.testing.assert_allclose(history.strain_min[:2], wanted.strain.min(axis=0))
    assert history.unstable == () and history.strain_max[2] == 0
    np.testing.assert_allclose(history.load, LOADS.sum(axis=1))


def test_progress_failure_and_stability_of_a_patch():
    solver, told = MembraneSolver(), []
    solver.progress = lambda done: told.append(done.time)
    solver.run(straight_strip("warp", 20.0, 22.0, 0.81, increments=3), LAW)
    solver.run(PatchModel(LOADS, 0.8), BENT_LAW)
    assert told == [1.0, 2.0, 3.0, 8.0]
    stress = biaxial_response(BENT_LAW, LOADS, 0.8).stress[-1]
    np.testing.assert_allclose(solver.stress[0, 0], [*stress, 0.0])
    falling = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
    loads = np.outer(np.linspace(2, 60, 30), [1.0, 1.0])
    with pytest.raises(SolverFailure, match=r"no equilibrium at \d+ and \d+ N/mm.*load \d+ of 30"):
        MembraneSolver().run(PatchModel(loads, 0.8), falling)
    law = HypoelasticLaw.linear(100.0, 100.0, 5.0, 0.6)
    history = MembraneSolver().run(PatchModel([[10.0, 10.0], [100.0, 100.0]], 0.8), law)
    assert history.unstable == ("100 and 100 N/mm",)
