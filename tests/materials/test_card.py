"""materials/card.py: cards of a law, read and written, and the certainty they carry."""

import os
import re
import tempfile
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from bubblefit.errors import OutputError
from bubblefit.materials import card as card_module
from bubblefit.materials.card import (
    MODULUS_UNITS,
    CardCertainty,
    MaterialCard,
    certainty_of,
    read_card,
    thickness_difference,
    words_of,
    write_card,
)
from bubblefit.materials.forms.base import COMPONENTS, UNLIMITED, form_named
from bubblefit.materials.forms.polynomial import CONSTANT, LoadRatio
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ..support.refusals import complaint, refused
from .cases import EXPORTED_MEMORY, MEMORY_CARD, quadratic_law

GOOD = {
    "name": "Valmex 7318", "source": "a test", "unit": "GPa",
    "beta": [0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.8], "nu12": 0.24,
    "thickness_mm": 0.81, "thickness_change": "constant",
    "valid_strain": {"warp": [0.0, 0.13], "fill": [0.0, 0.12], "shear": [0.0, 0.11]},
}  # fmt: skip
# Not so near to zero that the change of unit itself would lose digits.
finite = st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-290)
words = st.text(st.characters(codec="utf-8"), max_size=30)
WIDTHS = {"constant": 1, "quadratic": 3, "cubic": 4}


@given(st.data())
@settings(max_examples=100, deadline=None)
def test_card_round_trip_in_any_unit(data):
    def numbers(shape, low=-1e9, high=1e9):
        return data.draw(arrays(float, shape, elements=finite if low < 0 else st.floats(low, high)))

    unit = data.draw(st.sampled_from(sorted(MODULUS_UNITS)))
    change = data.draw(st.sampled_from(["constant", "incompressible"]))
    rest = (data.draw(st.floats(0.0, 0.999)), numbers(3, 1e-3, 10.0), change)
    kind = data.draw(st.sampled_from([*WIDTHS, "trilinear", "spline", "load-ratio"]))
    if kind == "trilinear":
        breaks = np.cumsum(numbers((3, 2), 1e-6, 1.0), axis=1)
        law = HypoelasticLaw.trilinear(*numbers((3, 3)), breaks, *rest)
    elif kind == "spline":
        form = Spline.at([[0.0, 0.01, 0.03, 0.08, 0.2], [0.0, 0.1], [0.0, 0.05, 0.1, 0.4]])
        law = HypoelasticLaw(numbers(11), *rest, form)
    elif kind == "load-ratio":
        law = HypoelasticLaw(numbers(5), *rest, LoadRatio())
    else:
        beta = numbers((3, 4))
        beta[:, : 4 - WIDTHS[kind]] = 0.0
        law = HypoelasticLaw(beta.ravel(), *rest, form_named(kind, {}, [1.0] * 3))
    settings_of_card = data.draw(st.floats(1e-3, 1e3)), data.draw(words), data.draw(words)
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        # Of the digits of numbers of any size, also where no law is possible.
        patch.setattr(card_module, "check_positive", lambda law: None)
        card = MaterialCard(law, *settings_of_card)
        path = Path(folder) / "material.toml"
        write_card(card, path, unit)
        assert os.listdir(folder) == ["material.toml"]
        text, again = path.read_text(), read_card(path)
    assert f'form = "{kind}"' in text and ("breaks" in text) == (kind == "trilinear")
    assert again.law.form == law.form
    assert again.law.beta == pytest.approx(law.beta, rel=1e-14, abs=0.0)
    assert (again.law.strain_range == law.strain_range).all()
    assert (again.law.nu12, again.law.thickness_change) == (law.nu12, change)
    assert (again.thickness, again.name, again.source) == (card.thickness, card.name, card.source)


REGIONS = [0.0, 0.01, 0.01, 0.01, 0.0, 0.1, 0.1, 0.1, 0.0, 0.4, 0.6, 0.8]


def test_cards_of_format_1_are_still_read(tmp_path):
    path = tmp_path / "m.toml"
    law = "hypoelastic orthotropic; tangent moduli of log strain; Cauchy stress"
    for content, name in (({**GOOD, "law": law}, "cubic"), (NAMED, "cubic"), (SPLINE, "spline"),
                          ({**with_breaks(), "beta": REGIONS}, "trilinear")):  # fmt: skip
        path.write_text(tomli_w.dumps(content))
        assert read_card(path).law.form.name == name
    law = read_card(path).law
    assert law.form.breaks.tolist() == list(BREAKS.values())
    assert (law.E1(0.005), law.E1(0.02)) == (800.0, 600.0)


def test_thickness_difference_names_both_and_what_it_means():
    card = MaterialCard(HypoelasticLaw.linear(300, 200, 5), 0.8)
    for share in (0.0, 1e-12, 9e-7, -9e-7):
        assert thickness_difference(card, 0.8 * (1 + share)) is None
    for share, words in ((1.1e-6, "stiffer"), (-0.1, "10 % softer"), (3.05, "305 % stiffer")):
        said = thickness_difference(card, 0.8 * (1 + share))
        assert said.endswith(words) and "0.8 mm" in said and f"{0.8 * (1 + share):g} mm" in said


@pytest.mark.parametrize(("unit", "scale"), [("GPa", 1.0), ("MPa", 1e3), ("Pa", 1e9), (None, 1.0)])
def test_card_file_has_units_form_and_limits(tmp_path, unit, scale):
    law = HypoelasticLaw.linear(300.0, 200.0, 5.0, 0.2)
    card = MaterialCard(law, 0.81, "a fabric", "a test")
    card.write(tmp_path / "m.toml", *([unit] if unit else []))
    content = tomllib.loads((tmp_path / "m.toml").read_text())
    assert content.pop("beta") == pytest.approx(1e-3 * scale * law.beta)
    assert content == {
        "format": 2, "name": "a fabric", "source": "a test", "law": "hypoelastic orthotropic",
        "form": law.form.name, "unit": unit or "GPa", "nu12": 0.2,
        "thickness_mm": 0.81, "thickness_change": "constant", "valid_strain": {},
    }  # fmt: skip
    again = read_card(tmp_path / "m.toml").law
    assert again.form == CONSTANT and (again.strain_range == UNLIMITED).all()
    changed = {**GOOD, "unit": unit or "GPa", "beta": [scale * b for b in GOOD["beta"]]}
    (tmp_path / "m.toml").write_text(tomli_w.dumps(changed))
    law = read_card(tmp_path / "m.toml").law
    assert law.E1(0.05) == law.beta[11] == pytest.approx(800.0)
    assert law.strain_range == pytest.approx([0.13, 0.12, 0.11])


BREAKS = {"warp": [0.01, 0.03], "fill": [0.02, 0.06], "shear": [0.01, 0.04]}


def with_breaks(**change):
    kept = {name: pair for name, pair in {**BREAKS, **change}.items() if pair is not None}
    return {**GOOD, "breaks": kept}


def wrong_rows(table, **values):
    return [(table, row, value) for row, some in values.items() for value in some]


NAMED = {**GOOD, "format": 2, "form": "cubic", "law": "hypoelastic orthotropic"}
KNOTS = {"warp": [0.0, 0.05, 0.13], "fill": [0.0, 0.12], "shear": [0.0, 0.05, 0.11]}
SPLINE = {**NAMED, "form": "spline", "beta": [0.01] * 3 + [0.1] * 2 + [0.8] * 3, "knots": KNOTS}
INF, NAN = float("inf"), float("nan")
#: Values that a key must not have; of tables, the values of one of their rows.
WRONG = {
    "unit": ["psi", 3], "nu12": [1.2, -0.1, "0.24", NAN, True], "nu_12": [0.24], "thickness": [0.8],
    "beta": ["0.1", [], GOOD["beta"][:11], [*GOOD["beta"], 1.0],
             *([*GOOD["beta"][:11], v] for v in (NAN, INF, 1e308, 10**400, "0.8", True, [0.8]))],
    "thickness_mm": [0.0, -0.81, INF, 10**400, "thin", True], "thickness_change": ["some", 1],
    "name": [7], "source": [[1]], "valid_strain": [0.1], "law": [1], "breaks": [[0.01, 0.03]],
}  # fmt: skip
NAMED_WRONG = {"format": [5, "2"], "form": ["quintic", 3, ["cubic"]], "law": ["elastic", ["e"]],
               "breaks": [BREAKS]}  # fmt: skip
ROWS_WRONG = [
    *wrong_rows("valid_strain", weft=[[0.0, 0.1]], warp=[[0.0], [0.0, 0.0], [0.0, 0.1, 0.2]],
         fill=[[0.0, -0.1], [0.02, 0.1]], shear=[[0.0, NAN], 0.1]),
    *wrong_rows("breaks", weft=[[0.01, 0.02]], warp=[[0.03, 0.01], [0.03, 0.03]],
         fill=[None, 0.02, [0.02], [0.02, 0.04, 0.06], [0.02, "0.04"]],
         shear=[[0.0, 0.03], [-0.01, 0.03], [0.01, NAN], [0.01, INF], [10**300, 10**300 + 1]]),
    *wrong_rows("knots", weft=[[0.0, 1.0]], fill=[[0.01, 0.12], [0.0, 0.12, 0.12], [0.0, NAN]],
         shear=[None]),
]  # fmt: skip
BAD = [({**GOOD, key: value}, key) for key, values in WRONG.items() for value in values]


BAD += [({**NAMED, key: value}, key) for key, values in NAMED_WRONG.items() for value in values]


for table, row, value in ROWS_WRONG:
    card = {"valid_strain": GOOD, "breaks": with_breaks(), "knots": SPLINE}[table]
    rows = {k: v for k, v in {**card[table], row: value}.items() if v is not None}
    BAD.append(({**card, table: rows}, f"{table}.{row}"))


for card, key in (*((GOOD, key) for key in ("unit", "beta", "nu12", "thickness_mm")),
                  (NAMED, "form"), (SPLINE, "knots")):  # fmt: skip
    BAD.append(({k: v for k, v in card.items() if k != key}, key))


BAD += [
    ({**GOOD, "law": "hypoelastic orthotropic; tri-linear"}, "breaks"),
    ({**GOOD, "law": "tri-linear"}, "breaks"), ({**GOOD, "breaks": {}}, "breaks.warp"),
    ({**with_breaks(), "beta": [0.1, *GOOD["beta"][1:]]}, "beta"),
    ({**GOOD, "form": "cubic"}, "format"), ({**GOOD, "format": 1, "form": "cubic"}, "format"),
    ({**GOOD, "format": 2}, "form"), ({**NAMED, "law": "x"}, "law"),
    ({**NAMED, "form": "trilinear"}, "breaks"),
    ({**NAMED, "form": "constant", "beta": [*GOOD["beta"][:10], 0.1, 0.8]}, "beta"),
    ({**SPLINE, "beta": GOOD["beta"]}, "beta"), ({**SPLINE, "breaks": BREAKS}, "breaks"),
    ({**SPLINE, "knots": 4}, "knots"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "field"), BAD)
def test_bad_card_names_file_and_field(tmp_path, content, field):
    path = tmp_path / "material.toml"
    path.write_text(tomli_w.dumps(content))
    caught = refused(read_card, path)
    assert str(caught).startswith(f"{path}: {field}") and "\n" not in str(caught)
    assert caught.field.partition("[")[0] == field


@pytest.mark.parametrize(
    "content",
    [
        b"", b"unit = ", b"\xff\xfe\x00", b"beta = [1, 2", b"a = 1\na = 2",
        b"x = " + b"[" * 100_000, b"nu12 = " + b"9" * 5000, b"when = 2000-13-45",
    ],
)  # fmt: skip
def test_file_that_is_no_card_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "material.toml"
    path.write_bytes(content)
    assert str(path) in complaint(read_card, path)


def test_missing_card_and_folder_are_refused(tmp_path):
    assert "cannot be read" in complaint(read_card, tmp_path / "none.toml")
    assert "is a folder; name a file" in complaint(read_card, tmp_path)


def drawn_moduli(law, count):
    random, free = np.random.default_rng(3), law.beta[list(law.form.free)]
    root = np.diag(0.02 * free) @ (np.eye(9) + 0.3 * random.standard_normal((9, 9)))
    return free + random.standard_normal((count, 9)) @ root.T, root @ root.T


def test_certainty_directions_have_covariance_of_the_draws():
    law, free = quadratic_law(), list(quadratic_law().form.free)
    draws, true = drawn_moduli(law, 4000)
    sure, off = certainty_of(law, draws), draws - law.beta[free]
    np.testing.assert_allclose(sure.covariance, off.T @ off / len(off), rtol=1e-6, atol=1e-9)
    scale = np.sqrt(np.outer(np.diag(true), np.diag(true)))
    np.testing.assert_allclose(sure.covariance / scale, true / scale, atol=0.08)
    strain = np.linspace(0, 0.1, 7)
    expected = np.std(off @ law.modulus_rows("E1", strain)[:, free].T, axis=0)
    np.testing.assert_allclose(sure.sigma(law, "E1", strain), expected, rtol=0.01)
    for sign, edge in zip((-1, 1), sure.band(law, "E1", strain), strict=True):
        np.testing.assert_allclose(sign * (edge - law.E1(strain)), 1.96 * expected, rtol=0.01)
    places = np.linspace(0, 0.1, 41)
    rows = law.modulus_rows("E1", places)[:, free] / law.E1(places)[:, None]
    moved = np.abs(rows @ sure.directions.T).max(axis=0)
    assert max(moved) < 5 * moved[0] and len(moved) == 9


def test_drawn_laws_have_the_covariance_and_positive_moduli():
    law, random = quadratic_law(), np.random.default_rng(1)
    sure = certainty_of(law, drawn_moduli(law, 4000)[0])
    moduli = np.array([float(own.G12(0.2)) for own in sure.laws(law, 2000, random)])
    assert moduli.std() == pytest.approx(float(sure.sigma(law, "G12", [0.2])[0]), rel=0.05)
    assert moduli.mean() == pytest.approx(float(law.G12(0.2)), rel=0.005)
    # One that is as likely negative as not is drawn above zero only, and its band ends there.
    wide = CardCertainty(100 * sure.directions[:1])
    laws = wide.laws(law, 20, np.random.default_rng(1))
    assert all((own.G12(np.linspace(0, 0.2, 41)) > 0).all() for own in laws)
    assert (wide.band(law, "G12", [0.0, 0.2])[0] == 0).all()


@pytest.mark.parametrize("unit", ["GPa", "MPa"])
def test_card_keeps_its_certainty(tmp_path, unit):
    law, path = quadratic_law(), tmp_path / "card.toml"
    words = words_of(["bubble 1", "strips"], 4321, mesh=True)
    bands = {n: np.array([[0, 0.1], [3, 4], [500, 900]]) for n in COMPONENTS}
    sure = certainty_of(law, drawn_moduli(law, 50)[0], words, bands)
    card = MaterialCard(law, 0.8, "made", "", sure)
    write_card(card, path, unit)
    content = tomllib.loads(path.read_text())
    assert content["format"] == 3
    said = "noise of the data and error of the mesh; 4321 values of bubble 1, strips; the form of"
    assert content["certainty"]["of"].startswith(said)
    again = read_card(path).certainty
    np.testing.assert_allclose(again.directions, card.certainty.directions, rtol=1e-14)
    assert again.words == words
    # The fit's own ends, between its strains; the law's own modulus is never outside.
    assert np.ravel(again.band(law, "E1", [0.05])) == pytest.approx([3.5, 700])
    stiff = law.with_beta(1e3 * law.beta)
    assert float(again.band(stiff, "E1", [0.05])[1][0]) == float(stiff.E1(0.05))
    write_card(MaterialCard(law, 0.8, "made"), path)
    assert tomllib.loads(path.read_text())["format"] == 2 and read_card(path).certainty is None


@pytest.mark.parametrize("unit", ["GPa", "MPa"])
def test_card_keeps_draws_where_a_band_is_no_normal_one(tmp_path, unit):
    """G12 anywhere between its bounds, E1 * E2 known: normal laws would leave the bounds."""
    law, path = HypoelasticLaw.linear(400.0, 400.0, 30.0), tmp_path / "card.toml"
    random = np.random.default_rng(0)
    ratio, shear = np.exp(random.uniform(-1.0, 1.0, 1000)), random.uniform(1.0, 300.0, 1000)
    draws = np.column_stack([shear, 400.0 / ratio, 400.0 * ratio])
    bands = {
        name: np.array([[0.0], *np.quantile(values, [[0.025], [0.975]])])
        for name, values in zip(("G12", "E2", "E1"), draws.T, strict=True)
    }
    write_card(MaterialCard(law, 0.8, "open", "", certainty_of(law, draws, "", bands)), path, unit)
    sure = read_card(path).certainty
    assert sure.draws.shape == (200, 3)
    laws = sure.laws(law, 100, np.random.default_rng(1))
    products = [float(drawn.E1(0.0) * drawn.E2(0.0)) for drawn in laws]
    np.testing.assert_allclose(products, 400.0**2, rtol=1e-5)
    assert all(1.0 < float(drawn.G12(0.0)) < 300.0 for drawn in laws)
    assert len(sure.laws(law, 300, np.random.default_rng(1))) == 300
    # Directions alone would draw G12 below zero, and any product.
    text = path.read_text()
    path.write_text(text.replace("beta = [[", "beta = [[1.0], ["))
    assert "certainty.laws.beta[0]: expected 3 numbers" in complaint(read_card, path)
    # Normal draws need none.
    normal = 400.0 + random.standard_normal((1000, 3)) * [1.0, 10.0, 20.0]
    law = HypoelasticLaw.linear(400.0, 400.0, 400.0)
    bands = {
        name: np.array([[0.0], *np.quantile(values, [[0.025], [0.975]])])
        for name, values in zip(("G12", "E2", "E1"), normal.T, strict=True)
    }
    assert certainty_of(law, normal, "", bands).draws is None


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("format = 3", "format = 2", "certainty: "),
        ("1.0, 2.0", "1.0", r"certainty.directions\[0\]: expected 3 numbers, .* got 2"),
        ("1.0, 2.0", "1.0, nan", "certainty.directions"),
        ("directions", "direction", "certainty.direction"),
        ("E1 = [[0.0, 0.1]", "E1 = [[0.1, 0.0]", "certainty.band.E1: expected rising strains"),
        ("[3.0, 4.0], [500", "[3.0], [500", "certainty.band.E1: expected .* as many of each"),
    ],
)
def test_damaged_certainty_is_refused(tmp_path, old, new, field):
    law, path = HypoelasticLaw.linear(300.0, 200.0, 10.0), tmp_path / "card.toml"
    bands = {n: np.array([[0, 0.1], [3, 4], [500, 900]]) for n in COMPONENTS}
    sure = CardCertainty(np.array([[0.5, 1.0, 2.0]]), "", bands)
    write_card(MaterialCard(law, 0.8, "made", "", sure), path, "MPa")
    text = path.read_text().replace("1.0,\n        2.0", "1.0, 2.0")
    assert old in text, text
    path.write_text(text.replace(old, new))
    assert re.search(field, complaint(read_card, path))


def test_card_keeps_memory_and_state(tmp_path):
    path = tmp_path / "card.toml"
    MEMORY_CARD.write(path)
    card = read_card(path)
    assert (card.law.memory, card.state) == (EXPORTED_MEMORY, "first loading")
    text = path.read_text()
    for old, new, field in (
        ("format = 4", "format = 3", "memory"), ('"first loading"', '"tenth"', "state"),
        ("0.4,", "1.4,", "memory.permanent_set"),
    ):  # fmt: skip
        path.write_text(text.replace(old, new))
        assert refused(read_card, path).field == field


def test_card_replaces_a_file_only_if_told(tmp_path):
    card = MaterialCard(HypoelasticLaw.linear(400.0, 250.0, 12.0), 0.8)
    path = tmp_path / "card.toml"
    card.write(path)
    with pytest.raises(OutputError, match="exists already; overwrite=True replaces it"):
        card.write(path)
    card.write(path, unit="MPa", overwrite=True)
    assert 'unit = "MPa"' in path.read_text()


def test_card_is_exported_to_files_of_the_name_of_the_format(tmp_path):
    card = MaterialCard(quadratic_law(), 0.8, "plain")
    (path,) = card.export("constants", tmp_path)
    assert path.parent == tmp_path and path.stem == "material-constants"
    with pytest.raises(OutputError, match="material-constants"):
        card.export("constants", tmp_path)
    assert card.export("constants", tmp_path, overwrite=True) == [path]
    assert "expected one of marc, " in complaint(card.export, "nastran", tmp_path)


def test_band_is_two_sigma_of_the_coefficients_and_not_below_zero():
    law = HypoelasticLaw.linear(400.0, 250.0, 12.0)
    certainty = CardCertainty(np.array([[8.0, 0.0, 30.0], [0.0, 0.0, 40.0]]))
    for name, value, sigma in (("E1", 400.0, 50.0), ("E2", 250.0, 0.0), ("G12", 12.0, 8.0)):
        lower, upper = certainty.band(law, name, [0.0, 0.1])
        assert upper == pytest.approx([value + card_module.BAND * sigma] * 2)
        assert lower == pytest.approx([max(value - card_module.BAND * sigma, 0.0)] * 2)


def test_modulus_of_card_without_certainty_has_no_band():
    card = MaterialCard(HypoelasticLaw.linear(400.0, 250.0, 12.0), 0.8, "plain")
    modulus = card.modulus("E2", [0.0, 0.1])
    assert modulus.value.tolist() == [250.0, 250.0]
    assert np.isnan(modulus.lower).all() and np.isnan(modulus.upper).all()
    assert str(card.modulus("E1", 0.02)) == "400 MPa at 2 % strain (band not known)"
    assert repr(card).splitlines() == [
        "MaterialCard 'plain': constant law, 0.8 mm, nu12 0.24",
        "  E1 400 MPa; E2 250 MPa; G12 12 MPa",
        "  no bands",
    ]
