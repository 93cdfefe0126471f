"""The stand-in for Marc refuses decks that Marc would refuse, and takes every deck of ours."""

import re
from pathlib import Path

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports.subroutines import hypela2_source
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.marc.cylinder import bending_deck
from bubblefit.solvers.marc.settings import MarcSettings
from bubblefit.solvers.marc.sheets import bubble_deck, strip_deck
from bubblefit.solvers.registry import FORMATS

from ... import needs
from ...fortran_build import LAWS
from ...marc_stand_in.deck import DeckError, read_deck
from ...marc_stand_in.laws import compiled, law_of_subroutine, law_of_tables
from ...marc_stand_in.models import collar_of, first_touch, support_of

LINEAR = HypoelasticLaw.linear(800.0, 400.0, 60.0)
SETTINGS = MarcSettings(increments=0)
CYLINDER = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 40.0])


def bubble(settings=SETTINGS, law=LINEAR):
    return bubble_deck(
        BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03)), law, settings
    )


def strip(settings=SETTINGS, law=LINEAR):
    model = straight_strip("fill", 50, 60, 0.81, increments=5)
    return strip_deck(model, law, settings, np.array(model.elongations))


def bending(settings=SETTINGS, law=LINEAR):
    grown = CYLINDER.mesh.points * [0.05, 0.05, 0.0]
    return bending_deck(CYLINDER, law, settings, grown)


DECKS = {"bubble": bubble(), "strip": strip(), "bending": bending()}


def read(folder, text):
    path = folder / "job.dat"
    path.write_text(text)
    return read_deck(path)


@pytest.mark.parametrize("element", [139, 75, 18])
@pytest.mark.parametrize("law", ["nlelast", "hypela2"])
@pytest.mark.parametrize("deck", [bubble, strip, bending])
def test_every_deck_of_ours_is_taken(tmp_path, deck, law, element):
    content = read(tmp_path, deck(MarcSettings(element=element, law=law)))
    assert content.type == element
    assert sum(case.increments for case in content.cases) >= 100


@pytest.mark.parametrize(("diameter", "size"), [(150.0, 60.0), (200.0, 80.0), (250.0, 50.0)])
def test_the_collar_touches_after_half_a_millimetre(tmp_path, diameter, size):
    model = inflated_cylinder(diameter, 0.08, 0.81, size, deflections=[20.0])
    grown = model.mesh.points * [0.04, 0.05, 0.0]
    content = read(tmp_path, bending_deck(model, LINEAR, SETTINGS, grown))
    support, collar = content.bodies[1:]
    assert first_touch(collar, content.coordinates + grown) == pytest.approx(0.5, abs=1e-9)
    assert content.tables[collar.table].y[-1] == pytest.approx(-20.5)
    assert collar_of(collar).radius == pytest.approx(0.5 * model.collar.inner_diameter)
    assert support_of(support).radius == pytest.approx(0.5 * model.supports.diameter)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_the_law_is_found_in_tables_and_in_the_subroutine(tmp_path, name):
    needs.fortran()
    law = LAWS[name]
    content = read(tmp_path, bubble(MarcSettings(law="hypela2"), law))
    source = tmp_path / "hypela2.f"
    source.write_text(hypela2_source({1: law}))
    found = [law_of_subroutine(compiled(source, tmp_path), content.states)]
    if law.thickness_change == "constant":
        # Tables that the adapter writes, and those of the exported card in their place.
        exported = tmp_path / "card.dat"
        card = MaterialCard(law, 0.8, "Valmex 7318")
        exported.write_text(FORMATS["marc"].export(card).files[".dat"])
        for given in (SETTINGS, MarcSettings(include={"nlelast": str(exported)})):
            found.append(law_of_tables(read(tmp_path, bubble(given, law))))
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
def test_a_spoiled_deck_is_refused(tmp_path, what):
    deck, pattern, new, match = SPOILED[what]
    with pytest.raises(DeckError, match=match) as found:
        read(tmp_path, first(pattern, DECKS[deck], new))
    assert found.value.number == (1005 if "inside out" in what else 13)


def test_moduli_that_are_not_positive_or_on_no_curve_have_no_law(tmp_path):
    spoiled = {
        "is not above 0": first(r"  8\.000000000000E\+02", DECKS["bubble"], " -8.000000000000E+02"),
        "wrong below zero": first(
            r"  8\.000000000000E\+02", DECKS["bubble"], "  7.000000000000E+02"
        ),
        "on no cubics": first(r"(  5.0{11}\dE-03 )( 8)\.0", DECKS["bubble"], r"\1\2.1"),
    }
    for match, text in spoiled.items():
        content = read(tmp_path, text)
        with pytest.raises(DeckError, match=match):
            law_of_tables(content)


def test_the_parser_shares_no_code_with_what_writes_decks():
    folder = Path(__file__).parents[2] / "marc_stand_in"
    for path in folder.glob("*.py"):
        imports = re.findall(r"^\s*(?:from|import) (\S+)", path.read_text(), re.MULTILINE)
        assert not [name for name in imports if "solvers.marc" in name or "exports" in name]
        if path.stem == "deck":
            assert not [name for name in imports if name.startswith("bubblefit")], path
