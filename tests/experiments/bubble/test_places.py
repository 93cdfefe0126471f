"""Fields folded onto the quarter that is fitted, and mirrored from it."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import at_nodes, folded, mirrored
from bubblefit.meshes.disk import disk_mesh
from bubblefit.readers.fields import DisplacementField

POINTS = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [5.0, 6.0]])
MOVED = np.array([[0, 0, 9.0], [0.1, 0, 8.0], [0, 0.2, 7.0], [0.3, 0.4, 6.0]])


def inflated(points: np.ndarray) -> np.ndarray:
    """Displacement of a doubly symmetric bubble, another along x than along y."""
    x, y = points.T
    height = 1.0 - 0.6 * x**2 - 0.8 * y**2
    return np.stack([0.3 * x * height, -0.2 * y * height**2, height], axis=1)


def test_a_field_is_turned_as_it_is_folded() -> None:
    """Every place lies in the quarter, and shows there what the quarter itself shows."""
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 2))
    assert {tuple(s) for s in np.sign(points)} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    field = folded(DisplacementField(0.1, points, inflated(points)))
    assert (field.points == np.abs(points)).all()
    assert field.displacement == pytest.approx(inflated(np.abs(points)), abs=1e-15)


def test_a_quarter_mirrored_is_the_whole_and_folds_back() -> None:
    points = np.random.default_rng(2).uniform(0.0, 1.0, (10, 2))
    points[0], points[1] = (0.0, 0.5), (0.4, 0.0)  # on the axes once, not twice
    whole = mirrored(DisplacementField(0.1, points, inflated(points)))
    assert len(whole.points) == 4 * 8 + 2 * 2
    assert whole.displacement == pytest.approx(inflated(whole.points), abs=1e-15)
    again = folded(whole)
    assert again.displacement == pytest.approx(inflated(again.points), abs=1e-15)


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


def test_a_whole_field_is_not_mirrored_again():
    whole = DisplacementField(0.1, POINTS * (-1, 1), MOVED * (-1, 1, 1))
    assert mirrored(whole) is whole


def test_a_point_beside_the_axis_by_rounding_is_on_it():
    """A field of the quarter stays one, and has such a point once on either side."""
    points = POINTS.copy()
    points[2, 0] = -1e-12
    assert len(mirrored(DisplacementField(0.1, points, MOVED)).points) == 1 + 2 + 2 + 4


def test_computed_fields_at_the_nodes_of_a_model() -> None:
    """Those of the same mesh as they are; of another one interpolated, and clamped at the rim."""
    mesh, other = disk_mesh(1.0, 48), disk_mesh(1.0, 192, "quarter")

    def field(points: np.ndarray) -> np.ndarray:
        round_ = 1 - (points[:, :2] ** 2).sum(axis=1)
        return np.column_stack([points[:, 0] * round_, -points[:, 1] * round_, round_])

    noisy = field(mesh.points) + np.random.default_rng(1).normal(0, 0.1, mesh.points.shape)
    same = DisplacementField(0.1, mesh.points[:, :2] + 1e-10, noisy)
    between = DisplacementField(0.2, other.points[:, :2], field(other.points))
    first, second = at_nodes([same, between], mesh)
    assert (first.pressure, second.pressure) == (0.1, 0.2) and first.displacement is noisy
    np.testing.assert_allclose(second.displacement, field(mesh.points), atol=0.01)
    np.testing.assert_array_equal(second.displacement[mesh.node_sets["rim"]], 0.0)
