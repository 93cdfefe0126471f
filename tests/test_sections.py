"""Units of a project file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import pytest
from bubblefit.readers.columns import LOAD_UNITS
from bubblefit.readers.sections import (
    HUGE,
    LENGTH_UNITS,
    MODULUS_UNITS,
    PRESSURE_UNITS,
    LengthUnit,
    LoadUnit,
    ModulusUnit,
    Number,
    Pair,
    Positive,
    PressureUnit,
    Strain,
    StrainTriple,
    beside,
)
from pydantic import TypeAdapter, ValidationError

#: Of one of each, in SI.
PASCAL = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5}
METRE = {"m": 1.0, "mm": 1e-3}


def test_units_are_those_of_si() -> None:
    for table in (MODULUS_UNITS, PRESSURE_UNITS):
        assert {name: 1e6 * mpa for name, mpa in table.items()} == pytest.approx(
            {name: PASCAL[name] for name in table}
        )
    assert {name: 1e-3 * mm for name, mm in LENGTH_UNITS.items()} == pytest.approx(METRE)


def test_units_that_a_project_may_say_are_those_that_are_known() -> None:
    assert set(get_args(ModulusUnit)) == {"GPa", "MPa", "Pa"} == set(MODULUS_UNITS)
    assert set(get_args(PressureUnit)) == {"kPa", "MPa", "bar", "Pa"} == set(PRESSURE_UNITS)
    assert set(get_args(LengthUnit)) == {"mm", "m"} == set(LENGTH_UNITS)
    assert set(get_args(LoadUnit)) == {"N", "kN"} <= set(LOAD_UNITS)


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (Number, [-HUGE, 0.0, HUGE], [-1.001e18, 1.001e18]),
        (Positive, [1e-300, HUGE], [0.0, -1.0, 1.001e18]),
        (Strain, [1e-9, 2.0], [0.0, 2.001, -0.1]),
        (Pair, [[1.0, 2.0]], [[1.0], [1.0, 2.0, 3.0], [0.0, 1.0]]),
        (StrainTriple, [[0.1, 0.2, 2.0]], [[0.1, 0.2], [0.1] * 4, [0.1, 0.2, 2.1]]),
    ],
)
def test_numbers_of_a_project_at_their_ends(kind: Any, good: list[Any], bad: list[Any]) -> None:
    assert HUGE == 1e18
    for value in good:
        assert TypeAdapter(kind).validate_python(value) == value
    for value in bad:
        with pytest.raises(ValidationError):
            TypeAdapter(kind).validate_python(value)


def test_files_beside_a_project(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/a")
    given = {"b.csv": "/p/b.csv", "../b": "/p/../b", "/c": "/c", "~/d": "/home/a/d"}
    assert {name: str(beside(Path("/p"), name)) for name in given} == given
