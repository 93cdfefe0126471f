"""Sheets with an elliptic edge in the embedded membrane."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.meshes.mesh import sampling_matrix
from bubblefit.solvers.membrane.solver import MembraneSolver

ISOTROPIC = HypoelasticLaw.linear(400.0, 400.0, 400.0 / 2 / 1.24)
ORTHOTROPIC = HypoelasticLaw.linear(700.0, 300.0, 15.0)


def model(outline: Outline, elements=448, symmetry="full", pressures=(0.05, 0.15), **more):
    mesh = elliptic_disk_mesh(outline, elements, symmetry)
    return BubbleModel(mesh, 0.81, pressures, **more)


@pytest.mark.parametrize("angle", [0.0, 30.0, -55.0])
def test_a_taut_sheet_rises_as_poisson_s_equation_says(angle: float) -> None:
    """Forces n1, n2 from a stretch of 1 %: n1 w,xx + n2 w,yy = -p, solved by w0 (1 - x Q x)."""
    outline, stretch, pressure = Outline(120.0, 80.0, angle), 0.01, 1e-5
    taut = model(outline, pressures=(pressure,), slack=(-stretch, -stretch))
    strain = -np.log(1 - stretch)
    # Constant moduli, plane stress: both strains are the same.
    e1, e2, nu12 = 700.0, 300.0, 0.24
    share = 1 - nu12**2 * e2 / e1
    n1, n2 = (0.81 * strain / share * n for n in (e1 + nu12 * e2, e2 + nu12 * e2))
    form = np.linalg.inv(outline.stretch @ outline.stretch)
    height = pressure / 2 / (n1 * form[0, 0] + n2 * form[1, 1])
    moved = MembraneSolver(1e-12).run(taut, ORTHOTROPIC).displacement[0, :, 2]
    expected = height * (1 - outline.share(taut.mesh.points[:, :2]) ** 2)
    np.testing.assert_allclose(moved, expected, atol=0.004 * height)


def test_the_field_of_an_isotropic_sheet_turns_with_its_edge() -> None:
    """A quarter turn turns the mesh, too; other angles leave another mesh: 1 % of the height,
    which is the sag of the quads that a field is read from."""
    first = model(Outline(120.0, 80.0, 0.0))
    flat = MembraneSolver().run(first, ISOTROPIC).displacement[-1]
    for angle, within in ((90.0, 1e-6), (35.0, 1e-2)):
        other = model(Outline(120.0, 80.0, angle))
        moved = MembraneSolver().run(other, ISOTROPIC).displacement[-1]
        turn = np.radians(angle)
        c, s = np.cos(turn), np.sin(turn)
        back = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        # Next to the rim, values between the nodes of a coarse mesh are not good enough.
        near = Outline(120.0, 80.0, angle).share(other.mesh.points[:, :2]) < 0.85
        sample, inside = sampling_matrix(first.mesh, (other.mesh.points @ back)[near, :2])
        assert inside.all()
        within_mm = within * flat[:, 2].max()
        np.testing.assert_allclose((moved @ back)[near], sample @ flat, atol=within_mm)


def test_a_quarter_is_the_whole_and_the_rim_carries_the_load() -> None:
    outline = Outline(120.0, 80.0, 90.0)
    whole, quarter = (model(outline, 192, s) for s in ("full", "quarter"))
    of_whole, of_quarter = (MembraneSolver().run(m, ORTHOTROPIC) for m in (whole, quarter))
    sample, _ = sampling_matrix(whole.mesh, quarter.mesh.points[:, :2])
    for frame in range(2):
        there = sample @ of_whole.displacement[frame]
        np.testing.assert_allclose(of_quarter.displacement[frame], there, atol=1e-5)
    # Pressure times the area of the polygon, whatever the shape of the dome.
    p = whole.mesh.points[whole.mesh.quads]
    area = 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])[:, 2].sum()
    up = -of_whole.reactions["rim"][:, 2]
    np.testing.assert_allclose(np.abs(up), area * np.array([0.05, 0.15]), rtol=1e-6)


def test_nearly_a_circle_is_nearly_the_circle() -> None:
    round_, other = Outline.circle(100.0), Outline(100.0 + 1e-6, 100.0 - 1e-6, 20.0)
    both = [MembraneSolver().run(model(o, 192), ORTHOTROPIC).displacement for o in (round_, other)]
    np.testing.assert_allclose(*both, atol=1e-4)


def test_a_slender_sheet_is_inflated() -> None:
    moved = MembraneSolver().run(model(Outline(120.0, 30.0, 70.0), 192), ORTHOTROPIC).displacement
    assert 3.0 < moved[-1, :, 2].max() < 15.0
