"""The Marc deck as its stand-in reads it: mesh, sets, law, loads; blocks that a site replaces."""

import re
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports.subroutines import hypela2_source
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import RigidSupports, inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.meshes.tube_rows import RefinedZone
from bubblefit.meshes.volume import enclosed_volume
from bubblefit.solvers.exports import FORMATS
from bubblefit.solvers.marc.analyses import (
    ABOVE,
    WAITING_DEPTH,
    analyse_bubble,
    bubble_deck,
    contact_bodies,
    cylinder_deck,
    strip_deck,
    touching,
)
from bubblefit.solvers.marc.deck import fabric_context, fabric_frames, named_set, set_lines
from bubblefit.solvers.marc.settings import BLOCKS, MarcSettings
from bubblefit.solvers.marc.solver import MarcSolver
from hypothesis import given
from hypothesis import strategies as st

from ...builders.fortran import LAWS
from ...marc_stand_in.deck import Deck, DeckError, read_deck, set_members
from ...marc_stand_in.files import bending_marc
from ...marc_stand_in.laws import compiled, law_of_subroutine, law_of_tables
from ...marc_stand_in.models import collar_of, first_touch, support_of
from ...support import needs
from ...support.refusals import complaint, raised

LAW = HypoelasticLaw(
    1e3 * np.array([0, 3.0, -0.6, 0.06, -0.8, 1.07, 0.07, 0.4, -589.0, 217.0, -20.4, 0.8]),
    strain_range=[0.13, 0.2, 0.25],
)


def bubble(elements=48, increments=(0.01, 0.03, 0.1)):
    return BubbleModel(disk_mesh(100.0, elements, "quarter"), 0.81, increments)


@pytest.fixture(scope="session")
def read(tmp_path_factory):
    path = tmp_path_factory.mktemp("decks") / "job.dat"

    def content(text, reader=read_deck):
        path.write_text(text)
        return reader(path)

    return content


def conditions(content):
    return {name: (c.dofs, c.values, c.tables, c.on) for name, c in content.conditions.items()}


@pytest.mark.parametrize("element", [139, 75, 18])
def test_the_mesh_and_its_supports_are_whole(read, element):
    model = bubble()
    content = read(bubble_deck(model, LAW, MarcSettings(element=element)))
    assert content.type == element
    np.testing.assert_array_equal(content.connectivity, model.mesh.quads + 1)
    np.testing.assert_allclose(content.coordinates, model.mesh.points, rtol=1e-12)
    for name in ("rim", "symmetry_x", "symmetry_y"):
        expected = np.sort(model.mesh.node_sets[name]) + 1
        np.testing.assert_array_equal(content.sets["node"][name], expected)
    expected = range(1, len(model.mesh.quads) + 1)
    np.testing.assert_array_equal(content.sets["element"]["fabric"], expected)
    found = conditions(content)
    assert found["fix_rim"] == ([1, 2, 3], [0, 0, 0], [0, 0, 0], "rim")
    # Shells do not turn about the axes in their plane of symmetry.
    assert found["fix_symmetry_x"][0] == ([1] if element == 18 else [1, 5, 6])
    assert len(found) == 4


@given(st.sets(st.integers(1, 200), min_size=1).map(sorted))
def test_any_set_comes_back(read, numbers):
    lines = set_lines(np.array(numbers) - 1)
    assert all(line.endswith(" c") for line in lines[:-1]) and not lines[-1].endswith("c")
    assert set_members(read("\n".join(lines), Deck)) == numbers


@pytest.mark.parametrize("name", ["", "Rim", "a b", "a,b", "x" * 29, "rim$"])
def test_names_and_sets_that_marc_could_not_read_are_refused(name):
    assert "at most 28" in complaint(named_set, "node", name, np.array([1]))
    assert "holds nothing" in complaint(named_set, "node", "rim", np.array([], dtype=int))


def test_tables_are_the_load_and_the_law(read):
    model = bubble()
    content = read(bubble_deck(model, LAW, MarcSettings()))
    load = content.tables[1]
    np.testing.assert_array_equal(load.x, range(len(model.increments) + 1))
    np.testing.assert_allclose(load.y, [0, *model.increments])
    assert content.law == "nlelast" and content.law_on == "fabric"
    assert content.multipliers == [1, 1, 0.24, 1] and content.moduli == [11, 12, 0, 13]
    for modulus, number in (("E1", 11), ("E2", 12), ("G12", 13)):
        _, strain, value = content.tables[number]
        assert len(strain) > 100
        np.testing.assert_allclose(value, LAW.modulus(modulus, strain), rtol=1e-11)
        # Level at both ends: the same whether Marc holds the end or goes on along the last slope.
        assert value[0] == value[1] and value[-1] == value[-2]
        between = 0.5 * (strain[1:] + strain[:-1])
        wanted = LAW.modulus(modulus, between)
        np.testing.assert_allclose(np.interp(between, strain, value), wanted, rtol=2e-4)
    law = HypoelasticLaw.linear(800, 400, 60, thickness_change="incompressible")
    assert "hypela2" in complaint(bubble_deck, model, law, MarcSettings())
    assert read(bubble_deck(model, law, MarcSettings(law="hypela2"))).law == "hypoelastic"


def test_a_bubble_is_pressed_on_from_below(read):
    assert read(bubble_deck(bubble(), LAW, MarcSettings())).conditions["pressure"].values == [-1]
    deck = bubble_deck(bubble(), LAW, MarcSettings(pressure_type=7, pressure_sign=1))
    load = read(deck).conditions["pressure"]
    assert (load.values, load.tables, load.load, load.on) == ([1.0], [1], 7, "fabric")


# Of three increments of the model.
@pytest.mark.parametrize(("wanted", "cuts"), [(100, 34), (0, 1), (3, 1), (4, 2)])
def test_increments_of_the_model_are_cut_into_equal_ones(read, wanted, cuts):
    deck = bubble_deck(bubble(), LAW, MarcSettings(increments=wanted))
    content = read(deck)
    (case,) = content.cases
    assert case.increments == 3 * cuts and content.every == cuts
    assert case.step == pytest.approx(1 / cuts, rel=1e-11)
    # The thesis' control; its limit of increments is of the whole job: never the limit.
    assert case.control == (1e-3, 1e-3, 30) and "\n     99999        30" in deck


def test_a_strip_is_pulled_down_in_its_plane(read):
    model = straight_strip("warp", 50, 60, 0.81)
    pulls = np.array(model.elongations)
    content = read(strip_deck(model, LAW, MarcSettings(), pulls))
    found = conditions(content)
    assert found["pull"] == ([2], [-1.0], [1], "bottom")
    assert found["flat"] == ([3, 4, 5, 6], [0] * 4, [0] * 4, "all_nodes")
    assert found["fix_top"][0] == [2] and found["fix_symmetry_x"][0] == [1]
    np.testing.assert_allclose(content.tables[1].y[1:], pulls)
    assert "pull" in content.cases[0].conditions and "pull" not in content.initial
    membrane = read(strip_deck(model, LAW, MarcSettings(element=18), pulls))
    assert conditions(membrane)["flat"][0] == [3]


@pytest.mark.parametrize("angle", [0, 30, 45, 90])
def test_warp_and_fill_of_a_bias_strip(read, angle):
    model = bias_strip(10, 14, 0.81, angle=angle)
    content = read(strip_deck(model, LAW, MarcSettings(), np.array(model.elongations)))
    ((name, warp, fill),) = content.frames
    assert name == "fabric"
    np.testing.assert_allclose(warp, model.warp, atol=1e-9)
    np.testing.assert_allclose(fill, np.cross([0, 0, 1], model.warp), atol=1e-9)


def test_every_facet_of_a_cylinder_has_its_frame_and_thickness(read):
    zones = (RefinedZone("collar", 0, 60, 40), RefinedZone("support", 800, 60, 40))
    mesh = cylinder_mesh(2000, 200, 80, 40, "quarter", zones)
    thickness = np.where(np.isin(np.arange(len(mesh.quads)), mesh.element_sets["seam"]), 2.43, 0.81)
    context = fabric_context(mesh, mesh.warp, thickness)
    along, across = fabric_frames(mesh, mesh.warp)
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1)
    np.testing.assert_allclose(np.einsum("mk,mk->m", along, across), 0, atol=1e-12)
    # Outward normals, warp along the axis on the tube: the fill goes around.
    sets = {s["name"]: np.array(set_members(read("\n".join(s["lines"]), Deck))) - 1
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
    assert "normal to a facet" in complaint(fabric_frames, bubble().mesh, np.array([0.0, 0.0, 1.0]))


def test_what_is_not_confirmed_says_so_and_can_be_replaced(tmp_path):
    deck = bubble_deck(bubble(), LAW, MarcSettings())
    marked = re.findall(r"^\$ unconfirmed: (\w+)", deck, re.MULTILINE)
    assert set(marked) == {"nlelast", "orientation", "pressure", "control"}
    assert set(marked) <= set(BLOCKS)
    for name in marked:
        mine = tmp_path / f"{name}.txt"
        mine.write_text(f"$ mine: {name}\nmine")
        other = bubble_deck(bubble(), LAW, MarcSettings(include={name: str(mine)}))
        assert f"$ unconfirmed: {name}" not in other
        assert f"$ mine: {name}\nmine\n" in other
        rest = [line for line in other.splitlines() if line not in (f"$ mine: {name}", "mine")]
        assert set(rest) <= set(deck.splitlines())


def test_a_site_block_is_a_template_with_the_context_of_ours(read, tmp_path):
    mine = tmp_path / "nlelast.inc"
    mine.write_text(
        "nlelast of {{ moduli | length }}, {{ nu12 }}\n"
        "{% for point in moduli[0].points %}{{ point | e20 }}\n{% endfor %}"
    )
    deck = bubble_deck(bubble(), LAW, MarcSettings(include={"nlelast": str(mine)}))
    assert "nlelast of 3, 0.24\n" in deck
    points = read(bubble_deck(bubble(), LAW, MarcSettings())).tables[11]
    data = deck[deck.index("nlelast of 3") :].splitlines()[1 : len(points.x) + 1]
    found = [[float(line[:20]), float(line[20:])] for line in data]
    np.testing.assert_array_equal(found, np.transpose(points[1:]))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("{{ nothing }}", "line 2.*'nothing' is undefined"),
        ("{% if %}", "line 2"),
        ("{{ (10 ** 12) | i10 }}", "line 2.*more than 10 digits"),
        ("{{ ''.__class__.__mro__[1].__subclasses__() }}", "unsafe"),
    ],
)
def test_mistakes_in_a_site_block_name_its_file_and_line(tmp_path, text, match):
    mine = tmp_path / "post.inc"
    mine.write_text(f"post\n{text}\n")
    with pytest.raises(InputError, match=match) as found:
        deck = bubble_deck(bubble(), LAW, MarcSettings(include={"post": str(mine)}))
        assert not deck
    assert str(mine) in str(found.value)


def test_whole_decks_of_the_site(tmp_path):
    (tmp_path / "bubble.dat.j2").write_text('mine, {{ element }}\n{% include "post.dat.j2" %}\n')
    deck = bubble_deck(bubble(), LAW, MarcSettings(templates=str(tmp_path)))
    assert deck.startswith("mine, 139\npost\n")
    model = straight_strip("warp", 50, 60, 0.81)
    with pytest.raises(InputError, match=r"holds no uniaxial\.dat\.j2"):
        strip_deck(model, LAW, MarcSettings(templates=str(tmp_path)), np.array([1.0]))


@pytest.mark.parametrize("key", ["slack", "rim_motion", "strains"])
def test_a_slack_sheet_and_a_rim_that_moves_are_refused(key):
    mesh = disk_mesh(100.0, 16)
    rim = len(mesh.node_sets["rim"])
    what = {"slack": (0.001, 0.0), "rim_motion": np.zeros((1, rim, 3)), "strains": {"a": None}}[key]
    model = BubbleModel(mesh, 0.81, (0.1,), **{key: what})
    with pytest.raises(SolverFailure, match="no slack sheet, no metric and no rim that moves"):
        analyse_bubble(model, HypoelasticLaw.linear(500.0, 250.0, 12.0), MarcSettings(), None)


LINEAR = HypoelasticLaw.linear(800.0, 400.0, 60.0)
ROUNDING = 5.1e-6


@pytest.fixture(scope="module")
def model():
    return inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 60.0, 100.0])


@pytest.fixture(scope="module")
def grown(model):
    return model.mesh.points * [0.05, 0.05, 0.0]


def test_inflation_needs_no_contact_and_no_cavity(read, model):
    content = read(cylinder_deck(model, LINEAR, MarcSettings()))
    assert not content.gas and not content.bodies
    names = {"fix_symmetry_x", "fix_symmetry_z", "hold", "pressure"}
    assert set(content.cases[-1].conditions) == names
    found = conditions(content)
    assert found["hold"] == ([2], [0.0], [0], "support_bottom")
    # Shells do not turn about the axes in their plane of symmetry.
    assert found["fix_symmetry_z"][0] == [3, 4, 5]
    np.testing.assert_allclose(content.tables[1].y, [0, *model.inflation])
    assert content.cases[0].increments == 100
    # Seam and caps have their own thickness.
    assert sorted(t for t, _ in content.thickness) == pytest.approx([0.81, 2.43])


def test_bending_is_a_cavity_that_is_filled_and_closed(read, model, grown):
    content = read(cylinder_deck(model, LINEAR, MarcSettings(increments=0), grown))
    guides = {"fix_symmetry_x", "fix_symmetry_z"}
    assert set(content.initial) == guides | {"hold"}
    cases = [set(case.conditions) for case in content.cases]
    assert cases == [guides | {"hold", "fill"}, guides | {"hold", "closed"}, guides | {"closed"}]
    assert [case.increments for case in content.cases] == [len(model.inflation), 1, 3]
    assert content.gas == pytest.approx([0.101, 300.0, 1.2041e-12])
    fill, closed = (content.conditions[name] for name in ("fill", "closed"))
    assert (fill.tables, fill.load, closed.tables, closed.load) == ([1], 1, [0], 2)
    assert not [c for c in content.conditions.values() if c.kind == "pressure"]
    # Paths of the bodies.
    filled, last = len(model.inflation), len(model.inflation) + 1 + 3
    load, support, collar = (content.tables[number] for number in (1, 2, 3))
    for table in (support, collar, load):
        np.testing.assert_array_equal(table.x, range(last + 1))
    assert (support.y[: filled + 1] == -WAITING_DEPTH).all() and (
        support.y[filled + 1 :] == 0
    ).all()
    assert (collar.y[: filled + 2] == 0).all() and (load.y[filled:] == model.pressure).all()
    np.testing.assert_allclose(collar.y[filled + 2 :], [-(ABOVE + d) for d in (20, 60, 100)])
    # Patches face the fabric: the support looks up, the inside of the collar down.
    assert (content.bodies[0].name, content.bodies[0].on) == ("cylinder", "fabric")
    for body, name, number, sign in zip(
        content.bodies[1:], ("support", "collar"), (2, 3), (1, -1), strict=True
    ):
        assert (body.name, body.table, body.direction.tolist()) == (name, number, [0, 1, 0])
        p = body.patches
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 3] - p[:, 0])
        level = np.abs(normal[:, 1]) > 0.9 * np.linalg.norm(normal, axis=1)
        assert level.any() and (sign * normal[level, 1] > 0).all()


def test_bodies_are_where_they_touch(model, grown):
    whole = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0], symmetry="full")
    with pytest.raises(InputError, match="quarter"):
        cylinder_deck(whole, LINEAR, MarcSettings(), np.zeros_like(whole.mesh.points))
    touch = touching(model)
    assert len(touch["collar"]) and len(touch["supports"])
    assert not np.intersect1d(touch["collar"], touch["supports"]).size
    assert (model.mesh.points[touch["collar"], 2] < 133).all()
    support, collar = contact_bodies(model, grown)
    # Corners of a polygon of the circle's area are a little outside of the circle.
    crown = 1.05 * np.hypot(*model.mesh.points[:, :2].T).max()
    assert 105.0 < crown < 106.6
    points = np.reshape(support["patches"], (-1, 3))
    assert points[:, 1].max() == pytest.approx(-crown + 0.02, abs=1e-9)
    points = np.reshape(collar["patches"], (-1, 3))
    # Its mouth is rounded; corners of flat faces lie outside the ring, here by 0.034 mm.
    top = points[points[:, 2] < 60, 1].max()
    assert crown + ABOVE < top < crown + ABOVE + 0.05


def test_rim_of_the_tube_may_touch_a_support_beside_it():
    """Its nodes belong to tube and caps; what they carry counts among the support's forces."""
    supports = RigidSupports(span=1356.0, diameter=140.0)
    tube = inflated_cylinder(150.0, 0.1, 0.81, 75.0, length=1500.0, supports=supports)
    sets = tube.mesh.node_sets
    rim = np.intersect1d(sets["caps"], sets["ends"])
    low = rim[tube.mesh.points[rim, 1] < -40.0]
    assert len(low) and np.isin(low, touching(tube)["supports"]).all()
    inner = np.setdiff1d(sets["caps"], rim)
    assert not np.isin(inner, touching(tube)["supports"]).any()


def frames_of(model, grown, name="Contact Normal Force", last=3):
    """Inflated, then squeezed by the collar: forces and times as Marc would report them."""
    filled, points = len(model.inflation), model.mesh.points
    zero = np.zeros_like(points)
    frames = [(0.0, {"Displacement": zero, name: zero})]
    for i in range(filled):
        frames.append((i + 1.0, {"Displacement": grown * (i + 1) / filled, name: zero}))
    frames.append((filled + 1.0, {"Displacement": grown, name: zero}))
    touch, loads = touching(model), []
    for i in range(last):
        forces = zero.copy()
        forces[touch["collar"][:3], 1] = -(i + 1.0)
        forces[touch["supports"][:2], 1] = 1.5 * (i + 1.0)
        forces[touch["collar"][0], 0] = 7.0
        u = grown - 0.01 * (i + 1) * points * [1, 1, 0]
        frames.append((filled + 2.0 + i, {"Displacement": u, name: forces}))
        loads.append(4 * 3 * (i + 1.0))
    return frames, loads


@pytest.fixture
def marc(tmp_path, monkeypatch, model):
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)
    scratch = str(tmp_path / "scratch")
    return lambda frames, number=3004: MarcSolver(
        marc=bending_marc(tmp_path, model, frames, number), scratch=scratch
    )


@pytest.mark.parametrize("name", ["Contact Normal Force", "Reaction Force"])
def test_forces_volume_and_pressure(marc, model, grown, name):
    frames, loads = frames_of(model, grown, name)
    history = marc(frames).run(model, LINEAR)
    np.testing.assert_allclose(history.load, [0, *loads], rtol=ROUNDING)
    np.testing.assert_allclose(history.reactions["supports"][:, 1], [0, *loads], rtol=ROUNDING)
    assert (history.reactions["collar"][:, [0, 2]] == 0).all()
    kept = [fields["Displacement"] for time, fields in frames if time in (10.0, 12.0, 13.0, 14.0)]
    np.testing.assert_allclose(history.displacement, kept, rtol=2 * ROUNDING, atol=1e-9)
    volume = [4 * enclosed_volume(model.mesh.points + u, model.mesh.quads) for u in kept]
    np.testing.assert_allclose(history.cavity_volume, volume, rtol=1e-5)
    absolute = history.cavity_pressure + 0.101
    np.testing.assert_allclose(absolute * history.cavity_volume, 0.201 * volume[0], rtol=1e-5)
    assert history.cavity_pressure[0] == pytest.approx(0.1)
    assert not any("balance" in words for words in history.remarks)


@pytest.mark.parametrize("what", ["collapse", "missing", "forces"])
def test_results_that_are_not_whole_are_failures(marc, model, grown, what):
    name = "Something Else" if what == "forces" else "Contact Normal Force"
    frames, _ = frames_of(model, grown, name, last=0 if what == "collapse" else 3)
    if what == "missing":
        del frames[-2]
    number = 3015 if what == "collapse" else 3004
    said = {"collapse": "time step could not get smaller", "missing": "holds 3 of 4 frames",
            "forces": "Reaction Force"}  # fmt: skip
    found = raised(SolverFailure, said[what], marc(frames, number).run, model, LINEAR)
    assert found.exit_number == number


# The stand-in refuses decks that Marc would refuse, and takes every deck of ours

SETTINGS = MarcSettings(increments=0)
CYLINDER = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 40.0])


def bubble_text(settings=SETTINGS, law=LINEAR):
    return bubble_deck(
        BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03)), law, settings
    )


def strip(settings=SETTINGS, law=LINEAR):
    model = straight_strip("fill", 50, 60, 0.81, increments=5)
    return strip_deck(model, law, settings, np.array(model.elongations))


def bending(settings=SETTINGS, law=LINEAR):
    grown = CYLINDER.mesh.points * [0.05, 0.05, 0.0]
    return cylinder_deck(CYLINDER, law, settings, grown)


DECKS = {"bubble": bubble_text(), "strip": strip(), "bending": bending()}


@pytest.mark.parametrize("element", [139, 75, 18])
@pytest.mark.parametrize("law", ["nlelast", "hypela2"])
@pytest.mark.parametrize("deck", [bubble_text, strip, bending])
def test_every_deck_of_ours_is_taken(read, deck, law, element):
    content = read(deck(MarcSettings(element=element, law=law)))
    assert content.type == element
    assert sum(case.increments for case in content.cases) >= 100


@pytest.mark.parametrize(("diameter", "size"), [(150.0, 60.0), (200.0, 80.0), (250.0, 50.0)])
def test_the_collar_touches_after_half_a_millimetre(read, diameter, size):
    model = inflated_cylinder(diameter, 0.08, 0.81, size, deflections=[20.0])
    grown = model.mesh.points * [0.04, 0.05, 0.0]
    content = read(cylinder_deck(model, LINEAR, SETTINGS, grown))
    support, collar = content.bodies[1:]
    assert first_touch(collar, content.coordinates + grown) == pytest.approx(0.5, abs=1e-9)
    assert content.tables[collar.table].y[-1] == pytest.approx(-20.5)
    assert collar_of(collar).radius == pytest.approx(0.5 * model.collar.inner_diameter)
    assert support_of(support).radius == pytest.approx(0.5 * model.supports.diameter)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_the_law_is_found_in_tables_and_in_the_subroutine(read, tmp_path, name):
    needs.fortran()
    law = LAWS[name]
    content = read(bubble_text(MarcSettings(law="hypela2"), law))
    source = tmp_path / "hypela2.f"
    source.write_text(hypela2_source({1: law}))
    found = [law_of_subroutine(compiled(source, tmp_path), content.states)]
    if law.thickness_change == "constant":
        # Tables that the adapter writes, and those of the exported card in their place.
        exported = tmp_path / "card.dat"
        card = MaterialCard(law, 0.8, "Valmex 7318")
        exported.write_text(FORMATS["marc"].export(card).files[".dat"])
        for given in (SETTINGS, MarcSettings(include={"nlelast": str(exported)})):
            found.append(law_of_tables(read(bubble_text(given, law))))
    ends = np.minimum(law.strain_range, 0.3)
    for other in found:
        assert other.thickness_change == law.thickness_change
        assert other.nu12 == pytest.approx(law.nu12, rel=1e-10)
        for i, modulus in enumerate(("E1", "E2", "G12")):
            # Away from the breaks of a tri-linear law, where a table jumps over 1e-6.
            strain = np.linspace(-0.05, 1.5 * ends[i], 173)
            if law.strain_range[i] > 0.3:
                strain = strain[strain < 0.3]
            wanted = law.modulus(modulus, strain)
            np.testing.assert_allclose(other.modulus(modulus, strain), wanted, rtol=1e-8)


def first(pattern, text, new):
    changed, count = re.subn(pattern, new, text, count=1, flags=re.MULTILINE)
    assert count == 1 and changed != text, pattern
    return changed


SPOILED = {
    "an integer moved": (
        "bubble", r"^         1       139", "        1        139", "columns 1 to"),
    "a real without a point": (
        "bubble", r"^  8\.100000000000E-01", "       8100000000000", "expected r"),
    "not ASCII": ("bubble", r"^title .*$", "title               Größe", "not ASCII"),
    "an element less": ("bubble", r"^         8       139 .*\n", "", "ends after 7 of 8"),
    "a condition less": ("bubble", r"^(loadcase            inflation\n         )4", r"\g<1>3",
                         "unknown history option"),
    "a node outside": ("bubble", r"^(         2       139.{10}.{10}.{10}).{10}$", r"\1        99",
                       "does not exist"),
    "a node twice": ("bubble", r"^(         1       139         1)(.{10})(.{10})",
                     r"\1\2\2", "a member twice"),
    "another type": ("bubble", r"^         2       139", "         2        75", "of type 75"),
    "a set twice": ("bubble", r"^(define .*symmetry_)y", r"\1x", "is defined twice"),
    "supports on an unknown set": ("bubble", r"^(         2\n)rim\n", "\\1rom\n",
                                   "no node set 'rom'"),
    "an element without thickness": ("bending", r"^(geometry\n(?:.*\n)+?)layer_2\n", "\\1layer_1\n",
                                     "its thickness"),
    "an element inside out": (
        "bubble", r"^(         4       139)(.{10})(.{10})(.{10})(.{10})", r"\1\2\4\3\5",
        "element 4 is inside out"),
    "a table that goes back": ("bubble", r"^(         1         3 .*\n.*\n  )1\.0", r"\g<1>-1.0",
                               "does not increase|expected r"),
    "an unknown table": ("bubble", r"^(        11        12         0        )13", r"\g<1>14",
                         "no table 14"),
    "a left-handed frame": ("bubble", r"(3d aniso.{82}) (.{19}) ( 1)", r"\1 \2 -1",
                            "not a quarter turn"),
    "pulled and held": ("strip", r"^(         1\n         )2(\n         2\nbottom)", r"\g<1>3\2",
                        "has two values"),
    "a pressure that does not follow": ("bubble", r"^follow for.*\n", "", "follow for"),
    "no continue": ("bending", r"^continue\n", "", "is a continue missing"),
    "no control": ("bubble", r"^control\n(.*\n){3}", "", "without .*control"),
    "a cavity in the model only": ("bending", r"^cavity  .*\n", "", "cavity has to be in"),
}  # fmt: skip


@pytest.mark.parametrize("what", SPOILED)
def test_a_spoiled_deck_is_refused(read, what):
    deck, pattern, new, match = SPOILED[what]
    found = raised(DeckError, match, read, first(pattern, DECKS[deck], new))
    assert found.number == (1005 if "inside out" in what else 13)


def test_moduli_that_are_not_positive_or_on_no_curve_have_no_law(read):
    spoiled = {
        "is not above 0": first(r"  8\.000000000000E\+02", DECKS["bubble"], " -8.000000000000E+02"),
        "wrong below zero": first(
            r"  8\.000000000000E\+02", DECKS["bubble"], "  7.000000000000E+02"
        ),
        "on no cubics": first(r"(  5.0{11}\dE-03 )( 8)\.0", DECKS["bubble"], r"\1\2.1"),
    }
    for match, text in spoiled.items():
        raised(DeckError, match, law_of_tables, read(text))


def test_the_parser_shares_no_code_with_what_writes_decks():
    folder = Path(__file__).parents[2] / "marc_stand_in"
    for path in folder.glob("*.py"):
        imports = re.findall(r"^\s*(?:from|import) (\S+)", path.read_text(), re.MULTILINE)
        assert not [name for name in imports if "solvers.marc" in name or "exports" in name]
        if path.stem == "deck":
            assert not [name for name in imports if name.startswith("bubblefit")], path
