"""The bubble against an Abaqus M3D4 analysis with linear orthotropic constants.

Digitised figures of a public repository (`runs/verification/published`); about 0.03 mm.
Abaqus' membranes are incompressible in thickness. 400 quads of a quarter; 1600 find no
equilibrium of test 1, model e beyond 290 kPa. Likely reason: with so low a G12 the acoustic tensor
is indefinite near the rim from 115 kPa on (on every mesh), so the problem is not well posed under
refinement.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest
from bubblefit.runs.verification.published import cases, shapes
from bubblefit.solvers.membrane.solver import MembraneSolver

#: Error of reading the published figures, mm.
DIGITISED = 0.03
MODELS = [(1, "e"), (1, "ew"), (2, "e"), (2, "ew")]


@cache
def compare(test: int, model: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Ours and theirs: apex and extreme in-plane displacements, a row a pressure."""
    rows = dict(cases())[test, model]
    return shapes(rows, 1600, MembraneSolver()), rows


@pytest.mark.parametrize(("test", "model"), MODELS)
def test_apex_at_every_pressure(test: int, model: str) -> None:
    """0.5 % everywhere, 0.1 % above 50 kPa."""
    ours, rows = compare(test, model)
    theirs = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)
    error = np.abs(ours["apex"] / theirs - 1.0).to_numpy()
    high = rows["p_bar"].to_numpy() > 0.5
    print(rows["p_bar"].to_numpy()[~high], error[~high], "above", error[high].max())
    assert error.max() < 5e-3
    assert error[high].max() < 1e-3


@pytest.mark.parametrize(("test", "model"), MODELS)
def test_in_plane_displacements(test: int, model: str) -> None:
    """Their extremes along the two axes, to the error of reading the figures."""
    ours, rows = compare(test, model)
    for axis in ("x", "y"):
        gap = np.abs(ours[f"du_{axis}"] - rows[f"du_{axis}_max"]).max()
        print(axis, gap)
        assert gap < DIGITISED
