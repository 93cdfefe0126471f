"""experiments/bubble/rim.py: the rim of the clamp."""

import numpy as np
import pytest
from bubblefit.experiments.bubble.rim import rim_of_motion

from .cases import camera_grid, rotation_by


def test_elliptic_rim_is_found_with_its_direction():
    points = camera_grid()[:, :2]
    u, v = ((points - (4.0, -3.0)) @ rotation_by("z", 35.0)[:2, :2]).T / [[100.0], [70.0]]
    on = np.clip(1 - u**2 - v**2, 0.0, None)
    rise = 20.0 * on * (1 + 0.1 * u**2)
    rim = rim_of_motion([(points[on > 0], rise[on > 0])], (100.0, 70.0), (3.0, -2.0))
    assert (rim.x, rim.y) == pytest.approx((4.0, -3.0), abs=1e-3)
    assert rim.angle == pytest.approx(35.0, abs=1e-3)
