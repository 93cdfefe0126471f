"""solvers/membrane/kernel.py: forces and tangents of quads."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.mesh import log_strain_of
from bubblefit.runs.verification.thin_walls import ISOTROPIC, THICKNESS
from bubblefit.solvers.membrane.factorisation import tangent_for
from bubblefit.solvers.membrane.kernel import GAUSS_POINTS, reference_elements
from bubblefit.solvers.membrane.membrane import Membrane

from ...builders.laws import TABLE_4_2
from .cases import distorted_grid, plane_membrane


def twisted():
    x, y = np.meshgrid(np.linspace(0, 30, 5), np.linspace(0, 20, 4), indexing="ij")
    points = np.stack([x, y, 0.02 * x * y + 0.01 * x**2], axis=-1).reshape(-1, 3)
    corner = (np.arange(4)[:, None] * 4 + np.arange(3)).ravel()
    quads = np.stack([corner, corner + 4, corner + 5, corner + 1], axis=1)
    warp = np.random.default_rng(3).normal(size=(len(quads), 3)) * [1, 1, 0.2] + [2, 0, 0.5]
    return points, quads, warp


def test_curved_patch_in_an_even_deformation():
    points, quads, warp = twisted()
    elements = reference_elements(points, quads, warp)
    free = np.arange(points.size)
    m = Membrane(
        points, quads, elements, THICKNESS, ISOTROPIC, free,
        tangent_for(quads, points, free), 1e-9, step_limit=1.0,
    )  # fmt: skip
    gradient = np.eye(3) + 0.1 * np.random.default_rng(7).uniform(-1, 1, (3, 3))
    assert np.isfinite(m.unbalance(points @ gradient.T - points, 0.01, with_tangent=False))
    corner = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    for e, facet in enumerate(quads):
        for g, (a, b) in enumerate(GAUSS_POINTS):
            slopes = [[0.25 * i * (1 + j * b), 0.25 * j * (1 + i * a)] for i, j in corner]
            normal = np.cross(*(np.array(slopes).T @ points[facet]))
            normal /= np.linalg.norm(normal)
            along = warp[e] - (warp[e] @ normal) * normal
            along /= np.linalg.norm(along)
            yarns = np.stack([along, np.cross(normal, along)], axis=1)
            exact = log_strain_of(gradient @ yarns)
            assert m.strain_new[e, g] == pytest.approx(exact, abs=1e-12)


LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])


def rotation():
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))


@BOTH
def test_patch_of_distorted_elements(thickness_change):
    points, quads = distorted_grid(4, 4, 10.0, 12.0, distort=0.3)
    gradient = rotation() @ [[1.06, 0.02, 0.0], [0.02, 1.04, 0.0], [0.0, 0.0, 1.0]]
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    on_rim = ((points[:, :2] == low) | (points[:, :2] == high)).any(axis=1)
    held = (3 * np.flatnonzero(on_rim)[:, None] + np.arange(3)).ravel()
    patch = plane_membrane(points, quads, replace(LAW, thickness_change=thickness_change), held)
    exact = points @ gradient.T - points
    moves = np.random.default_rng(0).uniform(-0.2, 0.2, points.shape)
    found = patch.equilibrium(exact + ~on_rim[:, None] * moves, 0.0)
    assert found == pytest.approx(exact, abs=1e-8)
    stress = patch.stress_new.reshape(-1, 3)
    assert stress == pytest.approx(np.broadcast_to(stress[0], stress.shape), abs=1e-8)


@BOTH
@pytest.mark.parametrize("pressure", [0.0, 0.3])
def test_kernel_tangent_against_differences_of_the_residual(thickness_change, pressure):
    """Large deformation, stress and strain history, follower pressure: all 3 n by 3 n entries."""
    points, quads = distorted_grid(2, 2, 8.0, 10.0, distort=0.2)
    m = plane_membrane(points, quads, replace(LAW, thickness_change=thickness_change), [])
    random = np.random.default_rng(11)
    m.strain_old[:] = 0.02 * random.random(m.strain_old.shape)
    m.stress_old[:] = 5 + 5 * random.random(m.stress_old.shape)
    u = 0.06 * points + random.uniform(-0.15, 0.15, points.shape)
    u[:, 2] += 0.02 * points[:, 0] * (10.0 - points[:, 0])
    size = points.size
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    slot = (size * dofs[:, :, None] + dofs[:, None, :]).reshape(len(quads), 144)
    m.tangent.slot, m.tangent.data = slot, np.zeros(size * size)
    assert np.isfinite(m.unbalance(u, pressure, True))
    tangent = m.tangent.data.reshape(size, size).copy()
    expected = np.empty((size, size))
    for j, shift in enumerate(1e-6 * np.eye(size)):
        m.unbalance(u + shift.reshape(-1, 3), pressure, False)
        ahead = m.residual.copy()
        m.unbalance(u - shift.reshape(-1, 3), pressure, False)
        expected[:, j] = (ahead - m.residual) / 2e-6
    assert np.abs(tangent - expected).max() < 1e-6 * np.abs(tangent).max()
