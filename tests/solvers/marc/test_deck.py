"""solvers/marc/deck.py: sets, names and frames in a deck."""

import numpy as np
import pytest
from bubblefit.meshes.mesh import fabric_frames
from bubblefit.meshes.tube import RefinedZone, cylinder_mesh
from bubblefit.solvers.marc.deck import fabric_context, named_set, set_lines
from hypothesis import given
from hypothesis import strategies as st

from ...marc_stand_in.deck import Deck, set_members
from ...support.refusals import complaint


@given(st.sets(st.integers(1, 200), min_size=1).map(sorted))
def test_sets_of_any_numbers_come_back(read_by_stand_in, numbers):
    lines = set_lines(np.array(numbers) - 1)
    assert all(line.endswith(" c") for line in lines[:-1]) and not lines[-1].endswith("c")
    assert set_members(read_by_stand_in("\n".join(lines), Deck)) == numbers


@pytest.mark.parametrize("name", ["", "Rim", "a b", "a,b", "x" * 29, "rim$"])
def test_names_and_sets_that_marc_cannot_read_are_refused(name):
    assert "at most 28" in complaint(named_set, "node", name, np.array([1]))
    assert "holds nothing" in complaint(named_set, "node", "rim", np.array([], dtype=int))


def test_facets_of_a_cylinder_have_frame_and_thickness(read_by_stand_in):
    zones = (RefinedZone("collar", 0, 60, 40), RefinedZone("support", 800, 60, 40))
    mesh = cylinder_mesh(2000, 200, 80, 40, "quarter", zones)
    thickness = np.where(np.isin(np.arange(len(mesh.quads)), mesh.element_sets["seam"]), 2.43, 0.81)
    context = fabric_context(mesh, mesh.warp, thickness)
    along, across = fabric_frames(mesh, mesh.warp)
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1)
    np.testing.assert_allclose(np.einsum("mk,mk->m", along, across), 0, atol=1e-12)
    # Outward normals, warp along the axis on the tube: the fill goes around.
    sets = {s["name"]: np.array(set_members(read_by_stand_in("\n".join(s["lines"]), Deck))) - 1
            for s in context["sets"]}  # fmt: skip
    seen = np.zeros(len(mesh.quads), int)
    for frame in context["frames"]:
        which = sets[frame["set"]]
        seen[which] += 1
        np.testing.assert_allclose(along[which] - frame["warp"], 0, atol=1e-8)
        np.testing.assert_allclose(across[which] - frame["fill"], 0, atol=1e-8)
    assert (seen == 1).all() and len(context["frames"]) < 40
    assert {layer["thickness"] for layer in context["layers"]} == {0.81, 2.43}
    for layer in context["layers"]:
        np.testing.assert_allclose(thickness[sets[layer["set"]]], layer["thickness"])
    assert set(sets) >= {"fabric", "layer_1", "layer_2"}
