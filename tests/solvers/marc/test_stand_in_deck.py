"""The stand-in for Marc: decks that it refuses."""

import re
from pathlib import Path

import numpy as np
import pytest
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.marc.analyses import cylinder_deck, strip_deck

from ...marc_stand_in.deck import DeckError
from ...marc_stand_in.laws import law_of_tables
from ...support.refusals import raised
from .cases import LINEAR_LAW, SETTINGS, text_of_bubble_deck

CYLINDER = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 40.0])


def text_of_strip_deck(settings=SETTINGS, law=LINEAR_LAW):
    model = straight_strip("fill", 50, 60, 0.81, increments=5)
    return strip_deck(model, law, settings, np.array(model.elongations))


def text_of_bending_deck(settings=SETTINGS, law=LINEAR_LAW):
    grown = CYLINDER.mesh.points * [0.05, 0.05, 0.0]
    return cylinder_deck(CYLINDER, law, settings, grown)


DECKS = {
    "bubble": text_of_bubble_deck(),
    "strip": text_of_strip_deck(),
    "bending": text_of_bending_deck(),
}


def first_line_with(pattern, text, new):
    changed, count = re.subn(pattern, new, text, count=1, flags=re.MULTILINE)
    assert count == 1 and changed != text, pattern
    return changed


SPOILED_DECKS = {
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


@pytest.mark.parametrize("what", SPOILED_DECKS)
def test_stand_in_refuses_a_spoiled_deck(read_by_stand_in, what):
    deck, pattern, new, match = SPOILED_DECKS[what]
    found = raised(DeckError, match, read_by_stand_in, first_line_with(pattern, DECKS[deck], new))
    assert found.number == (1005 if "inside out" in what else 13)


def test_stand_in_refuses_tables_that_are_no_law(read_by_stand_in):
    spoiled = {
        "is not above 0": first_line_with(
            r"  8\.000000000000E\+02", DECKS["bubble"], " -8.000000000000E+02"
        ),
        "wrong below zero": first_line_with(
            r"  8\.000000000000E\+02", DECKS["bubble"], "  7.000000000000E+02"
        ),
        "on no cubics": first_line_with(r"(  5.0{11}\dE-03 )( 8)\.0", DECKS["bubble"], r"\1\2.1"),
    }
    for match, text in spoiled.items():
        raised(DeckError, match, law_of_tables, read_by_stand_in(text))


def test_stand_in_shares_no_code_with_the_deck_writer():
    folder = Path(__file__).parents[2] / "marc_stand_in"
    for path in folder.glob("*.py"):
        imports = re.findall(r"^\s*(?:from|import) (\S+)", path.read_text(), re.MULTILINE)
        assert not [name for name in imports if "solvers.marc" in name or "exports" in name]
        if path.stem == "deck":
            assert not [name for name in imports if name.startswith("bubblefit")], path
