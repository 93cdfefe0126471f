"""Field: directions of the yarns in decks: zero, no number, normal to a shell, along an end cap.

Sources: forum questions of CalculiX and OpenRadioss on *ORIENTATION and /PROP/TYPE16, whose vectors
the programs take although they are zero or stand on the shell: the material then lies anyhow.
"""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import RigidSupports, inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.calculix.cylinder import cylinder_decks, solid_mesh
from bubblefit.solvers.calculix.deck import shell_mesh
from bubblefit.solvers.calculix.sheets import bubble_decks, strip_decks
from bubblefit.solvers.marc.deck import fabric_context

from ..support.refusals import complaint

LAW = HypoelasticLaw.linear(800.0, 140.0, 20.0, 0.24)
STRIP = straight_strip("warp", 20.0, 22.0, 0.8, increments=2, across=1, along=2)


def strip_deck(warp):
    shells = shell_mesh(STRIP.mesh, "S4")
    return strip_decks(replace(STRIP, warp=warp), LAW, shells, "S4", np.ones(2))


def bubble_deck(warp):
    mesh = disk_mesh(48, 100.0)
    mesh = replace(mesh, warp=np.tile(warp, (len(mesh.quads), 1)))
    return bubble_decks(BubbleModel(mesh, 0.8, [0.01]), LAW, shell_mesh(mesh, "S4"), "S4")


def marc_deck(warp):
    return fabric_context(STRIP.mesh, np.asarray(warp), 0.8)


@pytest.mark.parametrize("write", [strip_deck, bubble_deck, marc_deck])
@pytest.mark.parametrize(
    ("warp", "words"),
    [
        ([0.0, 0.0, 0.0], "the direction of the warp in element 1 is [0.0, 0.0, 0.0]"),
        ([np.nan, 1.0, 0.0], "element 1 is [nan, 1.0, 0.0]"),
        ([0.0, 0.0, 5.0], "normal to a facet"),
    ],
)
def test_direction_that_is_none_is_refused_when_a_deck_is_written(write, warp, words):
    assert words in complaint(write, warp)


def test_warp_along_the_cylinder_on_its_end_caps_is_named():
    supports = RigidSupports(600.0)
    model = inflated_cylinder(150.0, 0.01, 0.8, 40.0, 900.0, supports=supports)
    warp = np.tile([0.0, 0.0, 1.0], (len(model.mesh.quads), 1))
    wrong = replace(model, mesh=replace(model.mesh, warp=warp))
    for problem in (
        complaint(cylinder_decks, wrong, LAW, solid_mesh(model)),
        complaint(fabric_context, wrong.mesh, warp, 0.8),
    ):
        assert "end caps" in problem and "cap_warp" in problem
    assert cylinder_decks(model, LAW, solid_mesh(model))


def test_directions_of_any_length_are_taken():
    short = np.array([1e-9, 1e-9, 0.0])
    assert strip_deck(short) == strip_deck([1.0, 1.0, 0.0])
    assert marc_deck(short)["frames"] == marc_deck([1.0, 1.0, 0.0])["frames"]
