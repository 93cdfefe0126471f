"""Frames of a known law as the arrays that a camera's software saves."""

import numpy as np
import pytest

from ..builders.measured_arrays import PRESSURES
from ..builders.projects import write_camera_arrays


@pytest.fixture(scope="session")
def camera(tmp_path_factory):
    """20 frames of a known law as a camera's software saves them: mm, and MPa."""
    folder = tmp_path_factory.mktemp("camera")
    write_camera_arrays(folder, pressures=PRESSURES, elements=48, symmetry="quarter")
    return folder / "camera.npz"


@pytest.fixture
def arrays(camera):
    return dict(np.load(camera))
