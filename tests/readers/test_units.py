"""readers/units.py: units of columns and in names."""

import pytest
from bubblefit.readers.units import (
    LENGTH_UNITS,
    LOAD_UNITS,
    PRESSURE_UNITS,
    TIME_UNITS,
    WIDTH_LOAD_UNITS,
    scale_of,
    split_unit,
)


def test_units_of_columns_are_those_of_si():
    pascal = {
        "Pa": 1, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3, "psi": 0.45359237 * 9.80665 / 0.0254**2,
        "bar": 1e5, "MPa": 1e6,
    }  # fmt: skip
    assert {k: 1e6 * v for k, v in PRESSURE_UNITS.items()} == pytest.approx(pascal)
    lengths = {"mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4, "ft": 304.8, "um": 1e-3, "mil": 0.0254}
    assert pytest.approx(lengths | dict.fromkeys(("\u00b5m", "\u03bcm"), 1e-3)) == LENGTH_UNITS
    pond, pound = 9.80665e-3, 0.45359237 * 9.80665
    loads = {"N": 1.0, "kN": 1e3, "daN": 10.0, "mN": 1e-3, "gf": pond, "lbf": pound}
    loads |= {"kip": 1e3 * pound, "ozf": pound / 16}
    assert pytest.approx(loads | {"kgf": 1e3 * pond, "kp": 1e3 * pond}) == LOAD_UNITS
    per_metre = {"kN/m": 1e3, "N/mm": 1e3, "N/m": 1.0, "N/cm": 1e2, "N/50mm": 20.0}
    per_metre |= {"N/5cm": 20.0, "daN/5cm": 200.0, "lbf/in": pound / 0.0254}
    found = {k: 1e3 * v for k, v in WIDTH_LOAD_UNITS.items()}
    assert found == pytest.approx(per_metre)
    assert TIME_UNITS == {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
    for unit, newton in {"n": 1.0, "kn": 1e3, "KN": 1e3, "N": 1.0, "MN": None}.items():
        assert scale_of(unit, LOAD_UNITS) == newton


@pytest.mark.parametrize(
    ("name", "plain", "unit"),
    [
        ("Load (kN)", "Load", "kN"), ("Crosshead [mm]", "Crosshead", "mm"), ("p_kPa", "p", "kPa"),
        ("gauge_disp_mm", "gauge_disp", "mm"), ("load_N", "load", "N"), ("Kraft / N", "Kraft", "N"),
        ("Weg in mm", "Weg", "mm"), ("PROBENBREITE <mm>", "PROBENBREITE", "mm"), ("m", "m", ""),
        ("Tensile strain (Extension)", "Tensile strain (Extension)", ""), ("Time", "Time", ""),
        ("Load (Channel 1)", "Load (Channel 1)", ""), ("Strain (mm/mm)", "Strain", "mm/mm"),
        ("Druck in mbar", "Druck", "mbar"),
    ],
)  # fmt: skip
def test_units_are_split_from_names(name, plain, unit):
    assert split_unit(name) == (plain, unit)
