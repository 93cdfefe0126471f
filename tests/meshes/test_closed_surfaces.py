"""meshes/closed_surfaces.py: octant of a sphere and half of a tube, joined from blocks."""

import numpy as np
import pytest
from bubblefit.meshes.closed_surfaces import half_tube, sphere_octant, surface_mesh, tube_warp

RADIUS, LENGTH = 50.0, 200.0


def area_vectors(mesh):
    corners = mesh.points[mesh.quads]
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def edge_counts(mesh):
    edges = np.sort(np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=2), axis=2)
    return np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)


def test_octant_of_a_sphere_has_its_nodes_on_the_sphere_and_outward_quads():
    mesh = sphere_octant(6, RADIUS)
    assert mesh.quads.shape == (3 * 6**2, 4)
    np.testing.assert_allclose(np.linalg.norm(mesh.points, axis=1), RADIUS)
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
        vectors = area_vectors(sphere_octant(n, RADIUS))
        errors.append(np.pi * RADIUS**2 / 2 - np.linalg.norm(vectors, axis=1).sum())
        # Whatever the mesh, the area seen along an axis is that of its edge's polygon.
        angle = np.linspace(0, np.pi / 2, 2 * n + 1)
        polygon = 0.5 * RADIUS**2 * np.sin(np.diff(angle)).sum()
        np.testing.assert_allclose(vectors.sum(axis=0), polygon)
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.05)


@pytest.mark.parametrize("across", [4, 8, 12])
def test_half_tube_with_its_cap_is_joined_without_gaps(across):
    mesh = half_tube(across, 10, RADIUS, LENGTH)
    edges, counts = edge_counts(mesh)
    assert counts.max() == 2
    # Edges of one quad lie in the plane x = 0 or at the open end z = 0.
    open_edges = mesh.points[edges[counts == 1]]
    in_plane = (np.abs(open_edges[..., 0]) < 1e-9).all(axis=1)
    at_start = (np.abs(open_edges[..., 2]) < 1e-9).all(axis=1)
    assert (in_plane | at_start).all()
    np.testing.assert_allclose(mesh.points[mesh.node_sets["end"], 2], LENGTH)
    foot = mesh.points[mesh.node_sets["foot"]]
    np.testing.assert_allclose(foot[:, :2], np.tile([0.0, -RADIUS], (len(foot), 1)), atol=1e-9)
    assert len(foot) == 11


def test_half_tube_without_its_cap_has_its_side_only():
    side, capped = (half_tube(8, 5, RADIUS, LENGTH, caps) for caps in (False, True))
    assert len(side.quads) == 40 < len(capped.quads)
    chord = 2 * RADIUS * np.sin(np.pi / 16)
    area = np.linalg.norm(area_vectors(side), axis=1).sum()
    assert area == pytest.approx(8 * chord * LENGTH)


def test_warp_of_a_half_tube_runs_along_it_and_across_its_cap():
    mesh = half_tube(8, 5, RADIUS, LENGTH)
    warp = tube_warp(mesh, LENGTH)
    is_cap = np.isclose(mesh.points[mesh.quads][..., 2].min(axis=1), LENGTH)
    assert is_cap.any() and (warp[is_cap] == [1, 0, 0]).all() and (warp[~is_cap] == [0, 0, 1]).all()


def test_blocks_share_the_nodes_at_their_common_edge():
    grid = np.stack(np.meshgrid([1.0, 2.0], [1.0, 2.0, 3.0], indexing="ij"), axis=-1)
    block = np.dstack([grid, np.full(grid.shape[:2], 5.0)])
    mesh = surface_mesh([block, block + np.array([1.0, 0.0, 0.0])])
    assert len(mesh.points) == 9 and len(mesh.quads) == 4
    assert (area_vectors(mesh)[:, 2] > 0).all()
