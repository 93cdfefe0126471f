"""What a card keeps of how sure it is: round trips, bands, draws."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from bubblefit.materials.card import (
    CardCertainty,
    MaterialCard,
    certainty_of,
    read_card,
    words_of,
    write_card,
)
from bubblefit.materials.exports.base import BAND_COLUMNS
from bubblefit.materials.forms.registry import form_named
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.exports import FORMATS

from ..complaints import complaint

ENDS = [0.1, 0.12, 0.2]


def quadratic() -> HypoelasticLaw:
    """Moduli (MPa) that rise with the strain, positive up to the ends."""
    form = form_named("quadratic", {}, ENDS)
    beta = np.zeros(form.size)
    beta[list(form.free)] = [100, 20, 10, 900, 200, 190, 2000, 300, 330]
    return HypoelasticLaw(beta, 0.24, np.array(ENDS), form=form)


def drawn(law: HypoelasticLaw, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Draws of the coefficients, and the covariance that they are drawn from."""
    random = np.random.default_rng(3)
    root = np.diag(0.02 * law.beta[list(law.form.free)]) @ (
        np.eye(9) + 0.3 * random.standard_normal((9, 9))
    )
    free = law.beta[list(law.form.free)] + random.standard_normal((count, 9)) @ root.T
    return free, root @ root.T


def test_directions_are_the_covariance_of_the_draws() -> None:
    law = quadratic()
    free, true = drawn(law, 4000)
    sure = certainty_of(law, free)
    off = free - law.beta[list(law.form.free)]
    np.testing.assert_allclose(sure.covariance, off.T @ off / len(off), rtol=1e-6, atol=1e-9)
    scale = np.sqrt(np.diag(true))
    np.testing.assert_allclose(sure.covariance / scale / scale[:, None],
                               true / scale / scale[:, None], atol=0.08)  # fmt: skip
    strain = np.linspace(0, 0.1, 7)
    rows = law.modulus_rows("E1", strain)[:, list(law.form.free)]
    expected = np.std(off @ rows.T, axis=0)
    np.testing.assert_allclose(sure.sigma(law, "E1", strain), expected, rtol=0.01)
    low, high = sure.band(law, "E1", strain)
    np.testing.assert_allclose(high - law.E1(strain), 1.96 * expected, rtol=0.01)
    np.testing.assert_allclose(law.E1(strain) - low, 1.96 * expected, rtol=0.01)
    # The first direction moves the moduli by more than any other, each relative to itself.
    places = np.linspace(0, 0.1, 41)
    moved = [
        np.abs(law.modulus_rows("E1", places)[:, list(law.form.free)] @ d / law.E1(places)).max()
        for d in sure.directions
    ]
    assert max(moved) < 5 * moved[0] and len(moved) == 9


def test_drawn_laws_have_the_covariance_and_positive_moduli() -> None:
    law = quadratic()
    free, _ = drawn(law, 4000)
    sure = certainty_of(law, free)
    laws = sure.laws(law, 2000, np.random.default_rng(1))
    moduli = np.array([float(own.G12(0.2)) for own in laws])
    assert moduli.std() == pytest.approx(float(sure.sigma(law, "G12", [0.2])[0]), rel=0.05)
    assert moduli.mean() == pytest.approx(float(law.G12(0.2)), rel=0.005)
    # One that is as likely negative as not is drawn above zero only, and its band ends there.
    wide = CardCertainty(100 * sure.directions[:1])
    assert all((own.G12(np.linspace(0, 0.2, 41)) > 0).all()
               for own in wide.laws(law, 20, np.random.default_rng(1)))  # fmt: skip
    assert (wide.band(law, "G12", [0.0, 0.2])[0] == 0).all()


@pytest.mark.parametrize("unit", ["GPa", "MPa"])
def test_a_card_keeps_its_certainty(tmp_path: Path, unit: str) -> None:
    law = quadratic()
    words = words_of(["bubble 1", "strips"], 4321, mesh=True)
    card = MaterialCard(law, 0.8, "made", "", certainty_of(law, drawn(law, 50)[0], words))
    write_card(card, tmp_path / "card.toml", unit)
    content = tomllib.loads((tmp_path / "card.toml").read_text())
    assert content["format"] == 3
    assert content["certainty"]["of"] == (
        "noise of the data and error of the mesh; 4321 values of bubble 1, strips; the form of the "
        "law is taken for right"
    )
    again = read_card(tmp_path / "card.toml").certainty
    np.testing.assert_allclose(again.directions, card.certainty.directions, rtol=1e-14)
    assert again.words == words


def test_a_card_without_certainty_is_as_before(tmp_path: Path) -> None:
    write_card(MaterialCard(quadratic(), 0.8, "made"), tmp_path / "card.toml")
    assert tomllib.loads((tmp_path / "card.toml").read_text())["format"] == 2
    assert read_card(tmp_path / "card.toml").certainty is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("format = 3", "format = 2", "certainty: a card that has it is of format = 3"),
        ("1.0, 2.0", "1.0", r"certainty.directions\[0\]: expected 3 numbers, .* got 2"),
        ("1.0, 2.0", "1.0, nan", "certainty.directions"),
        ("directions", "direction", "certainty.direction"),
    ],
)
def test_a_certainty_that_is_none_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    law = HypoelasticLaw.linear(300.0, 200.0, 10.0)
    card = MaterialCard(law, 0.8, "made", "", CardCertainty(np.array([[0.5, 1.0, 2.0]])))
    path = tmp_path / "card.toml"
    write_card(card, path, "MPa")
    text = path.read_text().replace("1.0,\n        2.0", "1.0, 2.0")
    assert old in text, text
    path.write_text(text.replace(old, new))
    assert re.search(said, complaint(read_card, path))


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_every_export_has_the_band_beside_it(name: str) -> None:
    law = quadratic()
    directions = np.zeros((2, 9))
    directions[0, 8], directions[1, 2] = 10.0, 1.0
    sure = CardCertainty(directions, "noise of 100 values")
    export = FORMATS[name].export(MaterialCard(law, 0.8, "made", "", sure))
    head, columns, *rows = export.files[".band.csv"].splitlines()
    assert "noise of 100 values" in head and columns == BAND_COLUMNS
    values = [row.split(",") for row in rows]
    # E1 is 330 MPa at rest and 10 MPa uncertain everywhere, G12 10 and 1, E2 sure.
    first = {row[0]: [float(v) for v in row[1:]] for row in reversed(values)}
    assert first["E1"] == pytest.approx([0, 330, 330 - 19.6, 330 + 19.6])
    assert first["G12"] == pytest.approx([0, 10, 10 - 1.96, 10 + 1.96])
    assert first["E2"] == pytest.approx([0, 190, 190, 190])
    last = {row[0]: float(row[1]) for row in values}
    assert last == pytest.approx({"E1": 0.1, "E2": 0.12, "G12": 0.2})
    text = next(iter(export.files.values()))
    assert "E1, MPa: 310.4 to 349.6 at 0" in text
    plain = FORMATS[name].export(MaterialCard(law, 0.8, "made"))
    assert ".band.csv" not in plain.files
    assert "band of the moduli: not known" in next(iter(plain.files.values()))
