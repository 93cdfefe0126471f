"""meshes/mesh.py: meshes as plain data, their mirror images, memory and load levels."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.meshes import mesh as meshes
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import (
    Mesh,
    check_memory,
    fabric_frames,
    grid_quads,
    keep_levels,
    meshio_of,
    places_of,
    snapped,
    surface_strain,
    with_mirror_image,
)

from ..support.refusals import complaint

POINTS = np.array([[x, y, 0.0] for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0)])
QUADS = grid_quads(np.arange(6).reshape(3, 2))


def signed_areas(points, quads):
    corners = points[quads]
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])[:, 2]


def test_quads_of_a_grid_are_counter_clockwise():
    assert QUADS.tolist() == [[0, 2, 3, 1], [2, 4, 5, 3]]
    np.testing.assert_allclose(signed_areas(POINTS, QUADS), 1.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_mirror_image_shares_the_nodes_of_its_plane_and_keeps_the_side(axis):
    points, quads, source = with_mirror_image(POINTS, QUADS, axis)
    shared = np.count_nonzero(POINTS[:, axis] == 0)
    assert len(points) == 2 * len(POINTS) - shared and len(quads) == 4
    np.testing.assert_allclose(signed_areas(points, quads), 1.0)
    np.testing.assert_array_equal(np.abs(points), POINTS[source])
    assert len(np.unique(points, axis=0)) == len(points)


def test_numbers_of_unknowns_are_sorted_and_unique():
    mesh = Mesh(POINTS, QUADS, {"left": np.array([0, 1]), "low": np.array([0, 2, 4])})
    fixed = {"left": (0, 2), "low": (1, 2), "absent": (0,)}
    assert mesh.unknowns(fixed).tolist() == [0, 1, 2, 3, 5, 7, 8, 13, 14]
    assert mesh.unknowns({}).tolist() == []


def test_coordinates_near_zero_are_snapped():
    assert snapped(np.array([1e-9, -1e-9, 1e-3]), 1e-6).tolist() == [0.0, 0.0, 1e-3]


def test_analysis_beyond_the_free_memory_is_refused(monkeypatch):
    memory = SimpleNamespace(available=1e9)
    monkeypatch.setattr(meshes.psutil, "virtual_memory", lambda: memory)
    check_memory(meshes.SMALL, "elements")
    check_memory(33_000, "elements")
    message = complaint(check_memory, 34_000, "elements")
    assert message.startswith("elements: an analysis of 34000 quads takes about 1 GB")


def test_displaced_mesh_carries_its_data_to_meshio():
    mesh = Mesh(POINTS, QUADS, {})
    u = 0.1 * POINTS[:, [1, 0, 2]]
    written = meshio_of(mesh, u, {"height": POINTS[:, 1]}, {"share": [0.5, 0.25]})
    np.testing.assert_allclose(written.points, POINTS + u)
    np.testing.assert_allclose(written.point_data["displacement"], u)
    assert written.cell_data["share"][0].tolist() == [0.5, 0.25]
    with pytest.raises(ValueError, match="height: 2 rows for 6 nodes"):
        meshio_of(mesh, u, {"height": [1.0, 2.0]}, {})


def test_nearest_steps_to_levels():
    assert places_of([0.1, 0.29], [0.05, 0.1, 0.2, 0.3]).tolist() == [1, 3]


@dataclass(frozen=True)
class Levels:
    pressures: tuple = ()


@pytest.mark.parametrize(
    ("levels", "unloaded", "is_admissible"),
    [
        ((1.0, 2.0), False, True), ((2.0, 1.0), False, False), ((0.0, 1.0), False, False),
        ((), False, False), ((1.0, np.nan), False, False), ((2.0, 1.0), True, True),
        ((2.0, 2.0), True, False), ((2.0, 0.0), True, False),
    ],
)  # fmt: skip
def test_load_levels_are_positive_and_increase_unless_unloaded(levels, unloaded, is_admissible):
    model = Levels()
    if is_admissible:
        keep_levels(model, unloaded=unloaded, pressures=levels)
        assert model.pressures == levels
    else:
        message = complaint(keep_levels, model, " kPa", unloaded, pressures=levels)
        assert message.startswith("pressures: expected positive, increasing")


def test_frames_of_the_yarns_lie_in_the_plane_of_each_quad():
    tilted = POINTS + np.outer(POINTS[:, 0], [0.0, 0.0, 1.0])
    mesh = Mesh(tilted, QUADS, {})
    along, across = fabric_frames(mesh, [2.0, 0.0, 0.0])
    np.testing.assert_allclose(along, np.tile([1, 0, 1] / np.sqrt(2), (2, 1)), atol=1e-12)
    np.testing.assert_allclose(across, np.tile([0.0, 1.0, 0.0], (2, 1)), atol=1e-12)
    warp = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 1.0]])
    assert "normal to a facet (1 of 2 elements, the first is 2)" in complaint(
        fabric_frames, mesh, warp
    )


def test_strain_of_a_flat_mesh_turned_in_space():
    disk = disk_mesh(100.0, 96)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    warp = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    u = 4 * np.random.default_rng(4).standard_normal(disk.points.shape)
    turned = Mesh(
        disk.points @ turn.T, disk.quads, {}, {}, np.tile(turn @ warp, (len(disk.quads), 1))
    )
    flat = surface_strain(disk, u, warp)
    np.testing.assert_allclose(surface_strain(turned, u @ turn.T), flat, atol=1e-12)
    # Carried around as a whole it is not strained.
    moved = turned.points @ turn - turned.points + 7.0
    np.testing.assert_allclose(surface_strain(turned, moved), 0.0, atol=1e-12)
