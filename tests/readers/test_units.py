"""readers/units.py: units of columns and in names, and numbers in another unit than is said."""

import pytest
from bubblefit.readers.units import (
    LENGTH_UNITS,
    LOAD_UNITS,
    PRESSURE_UNITS,
    RANGES,
    TIME_UNITS,
    WIDTH_LOAD_UNITS,
    pressure_remedy,
    scale_of,
    split_unit,
    unit_doubt,
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
        ("Druck in mbar", "Druck", "mbar"), ("Curvature (1/m)", "Curvature", "1/m"),
        ("Strain [-]", "Strain", "-"), ("Specimen (1)", "Specimen (1)", ""),
    ],
)  # fmt: skip
def test_units_are_split_from_names(name, plain, unit):
    assert split_unit(name) == (plain, unit)


@pytest.mark.parametrize(
    ("quantity", "number", "unit", "scale", "words"),
    [
        ("pressure", 140.0, "kPa", 1e-3, ""),
        ("pressure", 140_000.0, "kPa", 1e-3, "at most 5000, got 140000"),
        ("pressure", 140_000.0, "kPa", 1e-3, "is this in Pa? Divide by 1000"),
        ("pressure", 140.0, "MPa", 1.0, "is this in kPa? Divide by 1000"),
        ("pressure", 140.0, "bar", 0.1, "is this in kPa? Divide by 100"),
        ("pressure", 1.4e5, "bar", 0.1, "is this in Pa? Divide by 100000"),
        ("pressure", 0.14, "Pa", 1e-6, ""),
        (
            "pressure",
            0.014,
            "Pa",
            1e-6,
            "at least 0.1, got 0.014; is this in MPa? Multiply by 1e+06",
        ),
        ("pressure", 5.0, "MPa", 1.0, ""),
        ("pressure", 5.01, "MPa", 1.0, "far beyond what a membrane holds"),
        ("size", 0.1, "mm", 1.0, "is this in m? Multiply by 1000"),
        ("size", 100.0, "m", 1000.0, ""),
        ("size", 150.0, "m", 1000.0, "is this in mm? Divide by 1000"),
        ("size", 4.0, "in", 25.4, ""),
        ("thickness", 0.8, "mm", 1.0, ""),
        ("thickness", 0.0008, "mm", 1.0, "is this in m? Multiply by 1000"),
        ("thickness", 0.8, "m", 1000.0, "is this in mm? Divide by 1000"),
        ("thickness", 810.0, "mm", 1.0, "is this in um? Divide by 1000"),
    ],
)
def test_implausible_number_is_named_with_its_factor(quantity, number, unit, scale, words):
    problem = unit_doubt(quantity, number, unit, scale)
    assert words in problem and bool(problem) == bool(words)


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "kPa"), (1e6, "Pa")])
def test_unit_of_a_series_is_that_of_its_largest_number(factor, unit):
    series = [factor * pressure for pressure in (0.005, 0.02, 0.1, 0.3)]
    doubts = [unit_doubt("pressure", number, "MPa", 1.0, series) for number in series]
    # The smallest alone, 5000 Pa, would pass for kPa.
    words = f"is this in {unit}? Divide by {factor:g}"
    assert all(words in doubt for doubt in doubts if doubt) and any(doubts)


def test_number_that_no_unit_explains_has_no_factor():
    problem = unit_doubt("pressure", 1e12, "MPa", 1.0)
    assert problem.endswith("membrane holds") and "Divide" not in problem
    assert all(limits.holds(limits.usual) for limits in RANGES.values())


@pytest.mark.parametrize(
    ("modulus", "words"),
    [
        (3000.0, "divided by 10 (bar given as MPa) it would be 300 MPa"),
        (3e5, "divided by 1000 (kPa given as MPa, or Pa as kPa) it would be 300 MPa"),
        (3.0, "multiplied by 100 (bar given as kPa) it would be 300 MPa"),
        (1e9, ""),
    ],
)
def test_remedy_names_the_unit_that_gives_a_plausible_modulus(modulus, words):
    remedy = pressure_remedy(modulus, (50.0, 2000.0))
    assert words in remedy and bool(remedy) == bool(words)
