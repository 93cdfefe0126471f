"""Validation: bubbles, strips, patches and bent cylinders of CalculiX against the membrane."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.forms.symmetry import symmetric
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.meshes.strip_models import PatchModel, bias_strip, elongations
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.storage.writing import TEMPLATES

from ..builders.fortran import BETA, LAWS
from ..solvers.calculix.cases import (
    BIAS,
    COARSE,
    SOME,
    STRIP_LAW,
    THICKNESS,
    WIDTH,
    strip_model_of,
    uneven_bubble,
)
from ..support.refusals import refused

CUBIC = HypoelasticLaw(BETA, strain_range=np.full(3, 0.13))
LINEAR = HypoelasticLaw.linear(800.0, 400.0, 20.0)
TRILINEAR = HypoelasticLaw.trilinear(
    (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (40.0, 30.0, 60.0),
    [[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]],
)  # fmt: skip
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)
#: As far in fewer, larger increments; a spline's moduli change too much within them.
SOME_PRESSURES = (0.059, 0.132, 0.3)
AGREEMENT = 0.003  # of the apex height


def bubble_model_of(elements, symmetry="quarter", pressures=PRESSURES):
    mesh = disk_mesh(100.0, elements, symmetry)
    return BubbleModel(mesh, 0.81, pressures, default_increments(pressures))


def relative_differences(element, model, law):
    """Largest difference of apex and of any component anywhere, over the apex height, (frames,)."""
    found = CalculixSolver(element=element).run(model, law)
    expected = MembraneSolver().run(model, law)
    np.testing.assert_allclose(found.load, expected.load)
    apex = model.mesh.node_sets["apex"][0]
    height = expected.displacement[:, apex, 2]
    difference = np.abs(found.displacement - expected.displacement)
    return difference[:, apex, 2] / height, difference.max(axis=(1, 2)) / height, found, expected


# S4 stops at 251 kPa with the cubic law: docs/how-to/calculix.md says why.
@pytest.mark.parametrize(
    ("element", "elements", "law", "pressures"),
    [
        ("S8R", 432, CUBIC, PRESSURES),
        ("S8R", 432, LINEAR, SOME_PRESSURES),
        ("S8R", 432, TRILINEAR, SOME_PRESSURES),
        ("S8R", 432, LAWS["spline"], PRESSURES),
        ("S4", 1728, LINEAR, SOME_PRESSURES),
        ("S4", 972, CUBIC, (0.059, 0.132, 0.251)),
    ],
    ids=["S8R-cubic", "S8R-linear", "S8R-trilinear", "S8R-spline", "S4-linear", "S4-cubic"],
)
def test_bubbles_agree_with_the_membrane(ccx, element, elements, law, pressures):
    apex, field, found, expected = relative_differences(
        element, bubble_model_of(elements, "quarter", pressures), law
    )

    assert apex.max() < AGREEMENT
    assert field.max() < AGREEMENT
    # Support forces: what the pressure pushes up, the rim and the corners of its sets take.
    up = expected.reactions["rim"][:, 2]
    np.testing.assert_allclose(found.reactions["rim"][:, 2], up, rtol=0.01)
    np.testing.assert_allclose(found.strain_max, expected.strain_max, rtol=0.03)


def test_pressure_of_shells_acts_on_their_inner_face(ccx):
    """It is smaller than the middle surface by t/R, R of the cap: p is, as the membrane has it."""
    fine = bubble_model_of(1728, "quarter", SOME_PRESSURES)

    def height(model, solver):
        return solver.run(model, LINEAR).displacement[:, model.mesh.node_sets["apex"][0], 2]

    shells = height(bubble_model_of(192, "quarter", SOME_PRESSURES), CalculixSolver(element="S8R"))
    middle = height(fine, MembraneSolver())
    inner = np.array(SOME_PRESSURES) * (1.0 - 0.81 * 2.0 * middle / (middle**2 + 100.0**2))
    lower = height(bubble_model_of(1728, "quarter", tuple(inner.tolist())), MembraneSolver())
    assert (np.abs(shells / lower - 1) < 0.4 * np.abs(shells / middle - 1))[1:].all()
    assert shells[-1] / middle[-1] - 1 < -0.0007


def test_raised_slack_sheet_with_a_moving_rim_agrees_with_the_membrane(ccx):
    """A coarse mesh, for time: elements of the two differ by 0.4 % at the apex, 1.5 % anywhere."""
    model = uneven_bubble(112, (0.059,))
    apex, field, found, expected = relative_differences("S8R", model, LINEAR)
    assert apex.max() < 0.006 and field.max() < 0.025
    rim = model.mesh.node_sets["rim"]
    at_rim = found.displacement[-1, rim], expected.displacement[-1, rim]
    np.testing.assert_allclose(*at_rim, atol=1e-6)
    up = expected.reactions["rim"][:, 2]
    np.testing.assert_allclose(found.reactions["rim"][:, 2], up, rtol=0.02)
    # Each of the three is worth far more than that.
    height = expected.displacement[-1, model.mesh.node_sets["apex"][0], 2]
    for without in ({"slack": (0.0, 0.0)}, {"rim_motion": None}, {"mesh": disk_mesh(100.0, 112)}):
        other = MembraneSolver().run(replace(model, **without), LINEAR).displacement[-1]
        assert abs(other[model.mesh.node_sets["apex"][0], 2] / height - 1) > 0.03, without


def test_increments_of_calculix_do_not_change_the_result(ccx, tmp_path):
    model = bubble_model_of(64, "quarter", (0.059, 0.132, 0.186))
    text = (TEMPLATES / "calculix" / "bubble.inp.j2").read_text()
    (tmp_path / "bubble.inp.j2").write_text(
        text.replace("least | number }}, 1\n", "least | number }}, 0.25\n")
    )
    plain = CalculixSolver(element="S4").run(model, CUBIC)
    cut = CalculixSolver(element="S4", templates=tmp_path).run(model, CUBIC)
    assert cut.iterations > 1.5 * plain.iterations
    np.testing.assert_allclose(cut.displacement, plain.displacement, atol=2e-5)


def test_elliptic_edge_agrees_with_the_membrane(ccx):
    mesh = elliptic_disk_mesh(Outline(120.0, 80.0, 90.0), 192, "quarter")
    apex, field, *_ = relative_differences("S8R", BubbleModel(mesh, 0.81, (0.06,)), LINEAR)
    assert apex.max() < AGREEMENT and field.max() < 0.01


def test_pressure_offset_and_full_disk_agree_with_the_membrane(ccx):
    model = bubble_model_of(64, "quarter", (0.022, 0.059))
    moved = model.with_parameters({"pressure_offset": 0.003})
    np.testing.assert_allclose(moved.pressures, (0.025, 0.062))
    found = CalculixSolver(element="S4").run(moved, LINEAR)
    expected = MembraneSolver().run(moved, LINEAR)
    np.testing.assert_allclose(found.load, expected.load)
    apex = model.mesh.node_sets["apex"][0]
    heights = found.displacement[:, apex, 2], expected.displacement[:, apex, 2]
    np.testing.assert_allclose(*heights, rtol=2e-3)
    refused(model.with_parameters, {"pressure_offset": -0.02})
    # A whole disk is four quarters.
    whole = bubble_model_of(64, "full", (0.025, 0.062))
    disk = CalculixSolver(element="S4").run(whole, LINEAR)
    for i, point in enumerate(model.mesh.points):
        j = int(np.argmin(np.linalg.norm(whole.mesh.points - point, axis=1)))
        np.testing.assert_allclose(disk.displacement[:, j], found.displacement[:, i], atol=2e-3)
    up = disk.reactions["rim"][:, 2], found.reactions["rim"][:, 2]
    np.testing.assert_allclose(up[0], 4 * up[1], rtol=1e-3)


CYLINDER_THICKNESS, PRESSURE, RADIUS = 0.81, 0.14, 75.0


def test_bent_cylinder_agrees_with_the_membrane(ccx):
    """As docs/validation/results.md states it: inflated within 0.5 %, loads within 3 %.

    75 mm elements, 2000 mm span, to 20 mm: measured -0.5 % in radius and volume, -0.4 and -2.8 % in
    load (60 mm: -0.2, -0.2 and -2.4 %). A collar that touches 0.15 mm early would make that -3.5 %.
    """
    model = inflated_cylinder(150.0, PRESSURE, CYLINDER_THICKNESS, 75.0, deflections=[10.0, 20.0])
    law = HypoelasticLaw(BETA, strain_range=np.full(3, 0.13))
    found = CalculixSolver(ccx=ccx.path).run(model, law)
    expected = MembraneSolver(wall="stiff").run(model, law)  # as solids are
    side = model.mesh.node_sets["side_line"]
    sizes = []
    for history in (expected, found):  # radius, half length (mm), volume (mm^3) as inflated
        at = model.mesh.points[side] + history.displacement[0, side]
        sizes.append([at[0, 0], at[:, 2].max(), history.cavity_volume[0]])
    assert sizes[0] == pytest.approx(sizes[1], rel=5e-3)
    np.testing.assert_allclose(expected.load[1:], found.load[1:], rtol=0.03)
    absolute = found.cavity_pressure + model.gas.ambient
    np.testing.assert_allclose(
        absolute * found.cavity_volume, absolute[0] * found.cavity_volume[0], rtol=3e-4
    )


def relative_load_difference(found, expected):
    assert found.load.shape == expected.load.shape
    return float(np.abs(found.load - expected.load).max() / expected.load[-1])


@pytest.mark.parametrize(
    ("name", "element", "law", "increments", "counts", "most", "apart"),
    [
        ("warp", "S8R", STRIP_LAW, 12, {}, 1e-8, 1e-7),
        ("bias", "S4", STRIP_LAW, 8, {}, 6e-4, 0.2),
        ("bias", "S8R", STRIP_LAW, 8, SOME, 1e-3, 0.3),
        # Strips that pass several pieces of their moduli, two or three of them in an increment.
        ("warp", "S8R", LAWS["tri-linear"], 12, {}, 1e-7, None),
        ("fill", "S4", LAWS["spline"], 12, {}, 1e-7, None),
        ("bias", "S4", LAWS["tri-linear"], 12, {}, 1e-3, None),
        ("bias", "S4", LAWS["spline"], 12, SOME, 1e-3, None),
    ],
)
def test_strips_agree_with_the_membrane(ccx, name, element, law, increments, counts, most, apart):
    strip_model = strip_model_of(name, increments, **counts)
    found = CalculixSolver(element=element).run(strip_model, law)
    expected = MembraneSolver().run(strip_model, law)
    assert relative_load_difference(found, expected) < most
    if apart is None:
        return
    # The corners of the grips are singular: there the elements differ, and the grips with them.
    np.testing.assert_allclose(found.displacement, expected.displacement, atol=apart)
    np.testing.assert_allclose(found.strain_max, expected.strain_max, atol=max(0.2 * apart, 1e-7))
    for end in ("top", "bottom"):
        pull = found.reactions[end][:, 1], expected.reactions[end][:, 1]
        np.testing.assert_allclose(*pull, atol=most * expected.load[-1])
    top, bottom = found.reactions["top"], found.reactions["bottom"]
    np.testing.assert_allclose(top[:, 1], -bottom[:, 1], atol=1e-4 * expected.load[-1])
    assert found.load_slope is None and found.stable is None and found.iterations > 0


@pytest.mark.parametrize("element", ["S4", "S8R"])
@pytest.mark.parametrize("name", ["warp", "fill"])
@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
def test_homogeneous_strip_has_its_closed_form_in_calculix(ccx, name, element, thickness_change):
    strip_model, law = (
        strip_model_of(name, 20),
        replace(STRIP_LAW, thickness_change=thickness_change),
    )
    strain = np.log1p(np.array(strip_model.elongations) / strip_model.gauge_length)
    integral = np.polyint(law.beta[8:] if name == "warp" else law.beta[4:8])
    assert strain[-1] < law.strain_range[0 if name == "warp" else 1]
    stress = np.polyval(integral, strain)
    across = -law.nu12 * (strain if name == "warp" else stress / law.E1(0.0))
    section = np.exp(across if thickness_change == "constant" else -strain)
    found = CalculixSolver(element=element).run(strip_model, law)
    load = WIDTH * THICKNESS * stress * section
    np.testing.assert_allclose(found.load, load, rtol=1e-6)
    sideways = np.expm1(across)[:, None] * strip_model.mesh.points[:, 0]
    np.testing.assert_allclose(found.displacement[:, :, 0], sideways, atol=1e-6)


def plane_stress_templates(folder):
    """Templates of a user who takes plane stress elements: the membrane's own shape functions."""
    deck = (TEMPLATES / "calculix" / "strip.inp.j2").read_text()
    mesh = (TEMPLATES / "calculix" / "mesh.inp.j2").read_text()
    deck = deck.replace("*SHELL SECTION", "*SOLID SECTION").replace("ALL, 3, 3\n", "")
    (folder / "strip.inp.j2").write_text(deck)
    (folder / "mesh.inp.j2").write_text(mesh.replace("TYPE={{ element }}", "TYPE=CPS4"))
    return folder


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
@pytest.mark.parametrize("angle", [45.0, -30.0])
def test_plane_stress_elements_of_calculix_equal_the_membrane(
    ccx, tmp_path, thickness_change, angle
):
    """What differs with shells is the element: with the membrane's own, nothing does."""
    law = replace(STRIP_LAW, thickness_change=thickness_change)
    lengths = (BIAS[0], 23.0)
    turned = bias_strip(*lengths, THICKNESS, angle=angle, increments=8, **COARSE)
    solver = CalculixSolver(element="S4", templates=plane_stress_templates(tmp_path))
    found, expected = solver.run(turned, law), MembraneSolver().run(turned, law)
    assert relative_load_difference(found, expected) < 1e-6
    np.testing.assert_allclose(found.displacement, expected.displacement, atol=1e-5)
    np.testing.assert_allclose(found.strain_min, expected.strain_min, atol=1e-6)
    np.testing.assert_allclose(found.strain_max, expected.strain_max, atol=1e-6)
    for name, force in expected.reactions.items():
        np.testing.assert_allclose(found.reactions[name], force, atol=1e-5 * expected.load[-1])


# Loads N/mm; 2 and 1 N/mm is the prestress of such a test.
LOADS_UP = np.linspace(0.0, 20.0, 9)[1:]


@pytest.mark.parametrize("element", ["S8R", "S4"])
@pytest.mark.parametrize("shares", [(1.0, 0.5), (1.0, 0.02)], ids=["2:1", "1:0"])
@pytest.mark.parametrize("name", ["cubic", "incompressible"])
def test_biaxial_patch_in_calculix_has_the_strains_of_the_law(ccx, element, shares, name):
    loads = np.outer(np.concatenate([LOADS_UP, LOADS_UP[-2::-2]]), shares)
    history = CalculixSolver(ccx.path, element=element).run(PatchModel(loads, 0.8), LAWS[name])
    wanted = biaxial_response(LAWS[name], loads, 0.8).elongation
    found = elongations(history.displacement)
    np.testing.assert_allclose(found, wanted, atol=5e-6 * np.abs(wanted).max())
    np.testing.assert_allclose(history.load, loads.sum(axis=1))
    np.testing.assert_allclose(history.strain_max[:2], np.log1p(wanted).max(axis=0), rtol=1e-4)
    assert history.iterations > 0


def test_soft_disk_rises_to_1_2_radii():
    """Strains of 68 % (twice the length) of a rubber that stiffens, of incompressible thickness."""
    nu12, knots, end = 0.3, 13, 1.2
    ends = [end, end, end * (1 + nu12)]
    form = symmetric(form_named("spline", {"knots": knots}, ends), "isotropic", nu12)
    stretch = np.exp(np.linspace(0.0, end, knots))
    # d stress / d log strain of Mooney and Rivlin's (l^2 - l^-4) (1 + 0.3 l^2) MPa.
    slope = 2 * stretch**2 + 4 * stretch**-4 + 0.3 * (4 * stretch**4 + 2 * stretch**-2)
    law = HypoelasticLaw((1 - nu12) * slope, nu12, ends, "incompressible", form)
    pressures = np.array([0.0026, 0.0052, 0.0077])
    mesh = disk_mesh(50.0, 48, "quarter")
    model = BubbleModel(mesh, 0.1, pressures, default_increments(pressures))
    apex = mesh.node_sets["apex"][0]
    by_membrane = MembraneSolver().run(model, law).displacement[:, apex, 2]
    by_calculix = CalculixSolver(element="S4").run(model, law).displacement[:, apex, 2]
    assert by_calculix[-1] > 1.2 * 50.0
    np.testing.assert_allclose(by_calculix, by_membrane, rtol=0.02)
