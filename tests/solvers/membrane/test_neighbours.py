"""solvers/membrane/neighbours.py: derivatives of closed membranes by all moduli."""

import numpy as np
import pytest
from bubblefit.runs.verification.thin_walls import ISOTROPIC
from bubblefit.runs.verification.thin_walls import sphere_model as sphere
from bubblefit.solvers.membrane.solver import MembraneSolver


def test_slopes_by_all_moduli_equal_those_by_pressure():
    slope = MembraneSolver(1e-11).run_with_sensitivity(sphere(2, [0.01]), ISOTROPIC)[1][-1]
    up, down = (
        MembraneSolver(1e-11).run(sphere(2, [p]), ISOTROPIC).displacement[-1]
        for p in (0.01001, 0.00999)
    )
    by_pressure = (up - down) / 2e-3
    assert slope @ ISOTROPIC.beta == pytest.approx(
        -by_pressure, abs=2e-3 * np.abs(by_pressure).max()
    )
