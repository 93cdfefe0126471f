"""Which nodes and which measured points make a profile."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.bubbles import node_cut, point_cut

#: Rows of points along x: on the axis and 2.5 mm beside it, each point 5.6 mm from the next.
ALONG = np.arange(0.0, 100.0, 10.0)
ROWS = np.vstack(
    [np.column_stack([ALONG, 0 * ALONG]), np.column_stack([ALONG + 5, 0 * ALONG + 2.5])]
)


def still(points: np.ndarray) -> np.ndarray:
    """Risen by 1 mm for every mm of x, not moved aside."""
    return np.column_stack([0 * points, points[:, 0]])


@pytest.mark.parametrize(("on", "used"), [(10, 10), (5, 5), (4, 14)])
def test_five_points_on_the_axis_are_its_profile(on: int, used: int) -> None:
    """Of fewer, those beside it count as well."""
    points = np.vstack([ROWS[:on], ROWS[10:]])
    cut = point_cut(points, still(points), 0)
    assert len(cut.position) == used
    np.testing.assert_array_equal(cut.height, cut.position)
    assert (np.diff(cut.position) > 0).all()


@pytest.mark.parametrize(
    ("points", "used"),
    [([[3.0, 2.0], [3.0, -2.0]], 2), ([[3.0, 2.0], [7.0, 2.5]], 1), ([[3.0, 2.0]], 0),
     ([[3.0, 0.0]], 1), ([[3.0, 2.0], [6.0, 2.0]], 0)],
)  # fmt: skip
def test_few_points(points: list[list[float]], used: int) -> None:
    """Half their distance from the axis at most; one alone has to lie on it."""
    given = np.array(points)
    assert len(point_cut(given, still(given), 0).position) == used


def test_no_points() -> None:
    assert len(point_cut(np.zeros((0, 2)), np.zeros((0, 3)), 1).position) == 0


@pytest.mark.parametrize(("on", "taken"), [(5, 5), (4, 81)])
def test_five_nodes_on_the_axis_are_its_profile(on: int, taken: int) -> None:
    """Of fewer, the mesh is cut at as many places from end to end."""
    x = np.linspace(0.0, 80.0, on)
    beside = np.column_stack([np.repeat([0.0, 80.0], 2), np.tile([-10.0, 10.0], 2)])
    points = np.vstack([np.column_stack([x, 0 * x]), beside])
    cut = node_cut(points, still(points), 0)
    assert len(cut.position) == taken
    np.testing.assert_allclose(cut.position, np.linspace(0.0, 80.0, taken))
    np.testing.assert_allclose(cut.height, cut.position)


@pytest.mark.parametrize("cut", [node_cut, point_cut])
def test_heights_at_rest_do_not_count(cut) -> None:
    """Points of a measured sheet have three coordinates: places are told by x and y."""
    draw = np.random.default_rng(2)
    flat = draw.uniform(-50, 50, (200, 2))
    moved = np.column_stack([0.01 * flat, 10.0 - 1e-3 * (flat**2).sum(axis=1)])
    raised = np.column_stack([flat, 600.0 + 40.0 * draw.normal(size=200)])
    for axis in (0, 1):
        one, other = cut(flat, moved, axis), cut(raised, moved, axis)
        assert len(one.position) > 3
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(one.height, other.height)
