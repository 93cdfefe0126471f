"""Sections of a project file: units, numbers at their ends, errors in one line."""

from pathlib import Path
from typing import get_args

import pytest
from bubblefit.readers.curves import LoadUnit
from bubblefit.readers.sections import (
    HUGE,
    LENGTH_UNITS,
    MODULUS_UNITS,
    PRESSURE_UNITS,
    LengthUnit,
    ModulusUnit,
    Number,
    Positive,
    PositiveBounds,
    PressureUnit,
    Section,
    Strain,
    StrainTriple,
    first_error,
    path_beside,
)
from bubblefit.readers.units import LOAD_UNITS, WIDTH_LOAD_UNITS
from pydantic import Field, TypeAdapter, ValidationError

from ..support.refusals import raised

#: Of one of each, in SI.
PASCAL = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5}


def test_units_are_multiples_of_si():
    for table in (MODULUS_UNITS, PRESSURE_UNITS):
        pascal = {name: 1e6 * mpa for name, mpa in table.items()}
        assert pascal == pytest.approx({name: PASCAL[name] for name in table})
    assert LENGTH_UNITS == {"m": 1000.0, "mm": 1.0, "in": 25.4}
    assert set(get_args(ModulusUnit)) == {"GPa", "MPa", "Pa"} == set(MODULUS_UNITS)
    assert set(get_args(PressureUnit)) == {"kPa", "MPa", "bar", "Pa"} == set(PRESSURE_UNITS)
    assert set(get_args(LengthUnit)) == set(LENGTH_UNITS)
    assert set(get_args(LoadUnit)) <= {*LOAD_UNITS, *WIDTH_LOAD_UNITS}
    assert LOAD_UNITS["lbf"] == pytest.approx(4.4482216152605)
    assert WIDTH_LOAD_UNITS["lbf/in"] == pytest.approx(0.175126835)


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (Number, [-HUGE, 0.0, HUGE], [-1.001e18, 1.001e18]),
        (Positive, [1e-300, HUGE], [0.0, -1.0, 1.001e18]),
        (Strain, [1e-9, 2.0], [0.0, 2.001, -0.1]),
        (PositiveBounds, [[1.0, 2.0]], [[1.0], [1.0, 2.0, 3.0], [0.0, 1.0]]),
        (StrainTriple, [[0.1, 0.2, 2.0]], [[0.1, 0.2], [0.1] * 4, [0.1, 0.2, 2.1]]),
    ],
)
def test_numbers_of_a_project_are_bounded(kind, good, bad):
    assert HUGE == 1e18
    for value in good:
        assert TypeAdapter(kind).validate_python(value) == value
    for value in bad:
        raised(ValidationError, "", TypeAdapter(kind).validate_python, value)


def test_paths_are_relative_to_the_project(monkeypatch):
    monkeypatch.setenv("HOME", "/home/a")
    given = {"b.csv": "/p/b.csv", "../b": "/p/../b", "/c": "/c", "~/d": "/home/a/d"}
    assert {name: str(path_beside(Path("/p"), name)) for name in given} == given


class Inner(Section):
    length: float
    pair: list[float] = Field(default=[1.0, 2.0], min_length=2, max_length=2)


class Outer(Section):
    name: str = "a"
    inner: Inner | None = None
    many: list[Inner] = Field(default=[])
    needed: Inner


RIGHT = {"length": 1.0}


def said(content: dict, at: str = "") -> str:
    found = raised(ValidationError, "", Outer.model_validate, content)
    return str(first_error(Path("p.toml"), found, Outer, at))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({}, "needed: this section is missing; add it"),
        ({"needed": {}}, "needed.length: this key is missing; add it"),
        ({"needed": {**RIGHT, "zzz": 1}}, "needed.zzz: unknown key; allowed here: length, pair"),
        ({"needed": RIGHT, "nam": "x"}, "nam: unknown key; did you mean 'name'? allowed here: na"),
        ({"needed": RIGHT, "many": [RIGHT, {**RIGHT, "pairs": 1}]}, "many[1].pairs: unknown key;"),
        # Half of the letters in their order are near, fewer are not.
        ({"needed": {**RIGHT, "pxyz": 1}}, "needed.pxyz: unknown key; allowed here: length, pair"),
        ({"needed": {**RIGHT, "paxy": 1}}, "needed.paxy: unknown key; did you mean 'pair'?"),
        ({"needed": {"length": float("inf")}}, "needed.length: expected a finite number, got inf"),
        ({"needed": {**RIGHT, "pair": []}}, "needed.pair: expected at least 2 items, got 0"),
        ({"needed": {**RIGHT, "pair": [1, 2, 3]}}, "needed.pair: expected at most 2 items, got 3"),
        ({"needed": {**RIGHT, "pair": "x" * 58}}, "needed.pair: expected a valid list, got 'x"),
        ({"needed": RIGHT, "name": 3}, "name: expected a valid string, got 3"),
    ],
)
def test_error_of_a_section_is_one_whole_line(content, words):
    assert said(content).startswith(f"p.toml: {words}")
    field, rest = words.split(": ", 1)
    assert said(content, "a.b").startswith(f"p.toml: a.b.{field}: {rest}")


def test_long_values_are_cut_and_other_findings_counted():
    for count, end in ((58, "x" * 58 + "'"), (59, "x" * 56 + "...")):
        assert said({"needed": {**RIGHT, "pair": "x" * count}}).endswith(f"got '{end}")
    wrong = {"needed": {"length": "x"}, "name": 3}
    assert said(wrong).endswith("name: expected a valid string, got 3 (1 more)")
    first = said({**wrong, "nam": 1})  # unknown keys before all
    assert "nam: unknown key" in first and first.endswith("(2 more)")
