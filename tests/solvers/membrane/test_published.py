"""Bubbles against Hencky's series, ellipses and published Abaqus results."""

from functools import cache

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.meshes.mesh import sampling_matrix
from bubblefit.runs.verification import cases, shapes
from bubblefit.runs.verification.closed_forms import (
    FICHTER,
    MODULUS,
    RADIUS,
    TERMS,
    THICKNESS,
    apex_coefficient,
    stress_series,
)
from bubblefit.solvers.membrane.solver import MembraneSolver


# --- hencky ---
def apex(elements, pressure, nu, change="constant"):
    law = HypoelasticLaw.linear(MODULUS, MODULUS, MODULUS / 2 / (1 + nu), nu, change)
    mesh = disk_mesh(RADIUS, elements, "quarter")
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, [pressure]), law)
    return float(history.displacement[0, mesh.node_sets["apex"][0], 2])


def hencky(pressure, nu):
    scale = (pressure * RADIUS / (MODULUS * THICKNESS)) ** (1 / 3)
    return apex_coefficient(nu) * RADIUS * scale


def pressure_for(height, nu):
    """MPa at which Hencky's apex is height * R."""
    return (height / apex_coefficient(nu)) ** 3 * MODULUS * THICKNESS / RADIUS


@pytest.mark.parametrize(("nu", "b_0"), FICHTER.items())
def test_the_series_itself_against_fichter(nu, b_0):
    """W. B. Fichter, NASA TP 3658 (1997), table of b_0 for Hencky's problem; four decimals."""
    c = stress_series(b_0 / 4)
    assert (1 - nu) * c.sum() + 2 * np.arange(TERMS) @ c == pytest.approx(0.0, abs=5e-5)
    assert c[1] == pytest.approx(-1 / b_0**2 / 4)
    assert abs(c[-1]) < 1e-12
    # Hencky's number, as quoted by Timoshenko's successors.
    assert apex_coefficient(0.3) == pytest.approx(0.653, abs=5e-4)


@pytest.mark.parametrize("nu", [0.1, 0.24, 0.3, 0.45])
def test_apex_within_half_a_percent_on_a_fine_mesh(nu):
    pressure = pressure_for(0.02, nu)  # strains of about 2.5e-4
    assert apex(3200, pressure, nu) == pytest.approx(hencky(pressure, nu), rel=5e-3)


def test_second_order_convergence_to_hencky(capsys):
    """Nested meshes; what the small slopes of the theory leave out (height squared) is removed."""
    nu, counts = 0.3, [128, 512, 2048, 8192]  # n = 4, 8, 16, 32 divisions of the core

    def errors(height):
        pressure = pressure_for(height, nu)
        return np.array([apex(n, pressure, nu) for n in counts]) / hencky(pressure, nu) - 1.0

    low, high = errors(0.02), errors(0.04)
    small = (4 * low - high) / 3
    order = np.log2(small[:-1] / small[1:])
    with capsys.disabled():
        print(f"\nHencky: quads {[n // 4 for n in counts]}, relative error of the apex {small}")
        print(f"order {order.round(2)}; at height 0.02 R {low}, 0.04 R {high}")
    assert [len(disk_mesh(RADIUS, n, "quarter").quads) for n in counts] == [32, 128, 512, 2048]
    assert order == pytest.approx(np.full(3, 2.0), abs=0.2)
    assert 0 < small[-1] < 1e-4
    assert low[-1] < 5e-3 and high[-1] < 5e-3


def test_thickness_change_and_pressure_at_small_strain():
    pressure = pressure_for(0.02, 0.3)
    constant, thin = (apex(192, pressure, 0.3, c) for c in ("constant", "incompressible"))
    assert thin == pytest.approx(constant, rel=1e-3)
    assert thin > constant
    low, high = pressure_for(0.01, 0.3), 8 * pressure_for(0.01, 0.3)
    assert apex(192, high, 0.3) / apex(192, low, 0.3) == pytest.approx(2.0, rel=5e-4)


# --- elliptic ---
ISOTROPIC = HypoelasticLaw.linear(400.0, 400.0, 400.0 / 2 / 1.24)
ORTHOTROPIC = HypoelasticLaw.linear(700.0, 300.0, 15.0)


def model(outline, elements=448, symmetry="full", pressures=(0.05, 0.15), **more):
    mesh = elliptic_disk_mesh(outline, elements, symmetry)
    return BubbleModel(mesh, 0.81, pressures, **more)


@pytest.mark.parametrize("angle", [0.0, 30.0, -55.0])
def test_a_taut_sheet_rises_as_poisson_s_equation_says(angle):
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


def test_the_field_of_an_isotropic_sheet_turns_with_its_edge():
    """A quarter turn turns the mesh, too; other angles leave another mesh, off by 1 %."""
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


def test_a_quarter_is_the_whole_and_the_rim_carries_the_load():
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


def test_nearly_round_and_slender_sheets():
    round_, other = Outline.circle(100.0), Outline(100.0 + 1e-6, 100.0 - 1e-6, 20.0)
    both = [MembraneSolver().run(model(o, 192), ORTHOTROPIC).displacement for o in (round_, other)]
    np.testing.assert_allclose(*both, atol=1e-4)
    moved = MembraneSolver().run(model(Outline(120.0, 30.0, 70.0), 192), ORTHOTROPIC).displacement
    assert 3.0 < moved[-1, :, 2].max() < 15.0


# --- abaqus ---
#: Error of reading the published figures, mm.
DIGITISED = 0.03
MODELS = [(1, "e"), (1, "ew"), (2, "e"), (2, "ew")]


@cache
def compare(test, model):
    """Ours and theirs: apex and extreme in-plane displacements, a row a pressure."""
    rows = dict(cases())[test, model]
    return shapes(rows, 1600, MembraneSolver()), rows


@pytest.mark.parametrize(("test", "model"), MODELS)
def test_apex_at_every_pressure(test, model):
    """0.5 % everywhere, 0.1 % above 50 kPa."""
    ours, rows = compare(test, model)
    theirs = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)
    error = np.abs(ours["apex"] / theirs - 1.0).to_numpy()
    high = rows["p_bar"].to_numpy() > 0.5
    print(rows["p_bar"].to_numpy()[~high], error[~high], "above", error[high].max())
    assert error.max() < 5e-3
    assert error[high].max() < 1e-3


@pytest.mark.parametrize(("test", "model"), MODELS)
def test_in_plane_displacements(test, model):
    """Their extremes along the two axes, to the error of reading the figures."""
    ours, rows = compare(test, model)
    for axis in ("x", "y"):
        gap = np.abs(ours[f"du_{axis}"] - rows[f"du_{axis}_max"]).max()
        print(axis, gap)
        assert gap < DIGITISED
