"""experiments/bubble/placement.py: where a test, and its rim, lie in the view of the camera."""

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.bubble.field_shape import centre_strain
from bubblefit.experiments.bubble.placement import (
    Placement,
    in_all_quarters,
    plane_through,
    rim_of_motion,
)
from bubblefit.readers.frames import Frame

from .cases import CLAMP_RADIUS, camera_grid, rotation_by


def test_placements_are_composed():
    a = Placement(np.array([1.0, 2.0, 3.0]), rotation_by("xyz", [10, 20, 30]))
    b = Placement(np.array([-4.0, 0.5, 1.0]), rotation_by("zyx", [50, -20, 5]))
    points = np.random.default_rng(3).normal(size=(5, 3))
    two_steps = b.coordinates(a.coordinates(points))
    np.testing.assert_allclose(b.composed_with(a).coordinates(points), two_steps)
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(-100, 100, (200, 2)), rng.normal(0, 0.05, 200)])
    points[:20, 2] += 30.0
    placement, deviation = plane_through(points @ rotation_by("y", 10.0).T, np.array([0, 0, 1.0]))
    assert placement.tilt == pytest.approx(10.0, abs=0.05)
    assert deviation == pytest.approx(0.05, rel=0.3)
    with pytest.raises(InputError, match="line"):
        plane_through(np.column_stack([np.arange(9.0), np.zeros((9, 2))]), np.array([0, 0, 1.0]))
    gradient = np.array([[0.02, 0.01], [0.03, -0.01], [0.1, 0.05]])
    frame, tangents = (
        Frame(camera_grid(), camera_grid()[:, :2] @ gradient.T),
        np.eye(3)[:2] + gradient.T,
    )
    expected = 0.5 * (tangents @ tangents.T - np.eye(2))
    np.testing.assert_allclose(centre_strain(frame, CLAMP_RADIUS), expected, atol=1e-12)


@pytest.mark.parametrize("missing", range(4))
def test_points_in_three_quarters_are_not_all_around(missing):
    # Heights of both signs are neither here nor there.
    points = np.array([[1.0, 1, 9], [1, -1, 9], [-1, 1, -9], [-1, -1, -9]] * 2)
    points[4:, 2] *= -1
    assert in_all_quarters(points) and in_all_quarters(points[:, :2])
    assert not in_all_quarters(np.delete(points, [missing, missing + 4], axis=0))
    assert not in_all_quarters(points[:0])


def test_elliptic_rim_is_found_with_its_direction():
    points = camera_grid()[:, :2]
    u, v = ((points - (4.0, -3.0)) @ rotation_by("z", 35.0)[:2, :2]).T / [[100.0], [70.0]]
    on = np.clip(1 - u**2 - v**2, 0.0, None)
    rise = 20.0 * on * (1 + 0.1 * u**2)
    rim = rim_of_motion([(points[on > 0], rise[on > 0])], (100.0, 70.0), (3.0, -2.0))
    assert (rim.x, rim.y) == pytest.approx((4.0, -3.0), abs=1e-3)
    assert rim.angle == pytest.approx(35.0, abs=1e-3)
