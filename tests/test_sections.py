"""Units of a project file."""

from __future__ import annotations

from typing import get_args

import pytest
from bubblefit.data.column_names import LOAD_UNITS
from bubblefit.sections import (
    LENGTH_UNITS,
    MODULUS_UNITS,
    PRESSURE_UNITS,
    LengthUnit,
    LoadUnit,
    ModulusUnit,
    PressureUnit,
)

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
