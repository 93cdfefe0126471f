"""meshes/outline.py: round and elliptic outlines."""

import numpy as np
import pytest
from bubblefit.meshes.outline import Outline
from hypothesis import given, settings
from hypothesis import strategies as st


@settings(max_examples=20)
@given(major=st.floats(1.0, 500.0), ratio=st.floats(0.25, 1.0), angle=st.floats(-90, 90))
def test_places_map_to_the_unit_disk_and_back(major, ratio, angle):
    outline = Outline(major, major * ratio, angle)
    points = np.random.default_rng(1).uniform(-1, 1, (20, 2))
    np.testing.assert_allclose(outline.unit(outline.places(points)), points, atol=1e-12)
    np.testing.assert_allclose(outline.share(outline.places(points)), np.hypot(*points.T))
    np.testing.assert_allclose(outline.share(outline.edge(9)), 1.0)


def test_major_axis_lies_at_its_angle_from_the_warp():
    outline = Outline(120.0, 80.0, 30.0)
    along = np.array([np.cos(np.pi / 6), 0.5])
    ends = np.array([120.0 * along, 80.0 * np.array([-along[1], along[0]])])
    np.testing.assert_allclose(outline.share(ends), 1.0)
    assert (np.hypot(*outline.edge(721).T).max(), outline.radius) == pytest.approx((120.0, 100.0))
    assert not outline.round and not outline.doubly_symmetric
    assert Outline(120.0, 80.0, -90.0).doubly_symmetric
    assert outline.words == "semi-axes 120 and 80 mm"
    points = np.random.default_rng(2).uniform(-1, 1, (20, 2))
    for outline in (Outline.circle(80.0), Outline(80.0, 80.0, 33.0)):
        np.testing.assert_array_equal(outline.places(points), 80.0 * points)
        np.testing.assert_array_equal(outline.unit(points), points / 80.0)
        assert outline.round and outline.doubly_symmetric and outline.words == "radius 80 mm"
