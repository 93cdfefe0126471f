"""A patch under biaxial loads on CalculiX: the strains of the law itself."""

import numpy as np
import pytest
from bubblefit.materials.responses import biaxial_response
from bubblefit.meshes.strip_models import PatchModel, elongations
from bubblefit.solvers.calculix.solver import CalculixSolver

from ...fortran_build import LAWS

# Loads N/mm; 2 and 1 N/mm is the prestress of such a test.
UP = np.linspace(0.0, 20.0, 9)[1:]


@pytest.mark.parametrize("element", ["S8R", "S4"])
@pytest.mark.parametrize("shares", [(1.0, 0.5), (1.0, 0.02)], ids=["2:1", "1:0"])
@pytest.mark.parametrize("name", ["cubic", "incompressible"])
def test_calculix_has_the_strains_of_the_law(ccx, element, shares, name):
    loads = np.outer(np.concatenate([UP, UP[-2::-2]]), shares)
    history = CalculixSolver(ccx.path, element=element).run(PatchModel(loads, 0.8), LAWS[name])
    wanted = biaxial_response(LAWS[name], loads, 0.8).elongation
    found = elongations(history.displacement)
    np.testing.assert_allclose(found, wanted, atol=5e-6 * np.abs(wanted).max())
    np.testing.assert_allclose(history.load, loads.sum(axis=1))
    np.testing.assert_allclose(history.strain_max[:2], np.log1p(wanted).max(axis=0), rtol=1e-4)
    assert history.iterations > 0
