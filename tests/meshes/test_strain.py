"""meshes/strain.py: strain of a mesh turned in space."""

import numpy as np
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strain import surface_strain


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
