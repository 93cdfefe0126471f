"""Material cards and the certainty they carry."""

import os
import re
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from bubblefit.errors import InputError
from bubblefit.materials.card import (
    UNITS,
    CardCertainty,
    MaterialCard,
    certainty_of,
    read_card,
    thickness_difference,
    words_of,
    write_card,
)
from bubblefit.materials.exports.base import BAND_COLUMNS
from bubblefit.materials.forms.base import UNLIMITED, form_named
from bubblefit.materials.forms.polynomial import CONSTANT, CUBIC
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.registry import FORMATS
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ..complaints import complaint

GOOD: dict[str, Any] = {
    "name": "Valmex 7318", "source": "a test", "unit": "GPa",
    "beta": [0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.8], "nu12": 0.24,
    "thickness_mm": 0.81, "thickness_change": "constant",
    "valid_strain": {"warp": [0.0, 0.13], "fill": [0.0, 0.12], "shear": [0.0, 0.11]},
}  # fmt: skip

# Not so near to zero that the change of unit itself would lose digits.
finite = st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-290)
words = st.text(st.characters(codec="utf-8"), max_size=30)


@given(
    beta=arrays(float, 12, elements=finite),
    nu12=st.floats(0.0, 0.999),
    ends=arrays(float, 3, elements=st.floats(1e-3, 10.0)),
    thickness=st.floats(1e-3, 1e3),
    change=st.sampled_from(["constant", "incompressible"]),
    unit=st.sampled_from(sorted(UNITS)),
    name=words,
    source=words,
)
@settings(max_examples=60, deadline=None)
def test_round_trip_in_every_unit(beta, nu12, ends, thickness, change, unit, name, source):
    card = MaterialCard(HypoelasticLaw(beta, nu12, ends, change), thickness, name, source)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "material.toml"
        write_card(card, path, unit)
        assert os.listdir(folder) == ["material.toml"]
        again = read_card(path)
    assert again.law.beta == pytest.approx(beta, rel=1e-14, abs=0.0)
    assert (again.law.strain_range == ends).all()
    assert (again.law.nu12, again.law.thickness_change) == (nu12, change)
    assert (again.thickness, again.name, again.source) == (thickness, name, source)


pairs = arrays(float, (3, 2), elements=st.floats(1e-6, 1.0))


@given(
    moduli=arrays(float, (3, 3), elements=finite),
    breaks=pairs.map(lambda b: np.sort(b, axis=1)).filter(lambda b: (b[:, 0] < b[:, 1]).all()),
    ends=arrays(float, 3, elements=st.floats(1e-3, 10.0)),
    change=st.sampled_from(["constant", "incompressible"]),
    unit=st.sampled_from(sorted(UNITS)),
)
@settings(max_examples=60, deadline=None)
def test_a_trilinear_card_goes_round_in_every_unit(moduli, breaks, ends, change, unit):
    law = HypoelasticLaw.trilinear(*moduli, breaks, 0.3, ends, change)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "material.toml"
        write_card(MaterialCard(law, 0.81), path, unit)
        text, again = path.read_text(), read_card(path).law
    assert "Tri-linear" in text and 'form = "trilinear"' in text and "breaks" in text
    assert again.form.name == "trilinear"
    assert (again.form.breaks == breaks).all() and (again.strain_range == ends).all()
    assert again.beta == pytest.approx(law.beta, rel=1e-14, abs=0.0)
    assert (again.nu12, again.thickness_change) == (0.3, change)


def test_a_polynomial_card_has_no_breaks(tmp_path):
    write_card(MaterialCard(HypoelasticLaw.linear(300, 200, 5), 0.81), tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text()
    assert "breaks" not in text and "tri-linear" not in text.lower()
    law = read_card(tmp_path / "m.toml").law
    assert law.form == CONSTANT and (law.strain_range == UNLIMITED).all()


def test_a_card_of_any_form_comes_back(tmp_path):
    knots = [[0.0, 0.01, 0.03, 0.08, 0.2], [0.0, 0.1], [0.0, 0.05, 0.1, 0.4]]
    beta = np.arange(1.0, 12.0)
    law = HypoelasticLaw(beta, 0.3, [0.1, 0.2, 0.4], "incompressible", Spline.at(knots))
    MaterialCard(law, 0.81, "a", "b").write(tmp_path / "m.toml", "MPa")
    again = read_card(tmp_path / "m.toml").law
    assert again.form == law.form and (again.beta == beta).all()
    assert (again.pieces == law.pieces).all() and again.thickness_change == "incompressible"
    for form in (CONSTANT, CUBIC):
        law = HypoelasticLaw(np.array([0, 0, 0, 1.0] * 3), form=form)
        MaterialCard(law, 0.81).write(tmp_path / "m.toml")
        assert read_card(tmp_path / "m.toml").law.form == form


def test_cards_of_format_1_are_still_read(tmp_path):
    text = "hypoelastic orthotropic; tangent moduli of log strain; Cauchy stress"
    (tmp_path / "m.toml").write_text(tomli_w.dumps({**GOOD, "law": text}))
    assert read_card(tmp_path / "m.toml").law.form == CUBIC
    for good in (NAMED, SPLINE):
        (tmp_path / "m.toml").write_text(tomli_w.dumps(good))
        assert read_card(tmp_path / "m.toml").law.form.name == good["form"]
    (tmp_path / "m.toml").write_text(tomli_w.dumps(with_breaks()))
    law = read_card(tmp_path / "m.toml").law
    assert law.form.name == "trilinear" and law.form.breaks.tolist() == list(BREAKS.values())
    assert (law.E1(0.005), law.E1(0.02)) == (800.0, 0.0)


def test_another_thickness_is_said():
    card = MaterialCard(HypoelasticLaw.linear(300, 200, 5), 0.8)
    for share in (0.0, 1e-12, 9e-7, -9e-7):
        assert thickness_difference(card, 0.8 * (1 + share)) is None
    for share, words in ((1.1e-6, "stiffer"), (-0.1, "softer"), (0.25, "25 % stiffer")):
        assert (thickness_difference(card, 0.8 * (1 + share)) or "").endswith(words)
    said = thickness_difference(card, 0.72)
    assert said is not None and "0.8 mm" in said and "0.72 mm" in said and "10 % softer" in said


def test_what_a_card_file_says(tmp_path):
    law = HypoelasticLaw.linear(300.0, 200.0, 5.0, 0.2)
    MaterialCard(law, 0.81, "a fabric", "a test").write(tmp_path / "m.toml", "MPa")
    content = tomllib.loads((tmp_path / "m.toml").read_text())
    assert content == {
        "format": 2, "name": "a fabric", "source": "a test", "law": "hypoelastic orthotropic",
        "form": law.form.name, "unit": "MPa", "beta": law.beta.tolist(), "nu12": 0.2,
        "thickness_mm": 0.81, "thickness_change": "constant", "valid_strain": {},
    }  # fmt: skip


def test_units_name_the_same_material(tmp_path):
    for unit, scale in (("GPa", 1.0), ("MPa", 1e3), ("Pa", 1e9)):
        card = {**GOOD, "unit": unit, "beta": [scale * b for b in GOOD["beta"]]}
        (tmp_path / "m.toml").write_text(tomli_w.dumps(card))
        law = read_card(tmp_path / "m.toml").law
        assert law.E1(0.05) == law.beta[11] == pytest.approx(800.0)
        assert law.strain_range == pytest.approx([0.13, 0.12, 0.11])


BREAKS = {"warp": [0.01, 0.03], "fill": [0.02, 0.06], "shear": [0.01, 0.04]}


def with_breaks(**change: Any) -> dict[str, Any]:
    kept = {name: pair for name, pair in {**BREAKS, **change}.items() if pair is not None}
    return {**GOOD, "breaks": kept}


def one(table: str, **values: Any) -> list[tuple[str, str, Any]]:
    """Values of a table's rows, each wrong."""
    return [(table, row, value) for row, some in values.items() for value in some]


NAMED = {**GOOD, "format": 2, "form": "cubic", "law": "hypoelastic orthotropic"}
KNOTS = {"warp": [0.0, 0.05, 0.13], "fill": [0.0, 0.12], "shear": [0.0, 0.05, 0.11]}
SPLINE = {**NAMED, "form": "spline", "beta": [0.01] * 3 + [0.1] * 2 + [0.8] * 3, "knots": KNOTS}
INF, NAN = float("inf"), float("nan")
#: Values that a key must not have; of tables, the values of one of their rows.
WRONG: dict[str, list[Any]] = {
    "unit": ["psi", 3], "nu12": [1.2, -0.1, "0.24", NAN, True], "nu_12": [0.24], "thickness": [0.8],
    "beta": ["0.1", [], GOOD["beta"][:11], [*GOOD["beta"], 1.0],
             *([*GOOD["beta"][:11], v] for v in (NAN, INF, 1e308, 10**400, "0.8", True, [0.8]))],
    "thickness_mm": [0.0, -0.81, INF, 10**400, "thin", True], "thickness_change": ["some", 1],
    "name": [7], "source": [[1]], "valid_strain": [0.1], "law": [1], "breaks": [[0.01, 0.03]],
}  # fmt: skip
NAMED_WRONG = {"format": [4, "2"], "form": ["quintic", 3, ["cubic"]], "law": ["elastic", ["e"]],
               "breaks": [BREAKS]}  # fmt: skip
ROWS_WRONG = [
    *one("valid_strain", weft=[[0.0, 0.1]], warp=[[0.0], [0.0, 0.0], [0.0, 0.1, 0.2]],
         fill=[[0.0, -0.1], [0.02, 0.1]], shear=[[0.0, NAN], 0.1]),
    *one("breaks", weft=[[0.01, 0.02]], warp=[[0.03, 0.01], [0.03, 0.03]],
         fill=[None, 0.02, [0.02], [0.02, 0.04, 0.06], [0.02, "0.04"]],
         shear=[[0.0, 0.03], [-0.01, 0.03], [0.01, NAN], [0.01, INF], [10**300, 10**300 + 1]]),
    *one("knots", weft=[[0.0, 1.0]], fill=[[0.01, 0.12], [0.0, 0.12, 0.12], [0.0, NAN]],
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
def test_a_bad_card_names_file_and_field(tmp_path, content, field):
    path = tmp_path / "material.toml"
    path.write_text(tomli_w.dumps(content))
    with pytest.raises(InputError) as caught:
        read_card(path)
    assert str(caught.value).startswith(f"{path}: {field}: ") and "\n" not in str(caught.value)
    assert caught.value.field == field


@pytest.mark.parametrize(
    "content",
    [
        b"", b"unit = ", b"\xff\xfe\x00", b"beta = [1, 2", b"a = 1\na = 2",
        b"x = " + b"[" * 100_000, b"nu12 = " + b"9" * 5000, b"when = 2000-13-45",
    ],
)  # fmt: skip
def test_what_is_not_a_card_is_said_in_one_line(tmp_path, content):
    path = tmp_path / "material.toml"
    path.write_bytes(content)
    assert str(path) in complaint(read_card, path)
    for unreadable in (tmp_path / "none.toml", tmp_path):
        assert "cannot be read" in complaint(read_card, unreadable)


def read_bytes(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "material.toml"
        path.write_bytes(content)
        try:
            read_card(path)
        except InputError as error:
            assert str(path) in str(error)


@given(st.binary(max_size=200))
@settings(max_examples=200, deadline=None)
def test_garbage_gives_no_other_exception(content):
    read_bytes(content)


values = st.recursive(
    st.one_of(
        st.booleans(), st.integers(), st.floats(), st.text(st.characters(codec="utf-8")),
        st.dates(), st.integers(10**300, 10**310),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=13),
        st.dictionaries(st.sampled_from(["warp", "fill", "shear", "x"]), inner, max_size=3),
    ),
    max_leaves=14,
)  # fmt: skip


@given(st.sampled_from([*sorted(GOOD), "law", "breaks", "format", "form", "knots"]), values)
@settings(max_examples=200, deadline=None)
def test_any_value_at_any_key_is_read_or_refused(key, value):
    for good in (GOOD, NAMED, SPLINE):
        read_bytes(tomli_w.dumps({**good, key: value}).encode())


@given(st.integers(0, 2000), st.binary(min_size=1, max_size=4))
@settings(max_examples=200, deadline=None)
def test_a_damaged_good_card_is_read_or_refused(where, damage):
    content = tomli_w.dumps(GOOD).encode()
    where %= len(content)
    read_bytes(content[:where] + damage + content[where + len(damage) :])


def test_a_card_is_in_gpa_unless_told_otherwise(tmp_path):
    card = MaterialCard(HypoelasticLaw.linear(500.0, 200.0, 20.0), 0.8)
    write_card(card, tmp_path / "a.toml")
    card.write(tmp_path / "b.toml")
    card.write(tmp_path / "c.toml", "MPa")
    for name, unit, e1 in (("a", "GPa", 0.5), ("b", "GPa", 0.5), ("c", "MPa", 500.0)):
        said = tomllib.loads((tmp_path / f"{name}.toml").read_text())
        assert (said["unit"], said["beta"][11]) == (unit, pytest.approx(e1))


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


def test_directions_are_the_covariance_of_the_draws():
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


def test_drawn_laws_have_the_covariance_and_positive_moduli():
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
def test_a_card_keeps_its_certainty(tmp_path, unit):
    law = quadratic()
    words = words_of(["bubble 1", "strips"], 4321, mesh=True)
    card = MaterialCard(law, 0.8, "made", "", certainty_of(law, drawn(law, 50)[0], words))
    write_card(card, tmp_path / "card.toml", unit)
    content = tomllib.loads((tmp_path / "card.toml").read_text())
    assert content["format"] == 3
    said = "noise of the data and error of the mesh; 4321 values of bubble 1, strips; the form of"
    assert content["certainty"]["of"].startswith(said)
    again = read_card(tmp_path / "card.toml").certainty
    np.testing.assert_allclose(again.directions, card.certainty.directions, rtol=1e-14)
    assert again.words == words
    # Without certainty a card is as before.
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
def test_a_certainty_that_is_none_is_refused(tmp_path, old, new, said):
    law = HypoelasticLaw.linear(300.0, 200.0, 10.0)
    card = MaterialCard(law, 0.8, "made", "", CardCertainty(np.array([[0.5, 1.0, 2.0]])))
    path = tmp_path / "card.toml"
    write_card(card, path, "MPa")
    text = path.read_text().replace("1.0,\n        2.0", "1.0, 2.0")
    assert old in text, text
    path.write_text(text.replace(old, new))
    assert re.search(said, complaint(read_card, path))


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_every_export_has_the_band_beside_it(name):
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
