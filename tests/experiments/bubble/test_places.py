"""Fields folded onto a quarter, and mirrored from it."""

from __future__ import annotations

import numpy as np
from bubblefit.data.fields import DisplacementField
from bubblefit.experiments.bubble.places import folded, mirrored

POINTS = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [5.0, 6.0]])
MOVED = np.array([[0, 0, 9.0], [0.1, 0, 8.0], [0, 0.2, 7.0], [0.3, 0.4, 6.0]])


def test_each_point_keeps_its_height_and_sigma():
    z, sigma = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.1, 0.2, 0.3, 0.4])
    whole = mirrored(DisplacementField(0.1, POINTS, MOVED, z=z, sigma=sigma))
    assert len(whole.points) == 1 + 2 + 2 + 4
    assert whole.z is not None and whole.sigma is not None
    for point, height, error in zip(whole.points, whole.z, whole.sigma, strict=True):
        (which,) = np.flatnonzero((POINTS == np.abs(point)).all(axis=1))
        assert (height, error) == (z[which], sigma[which])
    back = folded(whole)
    np.testing.assert_array_equal(back.z, whole.z)
    assert (back.points >= 0).all() and (back.displacement >= 0).all()


def test_a_field_without_height_has_none_when_mirrored():
    assert mirrored(DisplacementField(0.1, POINTS, MOVED)).z is None
