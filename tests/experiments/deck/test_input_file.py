"""experiments/deck/input_file.py: blocks of a deck, its constants, and a template of it."""

from dataclasses import replace

import pytest
from bubblefit.experiments.deck.input_file import InputDeck

from ...builders.decks import CUBE
from ...support.refusals import complaint

DECK = """\
** a comment, with a comma
*Include, Input=cube.inp
*MATERIAL, NAME=RUBBER
*HYPERELASTIC, OGDEN, N=2
1.5, 2., -0.4,
-1.5, 0.01, 0.01
*MATERIAL, NAME=STEEL
*ELASTIC
210000., 0.3, 293.
200000., 0.3, 593.
*DAMPING, ALPHA=5., BETA=1E-4
*SOLID SECTION, ELSET=CUBE, MATERIAL=RUBBER
*BOUNDARY
BOTTOM, 3
*STEP, NLGEOM
*STATIC
0.2, 1.
*BOUNDARY
7, 3, 3, 0.6
*NODE PRINT, NSET=GRIP
U
*END STEP
"""


def deck(folder, text=DECK):
    (folder / "cube.inp").write_text(CUBE)
    path = folder / "frame.inp"
    path.write_text(text)
    return InputDeck(path)


def test_summary_lists_materials_sets_steps_and_outputs(tmp_path):
    assert deck(tmp_path).summary() == [
        "materials: RUBBER, STEEL",
        "node sets: GRIP, BOTTOM, ALL",
        "steps: *STATIC",
        "outputs: *NODE PRINT U",
    ]


def test_constants_of_materials_have_names_bounds_and_places(tmp_path):
    constants = {constant.name: constant for constant in deck(tmp_path).constants()}
    assert {name: constant.value for name, constant in constants.items()} == {
        "mu1": 1.5,
        "alpha1": 2.0,
        "mu2": -0.4,
        "alpha2": -1.5,
        "E": 210000.0,
        "nu": 0.3,
        "damping_alpha": 5.0,
        "damping_beta": 1e-4,
    }
    assert constants["mu1"].bounds == (0.3, 7.5)
    assert constants["mu2"].bounds == (-2.0, -0.08)
    for value in (0.0, 0.3, 0.49):
        assert replace(constants["nu"], value=value).bounds == (0.0, 0.49)
    assert replace(constants["nu"], value=-0.1).bounds == (-0.5, -0.02)


@pytest.mark.parametrize(
    ("block", "names"),
    [
        ("*ELASTIC, TYPE=ORTHOTROPIC\n5.,1.,4.,1.,1.,3.,1.,1.,\n1.2,294.", "D1111 D2323"),
        ("*ELASTIC, TYPE=ENGINEERING CONSTANTS\n5.,1.,4.,.1,.1,.3,1.,1.,\n1.2", "E_1 G_23"),
        ("*HYPERELASTIC, MOONEY-RIVLIN\n0.3, 0.1, 0.01", "C10 C01"),
        ("*HYPERELASTIC, POLYNOMIAL, N=2\n.3, .1, .01, .02, .03, 1., 2.", "C10 C02"),
        ("*USER MATERIAL, CONSTANTS=9\n1,2,3,4,5,6,7,8\n9", "c1 c9"),
        ("*ELASTIC, TYPE=UNHEARD OF\n1., 2.", ""),
    ],
)
def test_first_and_last_constants_of_a_block(tmp_path, block, names):
    constants = deck(tmp_path, f"*MATERIAL, NAME=M\n{block}\n").constants()
    found = [constant.name for constant in constants]
    assert " ".join([*found[:1], *found[-1:]]) == names


def test_constants_of_two_materials_are_told_apart(tmp_path):
    text = "".join(f"*MATERIAL, NAME={name}\n*ELASTIC\n10., 0.\n" for name in ("A-1", "B"))
    assert [constant.name for constant in deck(tmp_path, text).constants()] == ["E_A_1", "E_B"]


def test_template_keeps_all_but_constants_and_asks_for_forces(tmp_path):
    read = deck(tmp_path)
    lines = read.template(read.constants()).splitlines()
    mu2 = "{{ mu2 | default(-0.4) | number }}"
    assert lines[4] == (
        "{{ mu1 | default(1.5) | number }}, {{ alpha1 | default(2.0) | number }}, " + mu2 + ","
    )
    assert lines[5] == "{{ alpha2 | default(-1.5) | number }}, 0.01, 0.01"
    assert lines[10].startswith("*DAMPING, ALPHA={{ damping_alpha | default(5.0) | number }}, BETA")
    assert lines[-3:] == ["*NODE FILE", "U, RF", "*END STEP"]
    kept = [line for line in lines[:-3] if "{{" not in line]
    assert kept == [line for line in DECK.splitlines()[:-1] if line in kept] and len(kept) == 17


def test_constants_of_an_included_file_are_found_in_its_place(tmp_path):
    (tmp_path / "steel.inp").write_text("*MATERIAL, NAME=STEEL\n*ELASTIC\n210000., 0.3\n")
    text = "*HEADING\n*INCLUDE, INPUT=cube.inp\n*INCLUDE, INPUT=steel.inp\n*STEP\n*END STEP\n"
    found = deck(tmp_path, text)
    assert [constant.name for constant in found.constants()] == ["E", "nu"]
    lines = found.template(found.constants()).splitlines()
    assert lines[1:4] == ["*INCLUDE, INPUT=cube.inp", "*MATERIAL, NAME=STEEL", "*ELASTIC"]
    assert lines[4].startswith("{{ E | default(210000.0) | number }},")
    assert list(found.included) == ["cube.inp"]


def test_loading_is_a_motion_or_a_force_of_the_last_step(tmp_path):
    motion = deck(tmp_path).loading()
    assert motion == {"place": "node = [1.0, 1.0, 1.0]", "axis": "z", "is_prescribed": True}
    force = deck(tmp_path, DECK.replace("*BOUNDARY\n7, 3, 3", "*CLOAD\nGRIP, 2")).loading()
    assert force == {"place": 'set = "GRIP"', "axis": "y", "is_prescribed": False}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("Input=cube.inp", "Input=none.inp", "none.inp: there is no file"),
        ("Input=cube.inp", "Input=../cube.inp", "line 2: includes ../cube.inp; put it beside"),
        ("1.5, 2.", "{{ a }}, 2.", "line 5: has marks of a template: name it in [[deck]] as it is"),
        (DECK, "1, 2, 3\n", "holds no line with a keyword such as *MATERIAL"),
    ],
)
def test_unfit_decks_are_refused(tmp_path, old, new, words):
    def read():
        wrong = deck(tmp_path, DECK.replace(old, new))
        wrong.template(wrong.constants())

    assert words in complaint(read)
