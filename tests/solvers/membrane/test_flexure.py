"""solvers/membrane/flexure.py: bending energy of a wall."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.closed_surfaces import half_tube, tube_warp
from bubblefit.solvers.membrane.flexure import Flexure, flexure_of

R, L, THICKNESS = 75.0, 40.0, 0.8
SHEET = HypoelasticLaw.linear(800.0, 140.0, 20.0, 0.24)
PLANE = 1.0 / (1.0 - 0.24**2 * 140.0 / 800.0)


def quarter_of_rolled_sheet(across, warp=None, thickness=THICKNESS, caps=False):
    mesh = half_tube(across, 4, R, L, caps)
    p = mesh.points
    planes = np.zeros(p.shape, dtype=bool)
    planes[mesh.node_sets["symmetry_x"], 0] = True
    planes[mesh.node_sets["symmetry_z"], 2] = True
    planes[mesh.node_sets["end"], 2] = not caps
    warp = tube_warp(mesh, L) if warp is None else warp
    return p, flexure_of(p, mesh.quads, warp, thickness, planes)


def bending_energy(points, flexure):
    x = points.reshape(-1)
    return 0.5 * float(x @ (flexure.matrix(SHEET, len(points)) @ x))


def test_bending_energy_of_a_rolled_sheet():
    def rolled(modulus):
        """D/2 curvature^2 times the surface of half a tube."""
        return 0.5 * modulus * PLANE * THICKNESS**3 / 12.0 / R**2 * np.pi * R * L

    errors = [
        bending_energy(*quarter_of_rolled_sheet(n)) / rolled(140.0) - 1.0 for n in (16, 32, 64)
    ]
    assert abs(errors[2]) < 2e-3
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)
    # The same tube with its warp around: tangents of the facets turn, so given as one by one.
    mesh = half_tube(64, 4, R, L, caps=False)
    centre = mesh.points[mesh.quads].mean(axis=1)
    around = np.stack([-centre[:, 1], centre[:, 0], 0 * centre[:, 0]], axis=1)
    assert bending_energy(*quarter_of_rolled_sheet(64, around)) == pytest.approx(
        rolled(800.0), rel=3e-3
    )
    thin, thick = (bending_energy(*quarter_of_rolled_sheet(16, thickness=t)) for t in (0.4, 0.8))
    assert thick == pytest.approx(8.0 * thin, rel=1e-12)


def test_curvature_at_mirrored_lines_and_rim_of_a_cap():
    """Around, the curvature of the tube on top and bottom line; along, none in the end rings."""
    points, flexure = quarter_of_rolled_sheet(16)
    ends = flexure.nodes[:, 0] == flexure.nodes[:, 2]
    assert ends.sum() == 2 * 5 + 2 * 17  # top and bottom line; the rings at both ends
    curvature = np.einsum("hai,hai->hi", flexure.differences[ends], points[flexure.nodes[ends]])
    size = np.sort(np.linalg.norm(curvature, axis=1))
    assert size[-10:] == pytest.approx(np.full(10, 1 / R), rel=5e-3)
    assert size[:-10] == pytest.approx(0.0, abs=1e-12)
    # A rigid motion turns the forces between nodes and adds none.
    inner = Flexure(*(part[~ends] for part in (flexure.nodes, flexure.differences, flexure.shares)))
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    matrix = inner.matrix(SHEET, len(points))
    force = (matrix @ points.reshape(-1)).reshape(-1, 3)
    moved = (matrix @ (points @ turn.T + [3.0, -2.0, 5.0]).reshape(-1)).reshape(-1, 3)
    assert moved == pytest.approx(force @ turn.T, abs=1e-9 * np.abs(force).max())
    assert force.sum(axis=0) == pytest.approx(0.0, abs=1e-12)
    points, flexure = quarter_of_rolled_sheet(16, caps=True)
    before, node, after = points[flexure.nodes].transpose(1, 0, 2)
    rim = (node[:, 2] > L - 1e-6) & (np.hypot(node[:, 0], node[:, 1]) > R - 1e-6)
    assert rim.any()
    assert (before[rim, 2] > L - 1e-6).all() and (after[rim, 2] > L - 1e-6).all()
