"""[[card]] of a project, files of cards, and which of them a prediction runs with."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.kinds import Fabric, Place, Scales
from bubblefit.materials.card import MaterialCard, read_card, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.cards import CardSection, NamedCard, read_cards
from bubblefit.project.project import card_sources, chosen_cards, read_project
from bubblefit.runs.fit import fit

from ..complaints import complaint
from ..projects import constant_strips

LAW = HypoelasticLaw.linear(500.0, 200.0, 20.0)
CONSTANT = [0, 0, 0, 0.02, 0, 0, 0, 0.2, 0, 0, 0, 0.5]


def place(folder: Path = Path(), **scales: Any) -> Place:
    fabric = Fabric("a fabric", 0.8, "incompressible")
    return Place(folder / "p.toml", "", fabric, Scales(**scales))


def table(**said: Any) -> CardSection:
    return CardSection.model_validate({"name": "mine", "beta": [0, 0, 0, 0.5] * 3, **said})


def filed(folder: Path, name: str = "soft", file: str = "c.toml") -> Path:
    write_card(MaterialCard(LAW, 0.7, name, "a fit"), folder / file)
    return folder / file


def test_what_a_table_leaves_out():
    (found,) = read_cards(place(), [table()]).values()
    card = found.card
    assert (card.name, card.thickness, card.source, found.test) == ("mine", 0.8, "", None)
    assert (card.law.nu12, card.law.thickness_change) == (0.24, "incompressible")
    assert card.law.form.name == "cubic" and card.law.beta[3] == 500.0
    assert len(card.law.strain_range) == 3 and min(card.law.strain_range) > 1e6


def test_what_a_table_says_in_units_of_the_file():
    said = table(
        form="constant", beta=CONSTANT, nu12=0.0, thickness=0.001, thickness_change="constant",
        strain_range=[0.1, 0.2, 0.3], test="strips",
    )  # fmt: skip
    cards = read_cards(place(modulus=1e-6, length=1000.0), [said, table(name="other")])
    assert list(cards) == ["mine", "other"] and cards["mine"].test == "strips"
    card = cards["mine"].card
    assert card.law.beta[[3, 7, 11]] == pytest.approx(1e-6 * np.array([0.02, 0.2, 0.5]))
    assert (card.thickness, card.law.nu12, card.law.thickness_change) == (1.0, 0.0, "constant")
    assert card.law.strain_range.tolist() == [0.1, 0.2, 0.3]


def test_a_card_of_a_file_keeps_what_the_file_says(tmp_path):
    filed(tmp_path)
    filed(tmp_path, "", "bare.toml")
    sections = [
        CardSection(file="c.toml"),
        CardSection(file="c.toml", name="another"),
        CardSection(file="bare.toml", test="bubble"),
    ]
    found = read_cards(place(tmp_path), sections)
    assert list(found) == ["soft", "another", "bare"]
    assert [named.test for named in found.values()] == [None, None, "bubble"]
    for name, named in found.items():
        assert (named.card.name, named.card.thickness, named.card.source) == (name, 0.7, "a fit")
        np.testing.assert_allclose(named.card.law.beta, LAW.beta)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ([{}], "card[0]: expected exactly one"),
        ([{"file": "c.toml", "beta": CONSTANT}], "card[0]: expected exactly one"),
        ([{"beta": CONSTANT}], "card[0].name: this key is missing"),
        ([{"file": "c.toml"}, {"file": "c.toml", "nu12": 0.0}], "card[1].nu12: is said by"),
        ([{"file": "c.toml", "strain_range": [0.1] * 3}], "card[0].strain_range: is said by"),
        ([{"file": "c.toml", "knots": 5}], "card[0].knots: is said by"),
        ([{"file": "c.toml"}, {"name": "soft", "beta": [0.5] * 12}], "card[1].name: 'soft'"),
        ([{"name": "a", "beta": CONSTANT, "form": "quartic"}], "form: no form is called "),
    ],
)  # fmt: skip
def test_cards_that_cannot_be(tmp_path, said, words):
    filed(tmp_path)
    found = complaint(read_cards, place(tmp_path), [CardSection(**one) for one in said])
    assert found.startswith(f"{tmp_path / 'p.toml'}: card[") and words in found


def project(folder: Path, *names: str) -> Any:
    cards = {name: NamedCard(MaterialCard(LAW, 0.8, name)) for name in names}
    return SimpleNamespace(cards=cards, path=folder / "fabric" / "project.toml")


def test_cards_of_the_project_come_first_in_its_order(tmp_path):
    own, file = project(tmp_path, "soft", "stiff", "third"), filed(tmp_path, "from a file")
    asked = [str(file), "third", "soft"]
    assert list(chosen_cards(own, asked)) == ["soft", "third", "from a file"]
    assert card_sources(own, asked) == ["soft", "third", str(file)]
    assert list(chosen_cards(own)) == card_sources(own) == ["soft", "stiff", "third"]
    assert list(chosen_cards(own, [])) == ["soft", "stiff", "third"]
    given = {"mine": MaterialCard(LAW, 1.0)}
    assert chosen_cards(own, given) == given and card_sources(own, given) is None


def test_files_of_cards_have_names_of_their_own(tmp_path):
    own = project(tmp_path, "soft")
    one, bare = filed(tmp_path), filed(tmp_path, "", "bare.toml")
    assert list(chosen_cards(own, ["soft", one, bare])) == ["soft", f"soft ({one})", "bare"]
    assert list(chosen_cards(own, [one])) == ["soft"]
    said = complaint(chosen_cards, own, ["hard"])
    assert said.startswith(f"{own.path}: --card: ") and "'hard'" in said and "soft" in said
    assert complaint(chosen_cards, project(tmp_path), [tmp_path]).endswith("has: none")


def test_the_card_of_the_fit_where_the_project_has_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bare, fitted = project(tmp_path), Path("out/fabric/material.toml")
    assert card_sources(bare) == [fitted]
    said = complaint(chosen_cards, bare)
    assert said.startswith(f"{bare.path}: card: ") and str(fitted) in said and "--card" in said
    fitted.parent.mkdir(parents=True)
    filed(fitted.parent, "", "material.toml")
    assert list(chosen_cards(bare)) == ["material"]


def test_the_card_of_a_fit_is_as_sure_as_the_fit(tmp_path):
    found = fit(read_project(constant_strips(tmp_path)), starts=1)
    found.card.write(tmp_path / "card.toml")
    card = read_card(tmp_path / "card.toml")
    sure = found.best.certainty
    for name in ("E1", "E2"):
        strain = sure.strain[name]
        expected = sure.total[name] * found.law.modulus(name, strain)
        own = card.certainty.sigma(card.law, name, strain)
        np.testing.assert_allclose(own, expected, rtol=0.06)
        low, high = card.certainty.band(card.law, name, strain)
        # Ends of a thousand draws are sure to a twentieth of the band's half.
        half = 0.5 * float(np.max(high - low))
        np.testing.assert_allclose([low, high], sure.band[name], atol=0.1 * half, rtol=0)
    # No bias strip: the shear modulus is anywhere within its bounds, 5 to 200 MPa.
    shear = float(card.certainty.sigma(card.law, "G12", [0.0])[0])
    assert 40 < shear < 120
    values = sum(sum(c.objective.sizes) for c in found.problem.comparisons)
    assert f"{values} values of one, two" in card.certainty.words
    drawn = card.certainty.laws(card.law, 300, np.random.default_rng(0))
    moduli = np.array([float(law.E1(0.05)) for law in drawn])
    assert moduli.std() == pytest.approx(float(card.certainty.sigma(card.law, "E1", [0.05])[0]),
                                         rel=0.12)  # fmt: skip
