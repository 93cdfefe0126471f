"""Validation: our decks and post files as an independent program reads them."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.marc.analyses import bubble_deck, cylinder_deck
from bubblefit.solvers.marc.settings import MarcSettings
from bubblefit.solvers.marc.t19 import T19File

from ..marc_stand_in.files import t19_text
from ..support import needs


@pytest.fixture
def other_reader():
    return needs.library("meshioplusplus")


LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)


@pytest.mark.parametrize("kind", ["bubble", "cylinder"])
def test_decks_are_read_alike_by_another_program(tmp_path, other_reader, kind):
    if kind == "bubble":
        mesh = disk_mesh(100.0, 48, "quarter")
        deck = bubble_deck(BubbleModel(mesh, 0.81, (0.01, 0.03)), LAW, MarcSettings())
        names = ["rim", "symmetry_x", "symmetry_y"]
    else:
        model = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0])
        mesh, names = model.mesh, ["symmetry_x", "symmetry_z", "support_bottom"]
        deck = cylinder_deck(model, LAW, MarcSettings(), np.zeros_like(mesh.points))
    path = tmp_path / "job.dat"
    path.write_text(deck)
    found = other_reader.read(str(path))
    np.testing.assert_allclose(found.points, mesh.points, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found.cells[0].data, mesh.quads)
    sets = {region.name: np.sort(np.ravel(region.entries)) for region in found.regions}
    for name in names:
        np.testing.assert_array_equal(sets[name], mesh.node_sets[name])
    np.testing.assert_array_equal(sets["fabric"], range(len(mesh.quads)))


def test_post_files_are_read_alike_by_another_program(tmp_path, other_reader):
    random = np.random.default_rng(0)
    points, quads = random.normal(size=(40, 3)), np.arange(36).reshape(9, 4)
    moved = random.normal(size=(40, 3))
    path = tmp_path / "job.t19"
    path.write_text(t19_text(points, quads, [(2.5, {"Displacement": moved})]))
    found, ours = other_reader.read(str(path)), T19File(path)
    (frame,) = ours.frames()
    np.testing.assert_array_equal(found.points, ours.mesh.points)
    np.testing.assert_array_equal(found.point_data["Displacement"], frame.fields["Displacement"])
    assert found.field_data["meshio:time"][0] == frame.time == 2.5
