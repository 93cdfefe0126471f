"""solvers/marc/settings.py: site files, site blocks and mistakes in them."""

import re

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.marc.analyses import bubble_deck, strip_deck
from bubblefit.solvers.marc.settings import BLOCKS, MarcSettings, marc_settings
from bubblefit.solvers.marc.solver import MarcSolver

from ...support.paths import ROOT
from ...support.refusals import complaint
from .cases import TRILINEAR_LAW, bubble_of


def test_unconfirmed_blocks_are_marked_and_can_be_replaced(tmp_path):
    deck = bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings())
    marked = re.findall(r"^\$ unconfirmed: (\w+)", deck, re.MULTILINE)
    assert set(marked) == {"nlelast", "orientation", "pressure", "control"}
    assert set(marked) <= set(BLOCKS)
    for name in marked:
        mine = tmp_path / f"{name}.txt"
        mine.write_text(f"$ mine: {name}\nmine")
        other = bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings(include={name: str(mine)}))
        assert f"$ unconfirmed: {name}" not in other
        assert f"$ mine: {name}\nmine\n" in other
        rest = [line for line in other.splitlines() if line not in (f"$ mine: {name}", "mine")]
        assert set(rest) <= set(deck.splitlines())


def test_site_block_is_a_template_with_the_context_of_the_deck(read_by_stand_in, tmp_path):
    mine = tmp_path / "nlelast.inc"
    mine.write_text(
        "nlelast of {{ moduli | length }}, {{ nu12 }}\n"
        "{% for point in moduli[0].points %}{{ point | e20 }}\n{% endfor %}"
    )
    deck = bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings(include={"nlelast": str(mine)}))
    assert "nlelast of 3, 0.24\n" in deck
    points = read_by_stand_in(bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings())).tables[11]
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
def test_mistake_in_a_site_block_names_file_and_line(tmp_path, text, match):
    mine = tmp_path / "post.inc"
    mine.write_text(f"post\n{text}\n")
    with pytest.raises(InputError, match=match) as found:
        deck = bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings(include={"post": str(mine)}))
        assert not deck
    assert str(mine) in str(found.value)


def test_site_can_replace_whole_decks(tmp_path):
    (tmp_path / "bubble.dat.j2").write_text('mine, {{ element }}\n{% include "post.dat.j2" %}\n')
    deck = bubble_deck(bubble_of(), TRILINEAR_LAW, MarcSettings(templates=str(tmp_path)))
    assert deck.startswith("mine, 139\npost\n")
    model = straight_strip("warp", 50, 60, 0.81)
    with pytest.raises(InputError, match=r"holds no uniaxial\.dat\.j2"):
        strip_deck(model, TRILINEAR_LAW, MarcSettings(templates=str(tmp_path)), np.array([1.0]))


def test_given_settings_override_the_site_file(tmp_path, monkeypatch):
    settings = marc_settings({})
    assert (settings.executable, settings.element, settings.law) == ("run_marc", 139, "nlelast")
    assert settings == MarcSettings() and settings.increments == 100
    (tmp_path / "nl.dat").write_text("mine")
    (tmp_path / "bin").mkdir()
    site = tmp_path / "site.toml"
    site.write_text(
        'executable = "bin/run_marc"\nelement = 75\nthreads = 2\nmodules = ["marc/2023"]\n'
        '[include]\nnlelast = "nl.dat"\n[environment]\nA = "1"\nB = "2"\n'
    )
    monkeypatch.setenv("BUBBLEFIT_MARC", str(site))
    settings = marc_settings({"threads": 4, "element": None, "environment": {"B": "3"}})
    assert settings.executable == str(tmp_path / "bin" / "run_marc")
    assert (settings.element, settings.threads) == (75, 4)
    assert settings.include == {"nlelast": str(tmp_path / "nl.dat")}
    assert settings.environment == {"A": "1", "B": "3"}
    # What is named counts more than the environment.
    other = marc_settings({"executable": "from_a_project"}, "/opt/marc/run_marc")
    assert other.executable == "/opt/marc/run_marc" and other.threads == 1
    monkeypatch.setenv("BUBBLEFIT_MARC", "/opt/marc/run_marc")
    assert marc_settings({}).executable == "/opt/marc/run_marc"
    assert marc_settings({"executable": "mine"}).executable == "mine"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"elemint = 75", "elemint: unknown key; did you mean 'element'"),
        (b"element = 22", "element: expected 139, 75 or 18"),
        (b"element = ", "TOML syntax"),
        (b"threads = 0", "threads"),
        (b'modules = ["marc/2023; rm -rf x"]', "modules[0]"),
        (b"[environment]\n\"A B\" = '1'", "environment"),
        (b"\xff\xfe\x00", "UTF-8"),
        (None, "cannot be read"),
    ],
)
def test_mistake_in_a_site_file_names_file_and_key(tmp_path, text, words):
    site = tmp_path / "site.toml"
    if text is not None:
        site.write_bytes(text)
    said = complaint(marc_settings, {}, str(site))
    assert str(site) in said and words in said


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"include": {"nlelst": "x"}}, "there is no block 'nlelst'; there are cavity"),
        ({"include": {"nlelast": "/none"}}, "/none: solver.marc.include.nlelast: there is no"),
        ({"templates": "/none"}, "/none: templates: there is no such folder"),
        ({"element": "S4"}, "solver.marc.element: expected 139, 75 or 18, got 'S4'"),
        ({"what": 1}, "solver.marc.what: unknown key"),
    ],
)
def test_mistake_in_a_setting_is_one_line(given, words):
    assert words in complaint(marc_settings, given)
    assert words in complaint(MarcSolver, **given)


def test_settings_and_blocks_are_documented():
    text = (ROOT / "docs" / "how-to" / "marc.md").read_text()
    for name in (*MarcSettings.model_fields, *BLOCKS):
        assert name in text, name
    for name in BLOCKS:
        assert (ROOT / "templates" / "marc" / f"{name}.dat.j2").is_file()
