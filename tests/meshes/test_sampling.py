"""meshes/sampling.py: displacements between the nodes, smooth from quad to quad."""

import numpy as np
import pytest
from bubblefit.meshes.disk import disk_mesh, elliptic_disk_mesh
from bubblefit.meshes.outline import Outline
from bubblefit.meshes.sampling import SmoothReading, sampling_matrix

from .mesh_checks import quadratic_field

POINTS = np.random.default_rng(5).uniform(-100, 100, (900, 2))


def dome(points):
    x, y = points[:, :2].T / 100.0
    return 30.0 * np.cos(1.2 * x + 0.3) * np.cos(1.0 * y - 0.2)


@pytest.mark.parametrize(
    "mesh",
    [
        disk_mesh(100.0, 48, "quarter"), disk_mesh(100.0, 112),
        elliptic_disk_mesh(Outline(120.0, 30.0, 40.0), 112),
    ],
    ids=["quarter", "full", "slender"],
)  # fmt: skip
def test_smooth_reading_keeps_nodes_and_quadratics(mesh):
    reading = SmoothReading.of(mesh)
    matrix, inside = reading.matrix(mesh.points[:, :2])
    assert inside.all()
    np.testing.assert_allclose(matrix.toarray(), np.eye(len(mesh.points)), atol=1e-9)
    matrix, inside = reading.matrix(POINTS)
    np.testing.assert_array_equal(inside, sampling_matrix(mesh, POINTS)[1])
    read = matrix @ quadratic_field(mesh.points)
    np.testing.assert_allclose(read, quadratic_field(POINTS[inside]), rtol=1e-8)
    few = SmoothReading.of(disk_mesh(100.0, 8, "quarter"))
    matrix, inside = few.matrix(np.array([[30.0, 30.0], [200.0, 0.0]]))
    assert inside.tolist() == [True, False]
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)


def test_smooth_reading_converges_with_third_order():
    """Third order instead of second; on 112 quads 0.03 mm instead of 0.3 mm."""
    own, facets = [], []
    for elements in (128, 512, 2048):
        mesh = disk_mesh(100.0, elements)
        readings = SmoothReading.of(mesh).matrix(POINTS), sampling_matrix(mesh, POINTS)
        for (matrix, inside), errors in zip(readings, (own, facets), strict=True):
            left = matrix @ dome(mesh.points) - dome(POINTS[inside])
            errors.append(float(np.sqrt(np.mean(left**2))))
    assert facets[0] > 0.1 and own[0] < 0.03
    assert np.log2(np.divide(facets[:-1], facets[1:])) == pytest.approx([2.0, 2.0], abs=0.2)
    assert (np.log2(np.divide(own[:-1], own[1:])) > 2.7).all(), own


def test_smooth_reading_is_continuous_from_quad_to_quad():
    mesh = disk_mesh(100.0, 112)
    ends = mesh.points[mesh.quads[:, :2], :2]
    ends = ends[np.hypot(*ends.mean(axis=1).T) < 80]
    across = 1e-7 * (ends[:, 1] - ends[:, 0])[:, ::-1] * [1, -1]
    reading = SmoothReading.of(mesh)
    sides = [reading.matrix(ends.mean(axis=1) + s * across)[0] @ dome(mesh.points) for s in (1, -1)]
    np.testing.assert_allclose(*sides, atol=1e-4)
