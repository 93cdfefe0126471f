"""solvers/marc/analyses.py: decks of bubbles, strips and cylinders as the stand-in reads them."""

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
from bubblefit.solvers.export_formats import FORMATS
from bubblefit.solvers.marc import analyses
from bubblefit.solvers.marc.analyses import (
    ABOVE,
    DISPLACEMENT,
    WAITING_DEPTH,
    analyse_bubble,
    bubble_deck,
    contact_bodies,
    cylinder_deck,
    frames_by_time,
    strip_deck,
    touching,
)
from bubblefit.solvers.marc.settings import MarcSettings
from bubblefit.solvers.result_files import ResultFrame, ResultMesh

from ...builders.fortran import LAWS
from ...marc_stand_in.laws import compiled, law_of_subroutine, law_of_tables
from ...marc_stand_in.models import collar_of, first_touch, support_of
from ...support import needs
from ...support.refusals import complaint
from .cases import LINEAR_LAW, SETTINGS, TRILINEAR_LAW, bubble_of, text_of_bubble_deck


def conditions(content):
    return {name: (c.dofs, c.values, c.tables, c.on) for name, c in content.conditions.items()}


@pytest.mark.parametrize("element", [139, 75, 18])
def test_deck_has_the_mesh_and_its_supports(read_by_stand_in, element):
    model = bubble_of()
    content = read_by_stand_in(bubble_deck(model, TRILINEAR_LAW, MarcSettings(element=element)))
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


def test_tables_hold_load_and_law(read_by_stand_in):
    model = bubble_of()
    content = read_by_stand_in(bubble_deck(model, TRILINEAR_LAW, MarcSettings()))
    load = content.tables[1]
    np.testing.assert_array_equal(load.x, range(len(model.increments) + 1))
    np.testing.assert_allclose(load.y, [0, *model.increments])
    assert content.law == "nlelast" and content.law_on == "fabric"
    assert content.multipliers == [1, 1, 0.24, 1] and content.moduli == [11, 12, 0, 13]
    for modulus, number in (("E1", 11), ("E2", 12), ("G12", 13)):
        _, strain, value = content.tables[number]
        assert len(strain) > 100
        np.testing.assert_allclose(value, TRILINEAR_LAW.modulus(modulus, strain), rtol=1e-11)
        # Level at both ends: the same whether Marc holds the end or goes on along the last slope.
        assert value[0] == value[1] and value[-1] == value[-2]
        between = 0.5 * (strain[1:] + strain[:-1])
        wanted = TRILINEAR_LAW.modulus(modulus, between)
        np.testing.assert_allclose(np.interp(between, strain, value), wanted, rtol=2e-4)
    law = HypoelasticLaw.linear(800, 400, 60, thickness_change="incompressible")
    assert "hypela2" in complaint(bubble_deck, model, law, MarcSettings())
    assert (
        read_by_stand_in(bubble_deck(model, law, MarcSettings(law="hypela2"))).law == "hypoelastic"
    )


def test_pressure_acts_on_a_bubble_from_below(read_by_stand_in):
    assert read_by_stand_in(bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings())).conditions[
        "pressure"
    ].values == [-1]
    deck = bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings(pressure_type=7, pressure_sign=1))
    load = read_by_stand_in(deck).conditions["pressure"]
    assert (load.values, load.tables, load.load, load.on) == ([1.0], [1], 7, "fabric")


# Of three increments of the model.
@pytest.mark.parametrize(("wanted", "cuts"), [(100, 34), (0, 1), (3, 1), (4, 2)])
def test_increments_are_divided_equally(read_by_stand_in, wanted, cuts):
    deck = bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings(increments=wanted))
    content = read_by_stand_in(deck)
    (case,) = content.cases
    assert case.increments == 3 * cuts and content.every == cuts
    assert case.step == pytest.approx(1 / cuts, rel=1e-11)
    # The thesis' control; its limit of increments is of the whole job: never the limit.
    assert case.control == (1e-3, 1e-3, 30) and "\n     99999        30" in deck


def test_strip_is_pulled_in_its_plane(read_by_stand_in):
    model = straight_strip("warp", 50, 60, 0.81)
    pulls = np.array(model.elongations)
    content = read_by_stand_in(strip_deck(model, TRILINEAR_LAW, MarcSettings(), pulls))
    found = conditions(content)
    assert found["pull"] == ([2], [-1.0], [1], "bottom")
    assert found["flat"] == ([3, 4, 5, 6], [0] * 4, [0] * 4, "all_nodes")
    assert found["fix_top"][0] == [2] and found["fix_symmetry_x"][0] == [1]
    np.testing.assert_allclose(content.tables[1].y[1:], pulls)
    assert "pull" in content.cases[0].conditions and "pull" not in content.initial
    membrane = read_by_stand_in(strip_deck(model, TRILINEAR_LAW, MarcSettings(element=18), pulls))
    assert conditions(membrane)["flat"][0] == [3]


@pytest.mark.parametrize("angle", [0, 30, 45, 90])
def test_bias_strip_has_turned_yarns(read_by_stand_in, angle):
    model = bias_strip(10, 14, 0.81, angle=angle)
    content = read_by_stand_in(
        strip_deck(model, TRILINEAR_LAW, MarcSettings(), np.array(model.elongations))
    )
    ((name, warp, fill),) = content.frames
    assert name == "fabric"
    np.testing.assert_allclose(warp, model.warp, atol=1e-9)
    np.testing.assert_allclose(fill, np.cross([0, 0, 1], model.warp), atol=1e-9)


@pytest.mark.parametrize("key", ["slack", "rim_motion", "strains"])
def test_slack_sheet_and_moving_rim_are_refused(key):
    mesh = disk_mesh(100.0, 16)
    rim = len(mesh.node_sets["rim"])
    what = {"slack": (0.001, 0.0), "rim_motion": np.zeros((1, rim, 3)), "strains": {"a": None}}[key]
    model = BubbleModel(mesh, 0.81, (0.1,), **{key: what})
    with pytest.raises(SolverFailure, match="no slack sheet, no metric and no rim that moves"):
        analyse_bubble(model, HypoelasticLaw.linear(500.0, 250.0, 12.0), MarcSettings(), None)


def test_inflation_deck_has_neither_contact_nor_cavity(read_by_stand_in, tube_model):
    content = read_by_stand_in(cylinder_deck(tube_model, LINEAR_LAW, MarcSettings()))
    assert not content.gas and not content.bodies
    names = {"fix_symmetry_x", "fix_symmetry_z", "hold", "pressure"}
    assert set(content.cases[-1].conditions) == names
    found = conditions(content)
    assert found["hold"] == ([2], [0.0], [0], "support_bottom")
    # Shells do not turn about the axes in their plane of symmetry.
    assert found["fix_symmetry_z"][0] == [3, 4, 5]
    np.testing.assert_allclose(content.tables[1].y, [0, *tube_model.inflation])
    assert content.cases[0].increments == 100
    # Seam and caps have their own thickness.
    assert sorted(t for t, _ in content.thickness) == pytest.approx([0.81, 2.43])


def test_bending_deck_fills_and_closes_a_cavity(read_by_stand_in, tube_model, inflated_points):
    content = read_by_stand_in(
        cylinder_deck(tube_model, LINEAR_LAW, MarcSettings(increments=0), inflated_points)
    )
    guides = {"fix_symmetry_x", "fix_symmetry_z"}
    assert set(content.initial) == guides | {"hold"}
    cases = [set(case.conditions) for case in content.cases]
    assert cases == [guides | {"hold", "fill"}, guides | {"hold", "closed"}, guides | {"closed"}]
    assert [case.increments for case in content.cases] == [len(tube_model.inflation), 1, 3]
    assert content.gas == pytest.approx([0.101, 300.0, 1.2041e-12])
    fill, closed = (content.conditions[name] for name in ("fill", "closed"))
    assert (fill.tables, fill.load, closed.tables, closed.load) == ([1], 1, [0], 2)
    assert not [c for c in content.conditions.values() if c.kind == "pressure"]
    # Paths of the bodies.
    filled, last = len(tube_model.inflation), len(tube_model.inflation) + 1 + 3
    load, support, collar = (content.tables[number] for number in (1, 2, 3))
    for table in (support, collar, load):
        np.testing.assert_array_equal(table.x, range(last + 1))
    assert (support.y[: filled + 1] == -WAITING_DEPTH).all() and (
        support.y[filled + 1 :] == 0
    ).all()
    assert (collar.y[: filled + 2] == 0).all() and (load.y[filled:] == tube_model.pressure).all()
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


def test_contact_bodies_begin_where_they_touch(tube_model, inflated_points):
    whole = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0], symmetry="full")
    with pytest.raises(InputError, match="quarter"):
        cylinder_deck(whole, LINEAR_LAW, MarcSettings(), np.zeros_like(whole.mesh.points))
    touch = touching(tube_model)
    assert len(touch["collar"]) and len(touch["supports"])
    assert not np.intersect1d(touch["collar"], touch["supports"]).size
    assert (tube_model.mesh.points[touch["collar"], 2] < 133).all()
    support, collar = contact_bodies(tube_model, inflated_points)
    # Corners of a polygon of the circle's area are a little outside of the circle.
    crown = 1.05 * np.hypot(*tube_model.mesh.points[:, :2].T).max()
    assert 105.0 < crown < 106.6
    points = np.reshape(support["patches"], (-1, 3))
    assert points[:, 1].max() == pytest.approx(-crown + 0.02, abs=1e-9)
    points = np.reshape(collar["patches"], (-1, 3))
    # Its mouth is rounded; corners of flat faces lie outside the ring, here by 0.034 mm.
    top = points[points[:, 2] < 60, 1].max()
    assert crown + ABOVE < top < crown + ABOVE + 0.05


def test_rim_of_the_tube_may_touch_a_support():
    """Its nodes belong to tube and caps; what they carry counts among the support's forces."""
    supports = RigidSupports(span=1356.0, diameter=140.0)
    tube = inflated_cylinder(150.0, 0.1, 0.81, 75.0, length=1500.0, supports=supports)
    sets = tube.mesh.node_sets
    rim = np.intersect1d(sets["caps"], sets["ends"])
    low = rim[tube.mesh.points[rim, 1] < -40.0]
    assert len(low) and np.isin(low, touching(tube)["supports"]).all()
    inner = np.setdiff1d(sets["caps"], rim)
    assert not np.isin(inner, touching(tube)["supports"]).any()


CYLINDER = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 40.0])


def text_of_strip_deck(settings=SETTINGS, law=LINEAR_LAW):
    model = straight_strip("fill", 50, 60, 0.81, increments=5)
    return strip_deck(model, law, settings, np.array(model.elongations))


def text_of_bending_deck(settings=SETTINGS, law=LINEAR_LAW):
    grown = CYLINDER.mesh.points * [0.05, 0.05, 0.0]
    return cylinder_deck(CYLINDER, law, settings, grown)


@pytest.mark.parametrize("element", [139, 75, 18])
@pytest.mark.parametrize("law", ["nlelast", "hypela2"])
@pytest.mark.parametrize("deck", [text_of_bubble_deck, text_of_strip_deck, text_of_bending_deck])
def test_stand_in_accepts_all_our_decks(read_by_stand_in, deck, law, element):
    content = read_by_stand_in(deck(MarcSettings(element=element, law=law)))
    assert content.type == element
    assert sum(case.increments for case in content.cases) >= 100


@pytest.mark.parametrize(("diameter", "size"), [(150.0, 60.0), (200.0, 80.0), (250.0, 50.0)])
def test_collar_touches_after_its_gap(read_by_stand_in, diameter, size):
    model = inflated_cylinder(diameter, 0.08, 0.81, size, deflections=[20.0])
    grown = model.mesh.points * [0.04, 0.05, 0.0]
    content = read_by_stand_in(cylinder_deck(model, LINEAR_LAW, SETTINGS, grown))
    support, collar = content.bodies[1:]
    assert first_touch(collar, content.coordinates + grown) == pytest.approx(0.5, abs=1e-9)
    assert content.tables[collar.table].y[-1] == pytest.approx(-20.5)
    assert collar_of(collar).radius == pytest.approx(0.5 * model.collar.inner_diameter)
    assert support_of(support).radius == pytest.approx(0.5 * model.supports.diameter)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_law_is_equal_in_tables_and_subroutine(read_by_stand_in, tmp_path, name):
    needs.fortran()
    law = LAWS[name]
    content = read_by_stand_in(text_of_bubble_deck(MarcSettings(law="hypela2"), law))
    source = tmp_path / "hypela2.f"
    source.write_text(hypela2_source({1: law}))
    found = [law_of_subroutine(compiled(source, tmp_path), content.states)]
    if law.thickness_change == "constant":
        # Tables that the adapter writes, and those of the exported card in their place.
        exported = tmp_path / "card.dat"
        card = MaterialCard(law, 0.8, "Valmex 7318")
        exported.write_text(FORMATS["marc"].export(card).files[".dat"])
        for given in (SETTINGS, MarcSettings(include={"nlelast": str(exported)})):
            found.append(law_of_tables(read_by_stand_in(text_of_bubble_deck(given, law))))
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


def test_frame_nearest_to_a_load_counts(monkeypatch, tmp_path):
    mesh = disk_mesh(10.0, 16)
    still = np.zeros((len(mesh.points), 3))
    times = (0.99, 0.995, 1.0, 1.005, 1.5, 1.995, 2.0)

    class File:
        def __init__(self, path):
            self.mesh = ResultMesh(np.arange(1, len(still) + 1), mesh.points, ())

        def frames(self, is_complete):
            return [ResultFrame(t, fields={DISPLACEMENT: still + t}) for t in times]

    monkeypatch.setattr(analyses, "T19File", File)
    frames = frames_by_time(tmp_path / "job.t19", mesh)
    assert {time: frame[DISPLACEMENT][0, 0] for time, frame in frames.items()} == {1: 1.0, 2: 2.0}
