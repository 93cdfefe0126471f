"""Sections of the project file: the shipped schema is theirs, cards as the file has them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.cli.start import SHIPPED
from bubblefit.experiments.sections import Fabric, Place, Scales
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import card_sources, chosen_cards
from bubblefit.project.schema import CardSection, NamedCard, read_cards, schema_text

from ..support.refusals import complaint

LAW = HypoelasticLaw.linear(500.0, 200.0, 20.0)


CONSTANT = [0, 0, 0, 0.02, 0, 0, 0, 0.2, 0, 0, 0, 0.5]


def place(folder=Path(), **scales):
    fabric = Fabric("a fabric", 0.8, "incompressible")
    return Place(folder / "p.toml", "", fabric, Scales(**scales))


def filed(folder, name="soft", file="c.toml"):
    write_card(MaterialCard(LAW, 0.7, name, "a fit"), folder / file)
    return folder / file


def test_card_of_file_keeps_content_of_file(tmp_path):
    filed(tmp_path)
    filed(tmp_path, "", "bare.toml")
    said = ({"file": "c.toml"}, {"file": "c.toml", "name": "another"},
            {"file": "bare.toml", "test": "bubble"})  # fmt: skip
    found = read_cards(place(tmp_path), [CardSection(**one) for one in said])
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
        ([{"name": "a", "beta": CONSTANT, "form": "quartic"}], "form: no form is called ")
    ],
)  # fmt: skip
def test_impossible_card_sections_are_refused(tmp_path, said, words):
    filed(tmp_path)
    found = complaint(read_cards, place(tmp_path), [CardSection(**one) for one in said])
    assert found.startswith(f"{tmp_path / 'p.toml'}: card[") and words in found


def with_cards(folder, *names):
    cards = {name: NamedCard(MaterialCard(LAW, 0.8, name)) for name in names}
    return SimpleNamespace(cards=cards, has_law=True, path=folder / "fabric" / "project.toml")


def test_card_of_fit_is_used_where_project_has_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bare, fitted = with_cards(tmp_path), Path("out/fabric/material.toml")
    assert card_sources(bare) == [fitted]
    said = complaint(chosen_cards, bare)
    assert said.startswith(f"{bare.path}: --card: ") and str(fitted) in said and "--card" in said
    fitted.parent.mkdir(parents=True)
    filed(fitted.parent, "", "material.toml")
    assert list(chosen_cards(bare)) == ["material"]


def test_shipped_schema_is_that_of_sections():
    """If not: python docs/make_keys.py."""
    assert SHIPPED.read_text() == schema_text(with_plug_ins=False)
