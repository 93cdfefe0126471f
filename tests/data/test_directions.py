"""Angles that repeat, and points on all sides, of a registration."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.placement import axes_angle, in_all_quarters, line_angle
from hypothesis import given
from hypothesis import strategies as st


@given(st.integers(-720, 720))
def test_a_line_and_two_axes_are_told_by_one_angle_each(degrees):
    line, axes = line_angle(degrees), axes_angle(degrees)
    assert -90 <= line < 90 and (line - degrees) % 180 == 0
    assert -45 <= axes < 45 and (axes - degrees) % 90 == 0


@pytest.mark.parametrize("missing", range(4))
def test_points_in_three_quarters_are_not_all_around(missing):
    # Heights of both signs are neither here nor there.
    points = np.array([[1.0, 1, 9], [1, -1, 9], [-1, 1, -9], [-1, -1, -9]] * 2)
    points[4:, 2] *= -1
    assert in_all_quarters(points) and in_all_quarters(points[:, :2])
    assert not in_all_quarters(np.delete(points, [missing, missing + 4], axis=0))
    assert not in_all_quarters(points[:0])
