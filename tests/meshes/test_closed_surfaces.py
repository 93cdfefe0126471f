"""meshes/closed_surfaces.py: spheres and tubes joined from blocks, and the volume inside."""

import numpy as np
import pytest
from bubblefit.meshes.closed_surfaces import (
    enclosed_volume,
    half_tube,
    sphere_octant,
    surface_mesh,
    tube_warp,
    volume_and_gradient,
)
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.tube import cylinder_mesh
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


BLOCK_RADIUS, BLOCK_LENGTH = 50.0, 200.0


def area_vectors(mesh):
    corners = mesh.points[mesh.quads]
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def edge_counts(mesh):
    edges = np.sort(np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=2), axis=2)
    return np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)


def test_octant_of_a_sphere_has_its_nodes_on_the_sphere_and_outward_quads():
    mesh = sphere_octant(6, BLOCK_RADIUS)
    assert mesh.quads.shape == (3 * 6**2, 4)
    np.testing.assert_allclose(np.linalg.norm(mesh.points, axis=1), BLOCK_RADIUS)
    assert (mesh.points > -1e-9).all()
    outward = np.einsum("mk,mk->m", area_vectors(mesh), mesh.points[mesh.quads].mean(axis=1))
    assert (outward > 0).all()
    for axis, name in enumerate("xyz"):
        nodes = mesh.node_sets[f"symmetry_{name}"]
        assert len(nodes) == 2 * 6 + 1
        np.testing.assert_allclose(mesh.points[nodes, axis], 0.0, atol=1e-9)


def test_area_and_projections_of_an_octant_converge_with_second_order():
    errors = []
    for n in (4, 8, 16):
        vectors = area_vectors(sphere_octant(n, BLOCK_RADIUS))
        errors.append(np.pi * BLOCK_RADIUS**2 / 2 - np.linalg.norm(vectors, axis=1).sum())
        # Whatever the mesh, the area seen along an axis is that of its edge's polygon.
        angle = np.linspace(0, np.pi / 2, 2 * n + 1)
        polygon = 0.5 * BLOCK_RADIUS**2 * np.sin(np.diff(angle)).sum()
        np.testing.assert_allclose(vectors.sum(axis=0), polygon)
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.05)


@pytest.mark.parametrize("across", [4, 8, 12])
def test_half_tube_with_its_cap_is_joined_without_gaps(across):
    mesh = half_tube(across, 10, BLOCK_RADIUS, BLOCK_LENGTH)
    edges, counts = edge_counts(mesh)
    assert counts.max() == 2
    # Edges of one quad lie in the plane x = 0 or at the open end z = 0.
    open_edges = mesh.points[edges[counts == 1]]
    in_plane = (np.abs(open_edges[..., 0]) < 1e-9).all(axis=1)
    at_start = (np.abs(open_edges[..., 2]) < 1e-9).all(axis=1)
    assert (in_plane | at_start).all()
    np.testing.assert_allclose(mesh.points[mesh.node_sets["end"], 2], BLOCK_LENGTH)
    foot = mesh.points[mesh.node_sets["foot"]]
    np.testing.assert_allclose(
        foot[:, :2], np.tile([0.0, -BLOCK_RADIUS], (len(foot), 1)), atol=1e-9
    )
    assert len(foot) == 11


def test_half_tube_without_its_cap_has_its_side_only():
    side, capped = (half_tube(8, 5, BLOCK_RADIUS, BLOCK_LENGTH, caps) for caps in (False, True))
    assert len(side.quads) == 40 < len(capped.quads)
    chord = 2 * BLOCK_RADIUS * np.sin(np.pi / 16)
    area = np.linalg.norm(area_vectors(side), axis=1).sum()
    assert area == pytest.approx(8 * chord * BLOCK_LENGTH)


def test_warp_of_a_half_tube_runs_along_it_and_across_its_cap():
    mesh = half_tube(8, 5, BLOCK_RADIUS, BLOCK_LENGTH)
    warp = tube_warp(mesh, BLOCK_LENGTH)
    is_cap = np.isclose(mesh.points[mesh.quads][..., 2].min(axis=1), BLOCK_LENGTH)
    assert is_cap.any() and (warp[is_cap] == [1, 0, 0]).all() and (warp[~is_cap] == [0, 0, 1]).all()


def test_blocks_share_the_nodes_at_their_common_edge():
    grid = np.stack(np.meshgrid([1.0, 2.0], [1.0, 2.0, 3.0], indexing="ij"), axis=-1)
    block = np.dstack([grid, np.full(grid.shape[:2], 5.0)])
    mesh = surface_mesh([block, block + np.array([1.0, 0.0, 0.0])])
    assert len(mesh.points) == 9 and len(mesh.quads) == 4
    assert (area_vectors(mesh)[:, 2] > 0).all()
