"""Units of a project file."""

from __future__ import annotations

import pytest
from bubblefit.sections import LENGTH_UNITS, MODULUS_UNITS, PRESSURE_UNITS

#: Of one of each, in SI.
PASCAL = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5}
METRE = {"m": 1.0, "mm": 1e-3}


def test_units_are_those_of_si() -> None:
    for table in (MODULUS_UNITS, PRESSURE_UNITS):
        assert {name: 1e6 * mpa for name, mpa in table.items()} == pytest.approx(
            {name: PASCAL[name] for name in table}
        )
    assert {name: 1e-3 * mm for name, mm in LENGTH_UNITS.items()} == pytest.approx(METRE)
