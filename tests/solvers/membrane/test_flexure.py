"""Bending stiffness of the wall: energy of a sheet rolled up, rigid motions, thickness and warp."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.tube import half_tube, tube_warp
from bubblefit.solvers.membrane.closed import Flexure, flexure_of

RADIUS, LENGTH, THICKNESS = 75.0, 40.0, 0.8
LAW = HypoelasticLaw.linear(800.0, 140.0, 20.0, 0.24)
PLANE = 1.0 / (1.0 - 0.24**2 * 140.0 / 800.0)


def quarter(across: int, warp=None, thickness=THICKNESS, caps=False) -> tuple[np.ndarray, Flexure]:
    """Half of half a tube; planes x = 0 and both ends."""
    mesh = half_tube(across, 4, RADIUS, LENGTH, caps)
    p = mesh.points
    planes = np.zeros(p.shape, dtype=bool)
    planes[mesh.node_sets["symmetry_x"], 0] = True
    planes[mesh.node_sets["symmetry_z"], 2] = True
    planes[mesh.node_sets["end"], 2] = not caps
    directions = tube_warp(mesh, LENGTH) if warp is None else np.tile(warp, (len(mesh.quads), 1))
    return p, flexure_of(p, mesh.quads, directions, thickness, planes)


def energy(points: np.ndarray, flexure: Flexure) -> float:
    x = points.reshape(-1)
    return 0.5 * float(x @ (flexure.matrix(LAW, len(points)) @ x))


def rolled(modulus: float) -> float:
    """D/2 curvature^2 times the surface of half a tube."""
    stiffness = modulus * PLANE * THICKNESS**3 / 12.0
    return 0.5 * stiffness / RADIUS**2 * np.pi * RADIUS * LENGTH


def test_sheet_rolled_along_the_fill_has_its_bending_energy() -> None:
    errors = [energy(*quarter(n)) / rolled(140.0) - 1.0 for n in (16, 32, 64)]
    assert abs(errors[2]) < 2e-3
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


def test_sheet_rolled_along_the_warp() -> None:
    """The same tube with its warp around: tangents of the facets turn, so given as one by one."""
    mesh = half_tube(64, 4, RADIUS, LENGTH, caps=False)
    centre = mesh.points[mesh.quads].mean(axis=1)
    around = np.stack([-centre[:, 1], centre[:, 0], np.zeros(len(centre))], axis=1)
    planes = np.zeros(mesh.points.shape, dtype=bool)
    planes[mesh.node_sets["symmetry_x"], 0] = True
    planes[mesh.node_sets["symmetry_z"], 2] = planes[mesh.node_sets["end"], 2] = True
    flexure = flexure_of(mesh.points, mesh.quads, around, THICKNESS, planes)
    assert energy(mesh.points, flexure) == pytest.approx(rolled(800.0), rel=3e-3)


def test_energy_goes_with_the_cube_of_the_thickness() -> None:
    thin, thick = (energy(*quarter(16, thickness=t)) for t in (0.4, 0.8))
    assert thick == pytest.approx(8.0 * thin, rel=1e-12)


def test_rigid_motions_leave_forces_and_energy() -> None:
    """Of the lines within the mesh: a mirror stays where its plane is."""
    points, flexure = quarter(16)
    within = flexure.nodes[:, 0] != flexure.nodes[:, 2]
    flexure = Flexure(flexure.nodes[within], flexure.differences[within], flexure.shares[within])
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    matrix = flexure.matrix(LAW, len(points))
    force = (matrix @ points.reshape(-1)).reshape(-1, 3)
    moved = (matrix @ (points @ turn.T + [3.0, -2.0, 5.0]).reshape(-1)).reshape(-1, 3)
    assert moved == pytest.approx(force @ turn.T, abs=1e-9 * np.abs(force).max())
    assert force.sum(axis=0) == pytest.approx(0.0, abs=1e-12)


def test_a_mirrored_line_is_that_of_the_whole() -> None:
    """Around, the curvature of the tube on top and bottom line; along, none in the end rings."""
    points, flexure = quarter(16)
    ends = flexure.nodes[:, 0] == flexure.nodes[:, 2]
    assert ends.sum() == 2 * 5 + 2 * 17  # top and bottom line; the rings at both ends
    curvature = np.einsum("hai,hai->hi", flexure.differences[ends], points[flexure.nodes[ends]])
    size = np.linalg.norm(curvature, axis=1)
    assert np.sort(size)[-10:] == pytest.approx(np.full(10, 1 / RADIUS), rel=5e-3)
    assert np.sort(size)[:-10] == pytest.approx(0.0, abs=1e-12)


def test_the_rim_of_a_flat_cap_carries_no_moment() -> None:
    points, flexure = quarter(16, caps=True)
    before, node, after = points[flexure.nodes].transpose(1, 0, 2)
    rim = (node[:, 2] > LENGTH - 1e-6) & (np.hypot(node[:, 0], node[:, 1]) > RADIUS - 1e-6)
    assert rim.any()
    assert (before[rim, 2] > LENGTH - 1e-6).all() and (after[rim, 2] > LENGTH - 1e-6).all()
