"""The thickness as a parameter of every model that a fit compares."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import PatchModel, straight_strip

MODELS = (
    BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.8, [0.05, 0.1]),
    straight_strip("warp", 20.0, 22.0, 0.8, increments=3),
    PatchModel(np.ones((2, 2)), 0.8),
)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: type(model).__name__)
def test_a_thickness_is_added(model) -> None:
    assert "thickness" in model.parameters
    thicker = model.with_parameters({"thickness": 0.05})
    assert thicker.thickness == pytest.approx(0.85) and type(thicker) is type(model)
    assert model.with_parameters({"thickness": 0.0}) is model
    with pytest.raises(InputError, match=r"thickness: expected > 0"):
        model.with_parameters({"thickness": -0.8})
    with pytest.raises(InputError, match=r"parameters: \['width'\] not among"):
        model.with_parameters({"width": 1.0})
