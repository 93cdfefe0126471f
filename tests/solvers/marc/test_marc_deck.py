"""The Marc deck: columns, counts, names; blocks that a site replaces."""

import re

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.meshes.tube import Refinement, cylinder_mesh
from bubblefit.solvers.marc.deck import fabric_context, fabric_frames, named_set, set_lines
from bubblefit.solvers.marc.settings import BLOCKS, MarcSettings
from bubblefit.solvers.marc.sheets import analyse_bubble, bubble_deck, strip_deck
from hypothesis import given
from hypothesis import strategies as st

LAW = HypoelasticLaw(
    1e3 * np.array([0, 3.0, -0.6, 0.06, -0.8, 1.07, 0.07, 0.4, -589.0, 217.0, -20.4, 0.8]),
    strain_range=[0.13, 0.2, 0.25],
)
REAL = re.compile(r" ?[ -]\d\.\d{12}E[+-]\d{2,3}")


def bubble(elements=48, increments=(0.01, 0.03, 0.1)):
    return BubbleModel(disk_mesh(100.0, elements, "quarter"), 0.81, increments)


def lines_of(deck):
    """Without comments, as Marc reads it."""
    return [line for line in deck.splitlines() if not line.startswith("$")]


def blocks_of(deck, keyword):
    """Data lines after each line that begins with a keyword, to the end of the deck."""
    lines = lines_of(deck)
    return [
        lines[i + 1 :]
        for i, line in enumerate(lines)
        if line.startswith(keyword.ljust(20)[:20].rstrip())
    ]


def integers(line):
    assert len(line) % 10 == 0, line
    return [int(line[i : i + 10]) for i in range(0, len(line), 10)]


def reals(line):
    assert len(line) % 20 == 0, line
    fields = [line[i : i + 20] for i in range(0, len(line), 20)]
    assert all(REAL.fullmatch(field) for field in fields), line
    return [float(field) for field in fields]


def parameter(deck, name):
    head = lines_of(deck)[: lines_of(deck).index("end")]
    (line,) = [line for line in head if line[:20].rstrip() == name]
    return integers(line[20:])


@pytest.mark.parametrize("element", [139, 75, 18])
def test_the_mesh_is_whole(element):
    model = bubble()
    deck = bubble_deck(model, LAW, MarcSettings(element=element))
    lines = lines_of(deck)
    assert max(map(len, lines)) <= 160 and deck.isascii() and "\t" not in deck
    (sizing,) = [line for line in lines if line.startswith("sizing")]
    assert integers(sizing[30:]) == [0, len(model.mesh.quads), len(model.mesh.points), 0]
    assert parameter(deck, "elements") == [element]
    (data,) = blocks_of(deck, "connectivity")
    rows = [integers(line) for line in data[1 : 1 + len(model.mesh.quads)]]
    assert [row[0] for row in rows] == list(range(1, len(rows) + 1))
    assert {row[1] for row in rows} == {element}
    np.testing.assert_array_equal([row[2:] for row in rows], model.mesh.quads + 1)
    (data,) = blocks_of(deck, "coordinates")
    assert integers(data[0]) == [3, len(model.mesh.points), 0, 1]
    rows = data[1 : 1 + len(model.mesh.points)]
    assert [int(row[:10]) for row in rows] == list(range(1, len(rows) + 1))
    np.testing.assert_allclose([reals(row[10:]) for row in rows], model.mesh.points, rtol=1e-12)
    # The block ends where it says it does.
    assert data[1 + len(rows)].startswith("define")
    assert ("shell sect" in deck) == (element != 18)


def members(deck, kind, name):
    """A set, read as Marc's extended format has it."""
    lines = lines_of(deck)
    start = lines.index(f"define              {kind:<20}set                 {name}") + 1
    found, words = [], []
    while True:
        words += lines[start].split()
        if words[-1] != "c":
            break
        words.pop()
        start += 1
    while words:
        first = int(words.pop(0))
        if words and words[0] == "to":
            words.pop(0)
            found += range(first, int(words.pop(0)) + 1)
        else:
            found.append(first)
    return np.array(found) - 1


def test_sets_hold_what_the_mesh_says():
    model = bubble()
    deck = bubble_deck(model, LAW, MarcSettings())
    for name in ("rim", "symmetry_x", "symmetry_y"):
        np.testing.assert_array_equal(members(deck, "node", name), model.mesh.node_sets[name])
    np.testing.assert_array_equal(members(deck, "element", "fabric"), range(len(model.mesh.quads)))


@given(st.sets(st.integers(0, 200), min_size=1).map(sorted))
def test_any_set_comes_back(numbers):
    lines = set_lines(np.array(numbers))
    assert all(line.endswith(" c") for line in lines[:-1]) and not lines[-1].endswith("c")
    assert max(map(len, lines)) <= 160
    deck = "\n".join(["define              node                set                 some", *lines])
    assert members(deck, "node", "some").tolist() == numbers


@pytest.mark.parametrize("name", ["", "Rim", "a b", "a,b", "x" * 29, "rim$"])
def test_names_that_marc_could_not_read_are_refused(name):
    with pytest.raises(InputError, match="at most 28"):
        named_set("node", name, np.array([1]))


def test_a_set_of_nothing_is_refused():
    with pytest.raises(InputError, match="holds nothing"):
        named_set("node", "rim", np.array([], dtype=int))


def table(deck, name):
    """Variable type and points of a table."""
    lines = lines_of(deck)
    at = lines.index(f"table               {name}")
    number, variables, *_ = integers(lines[at + 1])
    kind, count, *rest = integers(lines[at + 2])
    assert variables == 1 and len(rest) == 10
    points = np.array([reals(line) for line in lines[at + 3 : at + 3 + count]])
    # No point too many.
    assert not lines[at + 3 + count].startswith("  ") or len(lines[at + 3 + count]) != 40
    return number, kind, points


def test_the_load_is_a_table_of_time():
    model = bubble()
    number, kind, points = table(bubble_deck(model, LAW, MarcSettings()), "load")
    assert (number, kind) == (1, 1)
    np.testing.assert_array_equal(points[:, 0], range(len(model.increments) + 1))
    np.testing.assert_allclose(points[:, 1], [0, *model.increments])


@pytest.mark.parametrize(("modulus", "name"), [("E1", "e1"), ("E2", "e2"), ("G12", "g12")])
def test_tables_of_moduli_are_the_law_and_hold_its_ends(modulus, name):
    _, _, points = table(bubble_deck(bubble(), LAW, MarcSettings()), name)
    strain, value = points.T
    assert len(points) > 100 and (np.diff(strain) > 0).all()
    np.testing.assert_allclose(value, LAW.modulus(modulus, strain), rtol=1e-11)
    # Level at both ends: the same whether Marc holds the end or goes on along the last slope.
    assert value[0] == value[1] and value[-1] == value[-2]
    between = 0.5 * (strain[1:] + strain[:-1])
    read = np.interp(between, strain, value)
    np.testing.assert_allclose(read, LAW.modulus(modulus, between), rtol=2e-4)


def test_nlelast_names_its_tables():
    deck = bubble_deck(bubble(), LAW, MarcSettings())
    (data,) = blocks_of(deck, "nlelast")
    assert data[0] == "" and integers(data[1][:50]) == [1, 2, 0, 0, 0]
    assert reals(data[2]) == [1, 1, 0.24, 1]
    assert integers(data[3]) == [
        table(deck, "e1")[0],
        table(deck, "e2")[0],
        0,
        table(deck, "g12")[0],
    ]
    assert data[4] == "fabric"


@pytest.mark.parametrize(("element", "states"), [(139, 7), (18, 7), (75, 9)])
def test_hypela2_has_room_for_its_state(element, states):
    deck = bubble_deck(bubble(), LAW, MarcSettings(law="hypela2", element=element))
    assert parameter(deck, "state vars") == [states]
    assert "hypoelastic" in deck and "nlelast" not in deck


def test_incompressible_thickness_needs_the_subroutine():
    law = HypoelasticLaw.linear(800, 400, 60, thickness_change="incompressible")
    with pytest.raises(InputError, match="hypela2"):
        bubble_deck(bubble(), law, MarcSettings())
    assert bubble_deck(bubble(), law, MarcSettings(law="hypela2"))


def conditions(deck):
    """FIXED DISP by name: dofs, values, tables, node set."""
    (data,) = blocks_of(deck, "fixed disp")
    found, at = {}, 1
    while len(data[at]) > 60:
        assert integers(data[at][:60]) == [1, 0, 0, 0, 1, 0]
        values, tables, dofs = reals(data[at + 1]), integers(data[at + 2]), integers(data[at + 3])
        assert len(values) == len(tables) == len(dofs) and integers(data[at + 4]) == [2]
        found[data[at][60:]] = (dofs, values, tables, data[at + 5])
        at += 6
    return found


def loadcases(deck):
    return [
        [line.strip() for line in data[1 : 1 + int(data[0])]]
        for data in blocks_of(deck, "loadcase")
    ]


@pytest.mark.parametrize(("element", "plane"), [(139, [1, 5, 6]), (75, [1, 5, 6]), (18, [1])])
def test_supports_of_a_bubble(element, plane):
    found = conditions(bubble_deck(bubble(), LAW, MarcSettings(element=element)))
    assert found["fix_rim"] == ([1, 2, 3], [0, 0, 0], [0, 0, 0], "rim")
    assert found["fix_symmetry_x"][0] == plane
    assert len(found) == 3


def test_every_condition_and_set_that_is_named_is_there():
    decks = [bubble_deck(bubble(), LAW, MarcSettings(element=e)) for e in (139, 18)]
    for model in (straight_strip("fill", 50, 60, 0.81), bias_strip(10, 14, 0.81)):
        decks.append(strip_deck(model, LAW, MarcSettings(), np.array(model.elongations)))
    for deck in decks:
        sets = [line[60:] for line in lines_of(deck) if line.startswith("define")]
        assert len(sets) == len(set(sets))
        known = {*conditions(deck), "pressure"}
        for names in loadcases(deck):
            assert names and set(names) <= known
        assert {one[3] for one in conditions(deck).values()} <= set(sets)


def test_a_bubble_is_pressed_on_from_below():
    deck = bubble_deck(bubble(), LAW, MarcSettings(pressure_type=7, pressure_sign=1))
    (data,) = blocks_of(deck, "dist loads")
    assert data[1][60:] == "pressure"
    assert reals(data[2])[0] == 1.0 and integers(data[3])[0] == 1
    assert integers(data[4]) == [7] and data[6] == "fabric"
    assert reals(blocks_of(bubble_deck(bubble(), LAW, MarcSettings()), "dist loads")[0][2])[0] == -1
    assert parameter(deck, "follow for") == [1, 0, 0]


@pytest.mark.parametrize(
    ("wanted", "cuts"), [(100, 34), (0, 1), (3, 1), (4, 2)]
)  # of three increments of the model
def test_increments_of_the_model_are_cut_into_equal_ones(wanted, cuts):
    deck = bubble_deck(bubble(), LAW, MarcSettings(increments=wanted))
    (data,) = blocks_of(deck, "auto load")
    assert integers(data[0])[0] == 3 * cuts
    (data,) = blocks_of(deck, "time step")
    assert reals(data[0])[0] == pytest.approx(1 / cuts, rel=1e-11)
    (data,) = blocks_of(deck, "post")
    post = integers(data[0])
    # Formatted, at the whole times.
    assert post[3] == 1 and post[8] == cuts and len(post) == 16


def test_control_is_the_thesis():
    (data,) = blocks_of(bubble_deck(bubble(), LAW, MarcSettings()), "control")
    fields = integers(data[0])
    assert fields[3] == 5 and fields[5] == 1 and len(fields) == 16
    # Of the whole job, all load cases: never the limit.
    assert fields[0] == 99999
    assert reals(data[1])[0] == reals(data[2])[0] == 0.001


def test_a_strip_is_pulled_down_in_its_plane():
    model = straight_strip("warp", 50, 60, 0.81)
    pulls = np.array(model.elongations)
    deck = strip_deck(model, LAW, MarcSettings(), pulls)
    found = conditions(deck)
    assert found["pull"] == ([2], [-1.0], [1], "bottom")
    assert found["flat"] == ([3, 4, 5, 6], [0] * 4, [0] * 4, "all_nodes")
    assert found["fix_top"][0] == [2] and found["fix_symmetry_x"][0] == [1]
    np.testing.assert_allclose(table(deck, "load")[2][1:, 1], pulls)
    membrane = strip_deck(model, LAW, MarcSettings(element=18), pulls)
    assert conditions(membrane)["flat"][0] == [3]
    assert "follow for" not in deck and "dist loads" not in deck
    start, pull = loadcases(deck)
    assert "pull" in pull and "pull" not in start


def orientations(deck):
    (data,) = blocks_of(deck, "orientation")
    found = {}
    for i in range(integers(data[0])[0]):
        line, name = data[1 + 2 * i : 3 + 2 * i]
        assert line[:10] == "3d aniso  "
        angle, *vectors = reals(line[10:])
        assert angle == 0
        found[name] = np.reshape(vectors, (2, 3))
    return found


@pytest.mark.parametrize("angle", [0, 30, 45, 90])
def test_warp_and_fill_of_a_bias_strip(angle):
    model = bias_strip(10, 14, 0.81, angle=angle)
    deck = strip_deck(model, LAW, MarcSettings(), np.array(model.elongations))
    ((name, (warp, fill)),) = orientations(deck).items()
    assert name == "fabric"
    np.testing.assert_allclose(warp, model.warp, atol=1e-9)
    np.testing.assert_allclose(fill, np.cross([0, 0, 1], model.warp), atol=1e-9)


def tube():
    zones = (Refinement("collar", 0, 60, 40), Refinement("support", 800, 60, 40))
    return cylinder_mesh(2000, 200, 80, 40, "quarter", zones)


def test_every_facet_of_a_cylinder_has_its_frame_and_thickness():
    mesh = tube()
    thickness = np.where(np.isin(np.arange(len(mesh.quads)), mesh.element_sets["seam"]), 2.43, 0.81)
    context = fabric_context(mesh, mesh.warp, thickness)
    along, across = fabric_frames(mesh, mesh.warp)
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1)
    np.testing.assert_allclose(np.einsum("mk,mk->m", along, across), 0, atol=1e-12)
    # Outward normals, warp along the axis on the tube: the fill goes around.
    of = {s["name"]: s for s in context["sets"]}
    head = "define              element             set                 "
    text = "\n".join(line for s in of.values() for line in (head + s["name"], *s["lines"]))
    seen = np.zeros(len(mesh.quads), int)
    for frame in context["frames"]:
        which = members(text, "element", frame["set"])
        seen[which] += 1
        np.testing.assert_allclose(along[which], np.tile(frame["warp"], (len(which), 1)), atol=1e-8)
        np.testing.assert_allclose(
            across[which], np.tile(frame["fill"], (len(which), 1)), atol=1e-8
        )
    assert (seen == 1).all() and len(context["frames"]) < 40
    assert {layer["thickness"] for layer in context["layers"]} == {0.81, 2.43}
    for layer in context["layers"]:
        np.testing.assert_allclose(
            thickness[members(text, "element", layer["set"])], layer["thickness"]
        )
    assert set(of) >= {"fabric", "layer_1", "layer_2"}


def test_a_warp_normal_to_the_fabric_is_refused():
    with pytest.raises(InputError, match="normal to a facet"):
        fabric_frames(bubble().mesh, np.array([0.0, 0.0, 1.0]))


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


def test_a_site_block_is_a_template_with_the_context_of_ours(tmp_path):
    mine = tmp_path / "nlelast.inc"
    mine.write_text(
        "nlelast of {{ moduli | length }}, {{ nu12 }}\n"
        "{% for point in moduli[0].points %}{{ point | e20 }}\n{% endfor %}"
    )
    deck = bubble_deck(bubble(), LAW, MarcSettings(include={"nlelast": str(mine)}))
    assert "nlelast of 3, 0.24\n" in deck
    expected = table(bubble_deck(bubble(), LAW, MarcSettings()), "e1")[2]
    (data,) = blocks_of(deck, "nlelast")
    np.testing.assert_array_equal([reals(line) for line in data[: len(expected)]], expected)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("{{ nothing }}", "line 2.*'nothing' is undefined"),
        ("{% if %}", "line 2"),
        ("{{ (10 ** 12) | i10 }}", "line 2.*more than 10 digits"),
    ],
)
def test_mistakes_in_a_site_block_name_its_file_and_line(tmp_path, text, match):
    mine = tmp_path / "post.inc"
    mine.write_text(f"post\n{text}\n")
    with pytest.raises(InputError, match=match) as found:
        deck = bubble_deck(bubble(), LAW, MarcSettings(include={"post": str(mine)}))
        assert not deck
    assert str(mine) in str(found.value)


def test_a_site_block_cannot_reach_out_of_the_template(tmp_path):
    mine = tmp_path / "post.inc"
    mine.write_text("{{ ''.__class__.__mro__[1].__subclasses__() }}\n")
    with pytest.raises(InputError, match="unsafe"):
        bubble_deck(bubble(), LAW, MarcSettings(include={"post": str(mine)}))


def test_whole_decks_of_the_site(tmp_path):
    (tmp_path / "bubble.dat.j2").write_text('mine, {{ element }}\n{% include "post.dat.j2" %}\n')
    deck = bubble_deck(bubble(), LAW, MarcSettings(templates=str(tmp_path)))
    assert deck.startswith("mine, 139\npost\n")
    model = straight_strip("warp", 50, 60, 0.81)
    with pytest.raises(InputError, match=r"holds no uniaxial\.dat\.j2"):
        strip_deck(model, LAW, MarcSettings(templates=str(tmp_path)), np.array([1.0]))


@pytest.mark.parametrize("key", ["slack", "rim_motion"])
def test_a_slack_sheet_and_a_rim_that_moves_are_refused(key) -> None:
    mesh = disk_mesh(100.0, 16)
    rim = len(mesh.node_sets["rim"])
    what = {"slack": (0.001, 0.0), "rim_motion": np.zeros((1, rim, 3))}[key]
    model = BubbleModel(mesh, 0.81, (0.1,), **{key: what})
    with pytest.raises(SolverFailure, match="no slack sheet and no rim that moves"):
        analyse_bubble(model, HypoelasticLaw.linear(500.0, 250.0, 12.0), MarcSettings(), None)
