"""A patch under biaxial loads on the membrane: derivatives of displacements, what it says."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response
from bubblefit.meshes.strip_models import SIDE, PatchModel, elongations
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...biaxial_files import BENT
from ...complaints import complaint_with

LOADS = np.outer(np.linspace(2, 30, 8), [1.0, 0.5])


def test_the_corners_move_as_the_law_says_and_so_do_their_derivatives():
    names = ("beta_7", "beta_11", "nu12")
    history, slope = MembraneSolver().run_with_sensitivity(PatchModel(LOADS, 0.8), BENT, names)
    wanted = biaxial_response(BENT, LOADS, 0.8, names)
    np.testing.assert_allclose(elongations(history.displacement), wanted.elongation, rtol=1e-13)
    np.testing.assert_allclose(history.displacement[:, 1, 0], SIDE * wanted.elongation[:, 0])
    np.testing.assert_allclose(history.displacement[:, 3, 1], SIDE * wanted.elongation[:, 1])
    assert (history.displacement[:, 0] == 0).all() and (history.displacement[..., 2] == 0).all()
    step = 1e-3 * np.eye(12)[7]
    laws = [BENT.with_beta(BENT.beta + step), BENT.with_beta(BENT.beta - step)]
    ends = [MembraneSolver().run(PatchModel(LOADS, 0.8), law).displacement for law in laws]
    ahead, behind = (elongations(end) for end in ends)
    by_e2 = (ahead - behind) / 2e-3
    np.testing.assert_allclose(elongations(slope)[..., 0], by_e2, atol=1e-7 * np.abs(by_e2).max())
    assert slope.shape == (8, 4, 3, 3)
    np.testing.assert_allclose(history.strain_max[:2], wanted.strain.max(axis=0))
    np.testing.assert_allclose(history.strain_min[:2], wanted.strain.min(axis=0))
    assert history.unstable == () and history.strain_max[2] == 0
    np.testing.assert_allclose(history.load, LOADS.sum(axis=1))


def test_progress_and_stress_are_told():
    solver, told = MembraneSolver(), []
    solver.progress = lambda done: told.append(done.time)
    solver.run(PatchModel(LOADS, 0.8), BENT)
    assert told == [8.0]
    stress = biaxial_response(BENT, LOADS, 0.8).stress[-1]
    np.testing.assert_allclose(solver.stress[0, 0], [*stress, 0.0])


def test_a_load_without_equilibrium_is_a_failure_that_says_which():
    falling = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
    loads = np.outer(np.linspace(2, 60, 30), [1.0, 1.0])
    with pytest.raises(SolverFailure, match=r"no equilibrium at \d+ and \d+ N/mm.*load \d+ of 30"):
        MembraneSolver().run(PatchModel(loads, 0.8), falling)


def test_unstable_loads_are_named():
    law = HypoelasticLaw.linear(100.0, 100.0, 5.0, 0.6)
    history = MembraneSolver().run(PatchModel([[10.0, 10.0], [100.0, 100.0]], 0.8), law)
    assert history.unstable == ("100 and 100 N/mm",)


def test_a_patch_needs_loads_and_a_thickness():
    complaint_with(["loads", "(n, 2)", "(3,)"], PatchModel, [1.0, 2.0, 3.0], 0.8)
    complaint_with(["finite"], PatchModel, [[1.0, np.nan]], 0.8)
    complaint_with(["thickness", "> 0"], PatchModel, [[1.0, 1.0]], 0.0)
