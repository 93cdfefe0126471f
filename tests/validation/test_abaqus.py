"""Validation: Abaqus' published bubbles against the membrane and CalculiX."""

import numpy as np
import pytest
from bubblefit.runs.verification.bubbles import bubble_shapes, published_cases
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver

AGREEMENT = 0.003  # of the apex height


def test_calculix_apex_of_a_linear_orthotropic_bubble_is_that_of_abaqus(ccx):
    """Abaqus' M3D4 membrane, test 2, model e, as digitised (0.03 mm).

    0.3 %; at the first pressure, 3.9 kPa, 0.6 %: our membrane is 0.49 % off there, too.
    """
    rows = dict(published_cases())[2, "e"]
    apex = bubble_shapes(rows, 300, CalculixSolver())["apex"].to_numpy()
    theirs = rows["apex_x_profile"].to_numpy()

    error = np.abs(apex / theirs - 1)
    assert error[0] < 6e-3
    assert error[1:].max() < AGREEMENT


@pytest.mark.parametrize("case", [(1, "e"), (1, "ew"), (2, "e"), (2, "ew")])
def test_bubbles_of_abaqus_at_all_pressures(case):
    """Apex 0.5 % everywhere, 0.1 % above 50 kPa; in-plane extremes to the error of reading, mm."""
    rows = dict(published_cases())[case]
    ours = bubble_shapes(rows, 1600, MembraneSolver())
    theirs = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)
    error = np.abs(ours["apex"] / theirs - 1.0).to_numpy()
    assert error.max() < 5e-3
    assert error[rows["p_bar"].to_numpy() > 0.5].max() < 1e-3
    for axis in ("x", "y"):
        assert np.abs(ours[f"du_{axis}"] - rows[f"du_{axis}_max"]).max() < 0.03
