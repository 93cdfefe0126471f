"""solvers/calculix/deck.py: decks of bubbles and strips, their meshes, sets and loads."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.solvers.calculix import sheets
from bubblefit.solvers.calculix.deck import pressure_forces, rim_paths, shell_mesh
from bubblefit.solvers.calculix.sheets import bubble_decks

from ...builders.fortran import BETA
from ...support.refusals import raised
from .cases import STRIP_LAW, strip_model_of

CUBIC = HypoelasticLaw(BETA, strain_range=np.full(3, 0.13))
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)


def bubble_model_of(elements, symmetry="quarter", pressures=PRESSURES):
    mesh = disk_mesh(100.0, elements, symmetry)
    return BubbleModel(mesh, 0.81, pressures, default_increments(pressures))


def test_moving_rim_on_symmetry_lines_is_refused():
    model = replace(bubble_model_of(64), slack=(0.001, 0.001))
    raised(SolverFailure, "on the full disk only", rim_paths, shell_mesh(model.mesh, "S8R"), model)


def test_midsides_lie_on_the_rim_and_in_the_sets():
    mesh = disk_mesh(100.0, 64, "quarter")
    shells = shell_mesh(mesh, "S8R")
    assert shells.elements.shape == (len(mesh.quads), 8)
    np.testing.assert_array_equal(shells.elements[:, :4], mesh.quads)
    rim = shells.points[shells.node_sets["rim"]]
    np.testing.assert_allclose(np.hypot(rim[:, 0], rim[:, 1]), 100.0)
    assert len(rim) == 2 * len(mesh.node_sets["rim"]) - 1
    assert (shells.points[shells.node_sets["symmetry_x"], 0] == 0).all()
    assert len(shells.node_sets["symmetry_x"]) == 2 * len(mesh.node_sets["symmetry_x"]) - 1
    assert len(np.unique(shells.points, axis=0)) == len(shells.points)
    outline = Outline(120.0, 80.0, 30.0)
    shells = shell_mesh(elliptic_disk_mesh(outline, 192), "S8R")
    rim = shells.points[shells.node_sets["rim"], :2]
    assert len(rim) > shells.corners // 8
    np.testing.assert_allclose(outline.share(rim), 1.0)


@pytest.mark.parametrize("element", ["S4", "S8R"])
def test_pressure_on_a_tilted_surface_is_pressure_times_area(element):
    shells = shell_mesh(disk_mesh(100.0, 64, "quarter"), element)
    tilted = shells.points.copy()
    tilted[:, 2] = 0.5 * tilted[:, 0] - 0.25 * tilted[:, 1]
    total = pressure_forces(tilted, shells.elements, 0.1).sum(axis=0)
    flat = pressure_forces(shells.points, shells.elements, 0.1).sum(axis=0)
    np.testing.assert_allclose(total, flat[2] * np.array([-0.5, 0.25, 1.0]), atol=1e-9)
    # Curved edges: within the area of the segments that they leave out.
    assert flat[2] == pytest.approx(0.1 * np.pi * 1e4 / 4, rel=1e-4 if element == "S8R" else 0.02)


def test_deck_of_a_bubble_is_that_written_by_hand():
    model = bubble_model_of(64)
    text = bubble_decks(model, CUBIC, shell_mesh(model.mesh, "S8R"), "S8R")["job.inp"]
    assert "S8R" in text and "*SHELL SECTION, ELSET=MEMBRANE" in text
    assert text.count("*STEP") == len(model.increments)
    assert "MEMBRANE, P, 0.022\n" in text
    lines = text.splitlines()
    assert sum(line.startswith("** ") for line in lines) > 10
    assert max(map(len, lines)) < 132  # CalculiX reads no more
    # It reads 20 characters of a number, no more.
    fields = [f.strip() for line in lines if line[:1] in "-0123456789" for f in line.split(",")]
    assert max(map(len, fields)) <= 20


@pytest.mark.parametrize(("name", "angle"), [("warp", 90.0), ("fill", 0.0), ("bias", 45.0)])
def test_deck_of_a_strip_has_its_nodes_sets_and_steps(name, angle):
    coarse = strip_model_of(name, 5)
    shells = shell_mesh(coarse.mesh, "S8R")
    pulls = np.array([1.0, 2.0, 3.0, 4.0, 5.1])
    lines = sheets.strip_decks(coarse, STRIP_LAW, shells, "S8R", pulls)["job.inp"].splitlines()
    constants = ", ".join(lines[lines.index("*USER MATERIAL, CONSTANTS=9") + 1 :][:2]).split(", ")
    assert float(constants[4]) == pytest.approx(angle, abs=1e-12)
    assert float(constants[6]) == 1
    start = lines.index("*AMPLITUDE, NAME=PULL")
    assert lines[start + 1 : start + 7] == ["0, 0", "1, 1", "2, 2", "3, 3", "4, 4", "5, 5.1"]
    assert "BOTTOM, 2, 2, -1" in lines and lines.count("ALL, 3, 3") == 1
    held = {"TOP, 2, 2", "SYMMETRY_X, 1, 1"}
    if name == "bias":
        held = {"TOP, 1, 1", "TOP, 2, 2", "BOTTOM, 1, 1"}
    assert held <= set(lines)
    assert sum(line.startswith("** ") for line in lines) > 10
    assert max(map(len, lines)) < 132  # CalculiX reads no more
    fields = [f.strip() for line in lines if line[:1] in "-0123456789" for f in line.split(",")]
    assert max(map(len, fields)) <= 20
