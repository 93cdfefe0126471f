"""material.toml: round trips, and every way in which a card can be wrong."""

from __future__ import annotations

import os
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
    MaterialCard,
    read_card,
    thickness_difference,
    write_card,
)
from bubblefit.materials.forms.base import UNLIMITED
from bubblefit.materials.forms.polynomial import CONSTANT, CUBIC
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

GOOD: dict[str, Any] = {
    "name": "Valmex 7318",
    "source": "a test",
    "unit": "GPa",
    "beta": [0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.8],
    "nu12": 0.24,
    "thickness_mm": 0.81,
    "thickness_change": "constant",
    "valid_strain": {"warp": [0.0, 0.13], "fill": [0.0, 0.12], "shear": [0.0, 0.11]},
}

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
def test_round_trip_in_every_unit(
    beta: np.ndarray,
    nu12: float,
    ends: np.ndarray,
    thickness: float,
    change: Any,
    unit: str,
    name: str,
    source: str,
) -> None:
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
def test_a_trilinear_card_goes_round_in_every_unit(
    moduli: np.ndarray, breaks: np.ndarray, ends: np.ndarray, change: Any, unit: str
) -> None:
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


def test_a_polynomial_card_has_no_breaks(tmp_path: Path) -> None:
    write_card(MaterialCard(HypoelasticLaw.linear(300, 200, 5), 0.81), tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text()
    assert "breaks" not in text and "tri-linear" not in text.lower()
    assert read_card(tmp_path / "m.toml").law.form == CONSTANT


def test_an_unlimited_range_stays_unlimited(tmp_path: Path) -> None:
    write_card(MaterialCard(HypoelasticLaw.linear(300, 200, 5), 0.81), tmp_path / "m.toml")
    assert (read_card(tmp_path / "m.toml").law.strain_range == UNLIMITED).all()


def test_a_card_of_any_form_comes_back(tmp_path: Path) -> None:
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


def test_cards_of_format_1_are_still_read(tmp_path: Path) -> None:
    """As bubblefit wrote them before forms had names."""
    text = "hypoelastic orthotropic; tangent moduli of log strain; Cauchy stress"
    (tmp_path / "m.toml").write_text(tomli_w.dumps({**GOOD, "law": text}))
    assert read_card(tmp_path / "m.toml").law.form == CUBIC
    for good in (NAMED, SPLINE):
        (tmp_path / "m.toml").write_text(tomli_w.dumps(good))
        assert read_card(tmp_path / "m.toml").law.form.name == good["form"]


def test_another_thickness_is_said() -> None:
    card = MaterialCard(HypoelasticLaw.linear(300, 200, 5), 0.81)
    assert thickness_difference(card, 0.81) is None
    assert thickness_difference(card, 0.81 * (1 + 1e-12)) is None
    thick, thin = thickness_difference(card, 0.9), thickness_difference(card, 0.72)
    assert thick is not None and thin is not None
    assert "0.81 mm" in thick and "0.9 mm" in thick and "11 % stiffer" in thick
    assert "11 % softer" in thin


@pytest.mark.parametrize(("share", "words"), [(9e-7, None), (-9e-7, None), (1.1e-6, "stiffer")])
def test_a_millionth_of_the_thickness_is_none(share: float, words: str | None) -> None:
    card = MaterialCard(HypoelasticLaw.linear(300, 200, 5), 0.8)
    found = thickness_difference(card, 0.8 * (1 + share))
    assert (found is None) if words is None else (found or "").endswith(words)
    assert thickness_difference(card, 1.0) == (
        "the card was fitted for a thickness of 0.8 mm, this is 1 mm: with the card's moduli the "
        "fabric is 25 % stiffer"
    )


def test_what_a_card_file_says(tmp_path: Path) -> None:
    law = HypoelasticLaw.linear(300.0, 200.0, 5.0, 0.2)
    MaterialCard(law, 0.81, "a fabric", "a test").write(tmp_path / "m.toml", "MPa")
    content = tomllib.loads((tmp_path / "m.toml").read_text())
    assert content == {
        "format": 2, "name": "a fabric", "source": "a test", "law": "hypoelastic orthotropic",
        "form": law.form.name, "unit": "MPa", "beta": law.beta.tolist(), "nu12": 0.2,
        "thickness_mm": 0.81, "thickness_change": "constant", "valid_strain": {},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"beta": [*GOOD["beta"], 1.0]}, "beta: expected 12 coefficients, got 13"),
        ({"beta": "x"}, "beta: expected a list of finite numbers, got 'x'"),
        ({"beta": [*GOOD["beta"][:11], 1e308]}, "beta: 1e+308 GPa is too large a coefficient"),
        ({"thickness_mm": 0.0}, "thickness_mm: expected a number > 0, got 0.0"),
        ({"thickness_mm": True}, "thickness_mm: expected a number > 0, got True"),
        ({"valid_strain": {"warp": [0.0, 0.0]}}, "valid_strain.warp: expected [0, end], got [0.0, "
         "0.0]"),
        ({"valid_strain": {"warp": [0.0, 0.1, 0.2]}}, "valid_strain.warp: expected [0, end], got "
         "[0.0, 0.1, 0.2]"),
        ({"unit": "psi"}, "unit: expected 'GPa', 'MPa' or 'Pa', got 'psi'"),
        ({"format": 1, "form": "cubic"}, "format: this key is missing; a card that names its form "
         "is of format = 2"),
        ({"format": 2}, "form: this key is missing; add it"),
        ({"format": 2, "form": "cubic", "law": "x"}, "law: expected 'hypoelastic orthotropic', got "
         "'x'"),
        ({"format": 2, "form": 3}, "form: expected the name of a form, got 3"),
        ({"law": "tri-linear"}, "breaks: this key is missing; `law` says tri-linear"),
    ],
)  # fmt: skip
def test_the_whole_line_about_a_card(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    path = tmp_path / "material.toml"
    path.write_text(tomli_w.dumps({**GOOD, **change}))
    with pytest.raises(InputError) as caught:
        read_card(path)
    assert str(caught.value) == f"{path}: {words}"


def test_units_name_the_same_material(tmp_path: Path) -> None:
    for unit, scale in (("GPa", 1.0), ("MPa", 1e3), ("Pa", 1e9)):
        card = {**GOOD, "unit": unit, "beta": [scale * b for b in GOOD["beta"]]}
        (tmp_path / "m.toml").write_text(tomli_w.dumps(card))
        assert read_card(tmp_path / "m.toml").law.E1(0.05) == pytest.approx(800.0)


def test_the_good_card_is_good(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(tomli_w.dumps(GOOD))
    card = read_card(tmp_path / "m.toml")
    assert card.law.strain_range == pytest.approx([0.13, 0.12, 0.11])
    assert card.law.beta[11] == pytest.approx(800.0)


def test_a_good_trilinear_card(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(tomli_w.dumps(with_breaks()))
    law = read_card(tmp_path / "m.toml").law
    assert law.form.name == "trilinear" and law.form.breaks.tolist() == list(BREAKS.values())
    assert (law.E1(0.005), law.E1(0.02)) == (800.0, 0.0)


def without(key: str) -> dict[str, Any]:
    return {k: v for k, v in GOOD.items() if k != key}


def with_coefficient(value: Any) -> dict[str, Any]:
    return {**GOOD, "beta": [*GOOD["beta"][:11], value]}


BREAKS = {"warp": [0.01, 0.03], "fill": [0.02, 0.06], "shear": [0.01, 0.04]}


def with_breaks(**change: Any) -> dict[str, Any]:
    kept = {name: pair for name, pair in {**BREAKS, **change}.items() if pair is not None}
    return {**GOOD, "breaks": kept}


BAD = [
    (without("unit"), "unit"),
    (without("beta"), "beta"),
    (without("nu12"), "nu12"),
    (without("thickness_mm"), "thickness_mm"),
    ({**GOOD, "unit": "psi"}, "unit"),
    ({**GOOD, "unit": 3}, "unit"),
    ({**GOOD, "beta": GOOD["beta"][:11]}, "beta"),
    ({**GOOD, "beta": [*GOOD["beta"], 1.0]}, "beta"),
    ({**GOOD, "beta": "0.1"}, "beta"),
    ({**GOOD, "beta": []}, "beta"),
    (with_coefficient(float("nan")), "beta"),
    (with_coefficient(float("inf")), "beta"),
    (with_coefficient(1e308), "beta"),
    (with_coefficient(10**400), "beta"),
    (with_coefficient("0.8"), "beta"),
    (with_coefficient(True), "beta"),
    (with_coefficient([0.8]), "beta"),
    ({**GOOD, "nu_12": 0.24}, "nu_12"),
    ({**GOOD, "thickness": 0.81}, "thickness"),
    ({**GOOD, "valid_strain": {"weft": [0.0, 0.1]}}, "valid_strain.weft"),
    ({**GOOD, "nu12": 1.2}, "nu12"),
    ({**GOOD, "nu12": -0.1}, "nu12"),
    ({**GOOD, "nu12": "0.24"}, "nu12"),
    ({**GOOD, "nu12": float("nan")}, "nu12"),
    ({**GOOD, "nu12": True}, "nu12"),
    ({**GOOD, "thickness_mm": 0.0}, "thickness_mm"),
    ({**GOOD, "thickness_mm": -0.81}, "thickness_mm"),
    ({**GOOD, "thickness_mm": float("inf")}, "thickness_mm"),
    ({**GOOD, "thickness_mm": 10**400}, "thickness_mm"),
    ({**GOOD, "thickness_mm": "thin"}, "thickness_mm"),
    ({**GOOD, "thickness_change": "some"}, "thickness_change"),
    ({**GOOD, "thickness_change": 1}, "thickness_change"),
    ({**GOOD, "name": 7}, "name"),
    ({**GOOD, "source": [1]}, "source"),
    ({**GOOD, "valid_strain": 0.1}, "valid_strain"),
    ({**GOOD, "valid_strain": {"warp": [0.0]}}, "valid_strain.warp"),
    ({**GOOD, "valid_strain": {"fill": [0.0, -0.1]}}, "valid_strain.fill"),
    ({**GOOD, "valid_strain": {"fill": [0.02, 0.1]}}, "valid_strain.fill"),
    ({**GOOD, "valid_strain": {"shear": [0.0, float("nan")]}}, "valid_strain.shear"),
    ({**GOOD, "valid_strain": {"shear": 0.1}}, "valid_strain.shear"),
    ({**GOOD, "law": 1}, "law"),
    ({**GOOD, "law": "hypoelastic orthotropic; tri-linear"}, "breaks"),
    ({**GOOD, "breaks": [0.01, 0.03]}, "breaks"),
    ({**GOOD, "breaks": {}}, "breaks.warp"),
    (with_breaks(weft=[0.01, 0.02]), "breaks.weft"),
    (with_breaks(fill=None), "breaks.fill"),
    (with_breaks(fill=0.02), "breaks.fill"),
    (with_breaks(fill=[0.02]), "breaks.fill"),
    (with_breaks(fill=[0.02, 0.04, 0.06]), "breaks.fill"),
    (with_breaks(fill=[0.02, "0.04"]), "breaks.fill"),
    (with_breaks(warp=[0.03, 0.01]), "breaks.warp"),
    (with_breaks(warp=[0.03, 0.03]), "breaks.warp"),
    (with_breaks(shear=[0.0, 0.03]), "breaks.shear"),
    (with_breaks(shear=[-0.01, 0.03]), "breaks.shear"),
    (with_breaks(shear=[0.01, float("nan")]), "breaks.shear"),
    (with_breaks(shear=[0.01, float("inf")]), "breaks.shear"),
    (with_breaks(shear=[10**300, 10**300 + 1]), "breaks.shear"),
    ({**with_breaks(), "beta": [0.1, *GOOD["beta"][1:]]}, "beta"),
]


NAMED = {**GOOD, "format": 2, "form": "cubic", "law": "hypoelastic orthotropic"}
KNOTS = {"warp": [0.0, 0.05, 0.13], "fill": [0.0, 0.12], "shear": [0.0, 0.05, 0.11]}
SPLINE = {**NAMED, "form": "spline", "beta": [0.01] * 3 + [0.1] * 2 + [0.8] * 3, "knots": KNOTS}
BAD += [
    ({**NAMED, "format": 4}, "format"),
    ({**NAMED, "format": "2"}, "format"),
    ({**GOOD, "form": "cubic"}, "format"),
    ({k: v for k, v in NAMED.items() if k != "form"}, "form"),
    ({**NAMED, "form": "quintic"}, "form"),
    ({**NAMED, "form": 3}, "form"),
    ({**NAMED, "form": ["cubic"]}, "form"),
    ({**NAMED, "law": "elastic"}, "law"),
    ({**NAMED, "law": ["elastic"]}, "law"),
    ({**NAMED, "form": "trilinear"}, "breaks"),
    ({**NAMED, "breaks": BREAKS}, "breaks"),
    ({**NAMED, "form": "constant", "beta": [*GOOD["beta"][:10], 0.1, 0.8]}, "beta"),
    ({**SPLINE, "beta": GOOD["beta"]}, "beta"),
    ({**SPLINE, "breaks": BREAKS}, "breaks"),
    ({k: v for k, v in SPLINE.items() if k != "knots"}, "knots"),
    ({**SPLINE, "knots": 4}, "knots"),
    ({**SPLINE, "knots": {**KNOTS, "weft": [0.0, 1.0]}}, "knots.weft"),
    ({**SPLINE, "knots": {"warp": [0.0, 1.0], "fill": [0.0, 1.0]}}, "knots.shear"),
    ({**SPLINE, "knots": {**KNOTS, "fill": [0.01, 0.12]}}, "knots.fill"),
    ({**SPLINE, "knots": {**KNOTS, "fill": [0.0, 0.12, 0.12]}}, "knots.fill"),
    ({**SPLINE, "knots": {**KNOTS, "fill": [0.0, float("nan")]}}, "knots.fill"),
]


@pytest.mark.parametrize(("content", "field"), BAD)
def test_a_bad_card_names_file_and_field(
    tmp_path: Path, content: dict[str, Any], field: str
) -> None:
    path = tmp_path / "material.toml"
    path.write_text(tomli_w.dumps(content))
    with pytest.raises(InputError) as caught:
        read_card(path)
    message = str(caught.value)
    assert str(path) in message and field in message and "\n" not in message
    assert caught.value.field == field


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"unit = ",
        b"\xff\xfe\x00",
        b"beta = [1, 2",
        b"a = 1\na = 2",
        b"x = " + b"[" * 100_000,
        b"nu12 = " + b"9" * 5000,
        b"when = 2000-13-45",
    ],
)
def test_what_is_not_a_card_is_said_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "material.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_card(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_no_file_and_a_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            read_card(path)


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
def test_garbage_gives_no_other_exception(content: bytes) -> None:
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
def test_any_value_at_any_key_is_read_or_refused(key: str, value: Any) -> None:
    for good in (GOOD, NAMED, SPLINE):
        read_bytes(tomli_w.dumps({**good, key: value}).encode())


@given(st.integers(0, 2000), st.binary(min_size=1, max_size=4))
@settings(max_examples=200, deadline=None)
def test_a_damaged_good_card_is_read_or_refused(where: int, damage: bytes) -> None:
    content = tomli_w.dumps(GOOD).encode()
    where %= len(content)
    read_bytes(content[:where] + damage + content[where + len(damage) :])


def test_a_card_is_in_gpa_unless_told_otherwise(tmp_path: Path) -> None:
    card = MaterialCard(HypoelasticLaw.linear(500.0, 200.0, 20.0), 0.8)
    write_card(card, tmp_path / "a.toml")
    card.write(tmp_path / "b.toml")
    card.write(tmp_path / "c.toml", "MPa")
    for name, unit, e1 in (("a", "GPa", 0.5), ("b", "GPa", 0.5), ("c", "MPa", 500.0)):
        said = tomllib.loads((tmp_path / f"{name}.toml").read_text())
        assert (said["unit"], said["beta"][11]) == (unit, pytest.approx(e1))
