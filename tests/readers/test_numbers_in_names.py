"""readers/values_in_files.py: numbers in names of files."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.machine_tables import Channel
from bubblefit.readers.units import PRESSURE_UNITS, TIME_UNITS
from bubblefit.readers.values_in_files import (
    check_pattern,
    number_in_name,
    picture_numbers,
    values_in_file,
)

from ..support.refusals import complaint, complaint_with


def test_frames_without_picture_numbers(tmp_path):
    path = tmp_path / "all.csv"
    path.write_text("x;frame;p [bar]\n1;1;0.2\n2;two;0.3\n")
    words = "line 3, column 'frame': expected a number, found 'two'"
    complaint_with([words], values_in_file, path, Channel("p"), PRESSURE_UNITS)
    # Of one frame, or of frames that are all called alike, no picture is missing.
    assert picture_numbers([path], [5.0]) == (np.zeros(1), [])
    assert len(picture_numbers([path], [5.0, 5.0])[1]) == 1


@pytest.mark.parametrize(
    ("name", "units", "pattern", "expected"),
    [
        ("step_012_35.5kPa.csv", PRESSURE_UNITS, None, 0.0355),
        ("step_012_35,5_kPa.csv", PRESSURE_UNITS, None, 0.0355),
        ("run7-0.355bar-a.csv", PRESSURE_UNITS, None, 0.0355),
        ("12_355 mbar.txt", PRESSURE_UNITS, None, 0.0355),
        ("5.1489psi.csv", PRESSURE_UNITS, None, 0.0355), ("3mbar2.csv", PRESSURE_UNITS, None, 3e-4),
        ("bubble_p35.5_t12.csv", PRESSURE_UNITS, r"_p([\d.]+)_", 0.0355),
        ("bubble_p35.5_t12.csv", TIME_UNITS, r"_t(\d+)\.", 12.0),
        ("p3_7x.csv", TIME_UNITS, r"_(\d)", 7.0), ("12max.csv", PRESSURE_UNITS, None, "found none"),
        ("p3_7x.csv", {"s": 1.0, "ms": 1e-3}, None, "with its unit (s, ms)"),
        ("10kPa_0.1bar.csv", PRESSURE_UNITS, None, "10 kPa and 0.1 bar"),
        ("1s_2ms", {"s": 1.0, "ms": 1e-3}, None, "found 1 s and 2 ms"),
        ("a.csv", PRESSURE_UNITS, r"p(\d+)", "does not fit the pattern"),
        ("px.csv", PRESSURE_UNITS, r"p(\w)", "found 'x'"),
        ("p3.csv", PRESSURE_UNITS, "p(q)?", "found None"),
    ],
)  # fmt: skip
def test_number_with_unit_is_read_from_a_file_name(name, units, pattern, expected):
    asked = Path(name), units, pattern, "kPa" if units is PRESSURE_UNITS else None, "from_name"
    if isinstance(expected, float):
        assert number_in_name(*asked) == pytest.approx(expected, rel=2e-5)
    else:
        said = complaint(number_in_name, *asked)
        assert said.startswith(f"{name}: from_name: ") and expected in said
    assert check_pattern(r"_p(\d+)_") is None
    for bad, words in (("(", "no regular expression"), ("(a)(b)", "has 2"), ("a", "has 0")):
        assert words in check_pattern(bad)
