"""Kinds of test by name: folders of ours, those of plug-ins, and what is wrong with them."""

import logging
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import PlugInFailure
from bubblefit.experiments import registry
from bubblefit.experiments.base import with_defaults
from bubblefit.experiments.doubts import DOUBTFUL, Doubt, Expected, Judgement
from bubblefit.experiments.fabric import Fabric
from bubblefit.experiments.presenter import presenter_of
from bubblefit.experiments.registry import NEEDED, kind_named, kinds
from bubblefit.experiments.run_records import (
    BEYOND_CARD,
    BEYOND_CARD_WORDS,
    BEYOND_LAW,
    BEYOND_LAW_WORDS,
    by_strain,
    notes_beyond,
    notes_of,
    strains_of,
)
from bubblefit.experiments.sections import Place, Scales, named_format
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.base import History

from ..builders.plug_ins import install_plug_in
from ..support.refusals import complaint, complaint_with, raised

KIND = """
class Kind:
    name, title, section, fitted = "acme", "an acme test", None, True
    predicted = studied = read = report = None

THING = Kind()
"""


@pytest.mark.parametrize(
    ("reached", "said"), [(0.1080004, ["10.80004", "10.8"]), (0.313, ["31.3", "10.8"])]
)
def test_a_strain_beyond_its_end_is_not_printed_as_the_end(reached, said):
    (note,) = notes_beyond(
        np.array([reached, 0.0, 0.0]), np.full(3, 0.108), BEYOND_LAW, BEYOND_LAW_WORDS
    )
    assert re.findall(r"([\d.]+) %", note) == said


def test_ours_are_the_folders_fitted_ones_first():
    assert list(kinds())[:6] == ["bending", "biaxial", "bubble", "cycles", "strips", "tube"]
    for name, kind in kinds().items():
        assert kind.name == name and all(hasattr(kind, attribute) for attribute in NEEDED[:-1])
        assert callable(presenter_of(name).simulate)
        assert kind_named(name) is kind
    assert (
        "'bubbel' is not one of: bending, biaxial, bubble, cycles, cylinder, strips, tube"
        in complaint(kind_named, "bubbel")
    )


def test_a_plug_ins_kind_is_one_of_them(packages):
    install_plug_in(packages, "acme", KIND, group="bubblefit.tests")
    assert kinds()["acme"].title == kind_named("acme").title == "an acme test"


def test_a_plug_in_that_derives_from_nothing_has_the_defaults(packages):
    install_plug_in(packages, "acme", KIND, group="bubblefit.tests")
    kind = kind_named("acme")
    assert (kind.doubts, kind.folder_key, kind.with_units({"name": "a"}, Scales())) == (
        (), "", {"name": "a"}
    )  # fmt: skip
    test = with_defaults(SimpleNamespace(name="a", state="conditioned"))
    assert (test.state, test.pace, test.reads_files) == ("conditioned", None, False)
    assert (test.data_notes, test.data_files(), test.own_card) == ((), (), None)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("acme", "raise RuntimeError('no licence')", "cannot be imported (RuntimeError: no lic"),
        ("acme", "THING = 3", "is no kind of test: acme_acme:THING has no name, title, section"),
        ("other", KIND, "calls its kind of test 'acme'; both must have one name"),
    ],
)
def test_a_broken_kind_is_one_line_and_breaks_no_other(packages, caplog, name, text, words):
    install_plug_in(packages, name, text, group="bubblefit.tests")
    registry.warn_once.cache_clear()
    with caplog.at_level(logging.WARNING, logger="bubblefit"):
        assert name not in kinds() and "bubble" in kinds()
    line = f"the plug-in {name!r} of acme-things 2.5 {words}"
    assert caplog.text.count(line) == 1
    assert str(raised(PlugInFailure, "", kind_named, name)).startswith(line)


def test_a_plug_in_does_not_replace_one_of_ours(packages):
    install_plug_in(packages, "bubble", "raise RuntimeError", group="bubblefit.tests")
    assert kinds()["bubble"].title.startswith("a bubble")


PLACE = Place(Path("fabric.toml"), "bubble[0]", Fabric("Valmex", 0.8))


def test_a_format_is_checked_where_it_is_named():
    assert named_format(PLACE, "data.points.format", "frame", None) is None
    assert named_format(PLACE, "data.points.format", "frame", "csv") == "csv"
    said = complaint(named_format, PLACE, "data.points.format", "frame", "davis-9")
    assert said.startswith("fabric.toml: bubble[0].data.points.format: 'davis-9'")


CARD = MaterialCard(
    HypoelasticLaw([0] * 3 + [20] + [0] * 3 + [150] + [0] * 3 + [500], 0.24, [0.1, 0.2, 0.3]), 0.81
)


def history(low: tuple[float, ...], high: tuple[float, ...]) -> History:
    return History(np.ones(1), np.zeros((1, 4, 3)), np.array(low), np.array(high))


def test_shear_counts_either_way_and_compression_does_not():
    found = strains_of(history((-0.5, -0.6, -0.31), (0.1, 0.2, 0.25)))
    assert found == pytest.approx([0.1, 0.2, 0.31])
    assert strains_of(history((0.0, 0.0, -0.1), (0.1, 0.2, 0.3))) == pytest.approx([0.1, 0.2, 0.3])


def test_shear_beyond_the_card_is_noted_either_way():
    for low, high in ((-0.31, 0.0), (0.0, 0.31)):
        (note,) = notes_of(history((0.0, 0.0, low), (0.1, 0.2, high)), CARD)
        assert note.startswith("shear strain 31 %") and "30 %" in note


BOUNDS = Expected({"E1": (200.0, 1000.0), "E2": (100.0, 400.0)})


@pytest.mark.parametrize(
    ("modulus", "names", "words"),
    [
        (50.0, ("E1",), ""),
        (49.9, ("E1",), "49.9 MPa, and the bounds of E1 are 200 to 1e+03"),
        (4000.0, ("E1",), ""),
        (4001.0, ("E1",), "4e+03 MPa, and the bounds of E1 are 200 to 1e+03"),
        (25.0, ("E1", "E2"), ""),
        (24.9, ("E1", "E2"), "24.9 MPa, and the bounds of E1 and E2 are 100 to 1e+03"),
        (1601.0, ("E2",), "1.6e+03 MPa, and the bounds of E2 are 100 to 400"),
    ],
)
def test_a_rough_modulus_may_be_off_by_four(modulus, names, words):
    assert BOUNDS.outside(modulus, names) == words


@pytest.mark.parametrize(("low", "stiffer"), [(60.0, False), (60.1, True)])
def test_bounds_that_mean_the_warp_to_be_stiffer(low, stiffer):
    assert Expected({"E1": (low, 1000.0), "E2": (100.0, 400.0)}).warp_is_stiffer is stiffer


def test_what_stops_a_fit_and_what_is_noted():
    doubts = [Doubt("a", False, "perhaps"), Doubt("b", True, "sure"), Doubt("c", True, "known"),
              Doubt("d", True, "too")]  # fmt: skip
    found = Judgement("t", tuple(doubts), ["c", "a"])
    assert [d.name for d in found.errors] == ["b", "d"]
    assert [(n.kind, str(n), n.of) for n in found.notes] == [
        (DOUBTFUL, f"{text} (trusted: {name})", "t")
        for text, name in (("perhaps", "a"), ("known", "c"))
    ]
    complaint_with(["sure [b]; too [d].", "--trust"], found.demand, Path("p.toml"))
    Judgement("t", tuple(doubts), "abcd").demand(Path("p.toml"))


def test_the_words_of_notes():
    ends, beyond = np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.21, 0.2])
    assert notes_beyond(ends * (1 + 9e-7), ends) == []
    assert len(notes_beyond(ends * (1 + 1.1e-6), ends)) == 3
    for words, kind in ((BEYOND_CARD_WORDS, BEYOND_CARD), (BEYOND_LAW_WORDS, BEYOND_LAW)):
        found = notes_beyond(beyond, ends, kind, words)
        assert [note.kind for note in found] == [kind]
        assert "fill" in found[0] and "21 %" in found[0] and "20 %" in found[0]
    assert by_strain([1, 2, 3]) == {"warp": 1.0, "fill": 2.0, "shear": 3.0}
