"""Pressures in names, columns, headers and logs, in whatever unit, also volts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.columns import PRESSURE_UNITS, TIME_UNITS, columns_of, split_unit
from bubblefit.readers.frames import Frame
from bubblefit.readers.machine_tables import Channel
from bubblefit.readers.names import check_pattern, number_in_name, value_in_file
from bubblefit.readers.pressure_log import LogOptions, apex_height, read_pressure_log

from ..complaints import complaint

POINTS = "x [mm];y [mm];dx [mm];dy [mm];dz [mm]"


def written(folder: Path, text: str) -> Path:
    path = folder / "made-up.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("step_012_35.5kPa.csv", 0.0355),
        ("step_012_35,5_kPa.csv", 0.0355),
        ("run7-0.355bar-a.csv", 0.0355),
        ("12_355 mbar.txt", 0.0355),
        ("5.1489psi.csv", 0.0355),
    ],
)
def test_a_number_with_its_unit_in_the_name(name, expected):
    assert number_in_name(Path(name), PRESSURE_UNITS) == pytest.approx(expected, rel=2e-5)


def test_a_pattern_says_where_the_number_is():
    path = Path("bubble_p0355_t12.csv")
    assert number_in_name(path, PRESSURE_UNITS, r"_p(\d+)_", "hPa") == pytest.approx(0.0355)
    assert number_in_name(path, TIME_UNITS, r"_t(\d+)\.") == 12.0
    assert check_pattern(r"_p(\d+)_") is None
    assert "no regular expression" in check_pattern("(")
    assert "has 2" in check_pattern("(a)(b)")


@pytest.mark.parametrize(
    ("name", "pattern", "words"),
    [
        ("12max.csv", None, ["found none", "pattern"]),
        ("10kPa_0.1bar.csv", None, ["10 kPa and 0.1 bar"]),
        ("a.csv", r"p(\d+)", ["does not fit the pattern"]),
        ("px.csv", r"p(\w)", ["expected a number", "'x'"]),
    ],
)
def test_names_without_one_number(name, pattern, words):
    said = complaint(number_in_name, Path(name), PRESSURE_UNITS, pattern, "kPa", "from_name")
    assert all(word in said for word in [name, "from_name", *words]), said


@pytest.mark.parametrize(
    "text",
    [
        f"{POINTS};p [kPa]\n0;0;0;0;1;35,5\n1;0;0;0;1;35,5\n",
        f"{POINTS};p\nmm;mm;mm;mm;mm;bar\n0;0;0;0;1;0.355\n1;0;0;0;1;0.355\n",
        f"# p [kPa] = 35.5\n{POINTS}\n0;0;0;0;1\n",
        f"Title\np;35,5;kPa\n{POINTS}\n0;0;0;0;1\n",
        f"# test 1 p_bar=0.355000; x,y in mm\n# p = 0.355 bar\n{POINTS}\n0;0;0;0;1\n",
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;nan;nan;nan;\n",
    ],
)
def test_a_column_or_a_line_above_the_numbers(tmp_path, text):
    path = written(tmp_path, text)
    assert value_in_file(path, Channel("p"), PRESSURE_UNITS) == pytest.approx(0.0355)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{POINTS};p [kPa]\n0;0;0;0;1;35\n1;0;0;0;1;36\n", ["line 3, column 'p [kPa]'", "line 2"]),
        (f"{POINTS};p\n0;0;0;0;1;35\n", ["line 1, column 'p'", "say the unit"]),
        (f"{POINTS};p [V]\n0;0;0;0;1;35\n", ["'V' is not one of", "volts"]),
        (f"{POINTS};p [V]\n0;0;0;0;1;high\n0;0;0;0;1;3\n0;0;0;0;1;low\n", ["line 4", "'low'"]),
        (f"{POINTS}\n0;0;0;0;1\n", ["neither a column 'p' nor a line"]),
        (f"p = 3 kPa\np = 4 kPa\n{POINTS}\n0;0;0;0;1\n", ["line 2", "another 'p' than line 1"]),
        (f"{POINTS};p;p\n0;0;0;0;1;3;3\n", ["line 1", "2 columns are called 'p'"]),
    ],
)
def test_values_that_cannot_be_told(tmp_path, text, words):
    path = written(tmp_path, text)
    said = complaint(value_in_file, path, Channel("p"), PRESSURE_UNITS)
    assert all(word in said for word in [str(path), *words]), said


def test_a_log_in_volts_is_that_of_appendix_b(tmp_path):
    """Festo SPTE-P10R: 0 V at 0 kPa, 10 V at 1,000 kPa (Appendix B of the thesis)."""
    path = written(tmp_path, "Zeit (min);U_p (V)\n0;0\n1;0,355\n2;10\n")
    log = read_pressure_log(path, LogOptions(Channel("U_p", "kPa", 100.0)))
    assert log.pressure == pytest.approx([0.0, 0.0355, 1.0])
    assert log.time == pytest.approx([0.0, 60.0, 120.0])


def test_a_volt_may_be_a_unit(tmp_path):
    path = written(tmp_path, "t (s),p (V)\n0,1\n1,2\n")
    options = LogOptions(Channel("p", "bar", 1.0, -0.5), Channel("t"))
    assert read_pressure_log(path, options).pressure == pytest.approx([0.05, 0.15])
    options = LogOptions(Channel("p", "bar", 4.0, -0.5), Channel("t"))
    assert read_pressure_log(path, options).pressure == pytest.approx([0.35, 0.75])


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("t,p (kPa)\n0,1\n1,2\n", LogOptions(), ["no header row", "time"]),
        ("time,p\n0,1\n1,2\n", LogOptions(), ["line 1, column 'p'", "say the unit"]),
        ("time,p (V)\n0,1\n1,2\n", LogOptions(Channel(unit="kPa")), ["'V'", "'kPa'"]),
        ("time,p (kPa)\n0,1\n1,2\n", LogOptions(Channel("p", "kPa", 100.0)), ["leave the scale"]),
        ("time,p (kPa)\n0,1\n2,2\n1,3\n", LogOptions(), ["line 4, column 'time'", "go back"]),
        ("time,p (kPa)\n0,1\n2,2\n1,3\n0,3\n", LogOptions(), ["line 4, column 'time'"]),
        ("time,p (kPa)\n3,1\n3,2\n", LogOptions(), ["column 'time'", "two times"]),
        ("time (days),p (kPa)\n3,1\n4,2\n", LogOptions(), ["'days' is not one of s"]),
        ("time,p (kPa),Druck\n3,1,1\n4,2,2\n", LogOptions(), ["'p (kPa)' or 'Druck'", "columns"]),
    ],
)
def test_logs_that_cannot_be_told(tmp_path, text, options, words):
    path = written(tmp_path, text)
    said = complaint(read_pressure_log, path, options)
    assert all(word in said for word in [str(path), *words]), said


def test_columns_of_pressure():
    assert split_unit("p_kPa") == ("p", "kPa") and split_unit("Druck in mbar") == ("Druck", "mbar")
    names = ["Time", "Pressure (bar)", "Pressure rate (bar/s)", "Druck"]
    assert columns_of(names, "pressure", {}) == [1, 3]


def test_the_apex_is_what_moved_most_in_any_axes():
    r = np.linspace(0, 1, 2001)
    up = np.outer(50 * (1 - r), [0.6, 0.0, -0.8])
    up[7] = 900.0
    up[3] = np.nan
    frame = Frame(np.zeros_like(up), up)
    # 98 % of points evenly along a cone moved less than 98 % of its height.
    assert apex_height(frame) == pytest.approx(49.0, abs=0.1)
    assert np.isnan(apex_height(Frame(np.zeros((2, 3)), np.full((2, 3), np.nan))))
