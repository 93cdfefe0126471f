"""solvers/membrane/contact.py: distances to rings and posts."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.closed_surfaces import half_tube
from bubblefit.meshes.cylinder_model import RigidCylinder
from bubblefit.solvers.membrane.contact import brought_to_touch, contact_forces, gaps

RADIUS, LENGTH, SPAN = 75.0, 600.0, 800.0
POST = RigidCylinder("support", (1.0, 0.0, 0.0), (0.0, 0.0, 0.5 * SPAN), 50.0)
RING = RigidCylinder("collar", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 120.0, True, 145.0, 10.0)


@pytest.mark.parametrize("body", [POST, RING])
def test_distance_to_bodies_has_gradient_and_hessian(body):
    rng = np.random.default_rng(2)
    angle, z = rng.uniform(0.2, 2.9, 60), rng.uniform(-72.0, 72.0, 60)
    r = rng.uniform(105.0, 122.0, 60)
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z + body.centre[2]], axis=1)
    gap, out, hessian = gaps(body, points)
    assert np.linalg.norm(out, axis=1) == pytest.approx(1.0, abs=1e-12)
    step, smooth = 1e-4, np.abs(np.abs(z) - 62.5) > 1e-3  # curvature jumps where the mouth begins
    for k in range(3):
        up, down = (gaps(body, points + s * step * np.eye(3)[k]) for s in (1, -1))
        assert out[:, k] == pytest.approx((up[0] - down[0]) / (2 * step), abs=1e-6)
        slope = (up[1] - down[1]) / (2 * step)
        assert hessian[smooth, :, k] == pytest.approx(slope[smooth], abs=1e-5)
    assert ((gap < 0).any() and (gap > 0).any()) or not body.ring
    x = np.asarray(body.centre) + rng.uniform(-160, 160, (4000, 3))
    gap, out, _ = gaps(body, x)
    force, _, touched = contact_forces(body, x, np.full(len(x), 2.0))
    np.testing.assert_array_equal(touched, np.flatnonzero(gap < 0))
    assert 100 < len(touched) < len(x)
    assert force == pytest.approx(np.where(gap[:, None] < 0, -2.0 * gap[:, None] * out, 0.0))


def test_distances_to_ring_and_post_by_hand():
    x = np.array([[0.0, 121.0, 0.0], [0.0, 119.0, 50.0], [0.0, 121.0, 72.5], [0.0, 130.0, 80.0]])
    # In the mouth: the fillet's circle stands at r = 130, z = 62.5.
    expected = [-1.0, 1.0, np.hypot(9.0, 10.0) - 10.0, 17.5 - 10.0]
    assert gaps(RING, x)[0] == pytest.approx(expected, abs=1e-6)
    assert gaps(POST, np.array([[7.0, -30.0, 440.0]]))[0] == pytest.approx([0.0], abs=1e-12)
    force, stiffness, touched = contact_forces(RING, x, np.full(4, 3.0))
    assert touched.tolist() == [0]
    assert force[0] == pytest.approx([0.0, -3.0, 0.0])
    assert stiffness[0, 1, 1] == pytest.approx(3.0)


def test_bodies_are_moved_until_they_touch():
    points = half_tube(16, 24, RADIUS, LENGTH).points
    way = np.array([0.0, -1.0, 0.0])
    post = brought_to_touch(POST, points, -way, 0.02)
    ring = brought_to_touch(RING, points, way, 0.0)
    assert post.centre == pytest.approx((0.0, -RADIUS - 50.0 + 0.02, 400.0), abs=1e-6)
    assert ring.centre == pytest.approx((0.0, RADIUS - 120.0, 0.0), abs=1e-6)
    with pytest.raises(InputError, match="no node of the mesh lies where 'support' could touch"):
        brought_to_touch(replace(POST, centre=(0.0, 0.0, 900.0)), points, -way, 0.02)
