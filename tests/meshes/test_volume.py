"""meshes/volume.py: the enclosed volume and its gradient."""

import numpy as np
import pytest
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.meshes.volume import enclosed_volume, volume_and_gradient
from bubblefit.solvers.calculix.deck import pressure_forces

RADIUS, LENGTH = 75.0, 400.0
BOX = Mesh(
    np.array([(x, y, z) for x in (0, 2) for y in (0, 3) for z in (0, 5)], float),
    np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]),
    {},
)


def moved(points, size):
    return points + size * np.random.default_rng(3).standard_normal(points.shape)


def test_volume_of_a_box_does_not_depend_on_its_position():
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    assert enclosed_volume(BOX.points, BOX.quads) == pytest.approx(30.0, rel=1e-14)
    assert enclosed_volume(7 + BOX.points @ turn.T, BOX.quads) == pytest.approx(30.0, rel=1e-12)
    assert enclosed_volume(BOX.points, BOX.quads[:, ::-1]) == pytest.approx(-30.0, rel=1e-14)
    # A unit cube whose lid is z = 1 + x y / 2: one eighth more.
    cube = np.sign(BOX.points)
    cube[7, 2] = 1.5
    assert enclosed_volume(cube, BOX.quads) == pytest.approx(1.125, rel=1e-14)


def test_volume_gradient_is_the_derivative_on_a_closed_surface():
    mesh = cylinder_mesh(LENGTH, 2 * RADIUS, 60.0, 40.0, "full")
    points = moved(mesh.points, 3.0)  # quads warped, too
    gradient = volume_and_gradient(points, mesh.quads)[1]
    for seed in range(5):
        way = np.random.default_rng(seed).standard_normal(points.shape)
        ahead, behind = (enclosed_volume(points + s * way, mesh.quads) for s in (1e-3, -1e-3))
        # Cubic in the way, so that central differences are off by 1e-6 of the cubic term.
        assert (gradient * way).sum() == pytest.approx((ahead - behind) / 2e-3, rel=1e-7)
    np.testing.assert_allclose(gradient.sum(axis=0), 0, atol=1e-9 * np.abs(gradient).sum())
    volume = enclosed_volume(points, mesh.quads)
    assert (gradient * points).sum() == pytest.approx(3 * volume, rel=1e-12)
    forces = pressure_forces(points, mesh.quads, 1.0)
    np.testing.assert_allclose(gradient, forces, atol=1e-9 * np.abs(gradient).max())


def test_volume_gradient_of_a_quarter_holds_for_moves_in_its_planes():
    mesh = cylinder_mesh(LENGTH, 2 * RADIUS, 60.0, 40.0, "quarter")
    bounds = ((mesh.node_sets["symmetry_x"], 0), (mesh.node_sets["symmetry_z"], 2))
    points, way = moved(mesh.points, 3.0), moved(np.zeros_like(mesh.points), 1.0)
    for nodes, axis in bounds:
        points[nodes, axis] = way[nodes, axis] = 0.0
    ahead, behind = (enclosed_volume(points + s * way, mesh.quads) for s in (1e-3, -1e-3))
    found = (volume_and_gradient(points, mesh.quads)[1] * way).sum()
    assert found == pytest.approx((ahead - behind) / 2e-3, rel=1e-7)
    # The pressure on the cut through the middle: what the planes must give back.
    total = volume_and_gradient(mesh.points, mesh.quads)[1].sum(axis=0)
    high = np.ptp(mesh.points[mesh.node_sets["mid_span"], 1])
    assert total[2] == pytest.approx(np.pi * RADIUS**2 / 2, rel=1e-12)
    assert total[0] == pytest.approx(high * LENGTH / 2, rel=1e-12)
    assert total[1] == pytest.approx(0.0, abs=1e-9 * total[0])
