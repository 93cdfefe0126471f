"""meshes/bubble_model.py: the sheet of a bubble, its parameters and mistakes."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, disk_modes, doubly_symmetric, monomials

from ..support.refusals import complaint, raised

PRESSURES = (0.022, 0.097, 0.186)
STEPS = default_increments(PRESSURES)
MESH = disk_mesh(100.0, 64)
FLAT = BubbleModel(MESH, 0.81, PRESSURES, STEPS, modes=disk_modes(MESH.points / 100.0, 6))


def test_parameters_and_modes_of_the_sheet():
    model = FLAT.with_parameters({"z0_1": 2.0, "z0_xy": -1.0, "slack_fill": 0.001})
    heights = 2.0 * FLAT.modes["z0_1"] - FLAT.modes["z0_xy"]
    np.testing.assert_allclose(model.mesh.points[:, 2], heights)
    again = model.with_parameters({"z0_1": 1.0, "slack_fill": 0.001, "pressure_offset": 0.002})
    np.testing.assert_allclose(again.mesh.points[:, 2], heights + FLAT.modes["z0_1"])
    assert again.slack == (0.0, 0.002)
    np.testing.assert_allclose(again.pressures, np.add(PRESSURES, 0.002))
    assert FLAT.with_parameters({"z0_1": 0.0}) is FLAT
    assert "z0_9" in complaint(FLAT.with_parameters, {"z0_9": 1.0})
    assert monomials(6) == [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    assert list(FLAT.modes) == ["z0_1", "z0_x", "z0_y", "z0_xx", "z0_xy", "z0_yy"]
    modes = disk_modes(np.array([[50.0, -20.0], [60.0, 80.0]]) / 100.0, 6)
    np.testing.assert_allclose(modes["z0_xy"], [(1 - 0.29) * 0.5 * -0.2, 0.0], atol=1e-15)
    assert modes["z0_1"][0] == pytest.approx(0.71)
    assert doubly_symmetric(1) and not doubly_symmetric(2)


def test_bad_sheet_is_refused():
    raised(InputError, "slack: expected shares above -1", replace, FLAT, slack=(-1.0, 0.0))
    levels = (0.01, 0.02, 0.01)
    motion = np.zeros((3, len(MESH.node_sets["rim"]), 3))
    falling = {"pressures": levels, "increments": levels, "unloaded": True, "rim_motion": motion}
    raised(InputError, "rim_motion: is of pressures that rise", replace, FLAT, **falling)
