"""readers/values_in_files.py: values in a file of points or in its name."""

import re
from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.machine_tables import Channel
from bubblefit.readers.units import PRESSURE_UNITS, TIME_UNITS
from bubblefit.readers.values_in_files import (
    check_pattern,
    number_in_name,
    numbers_in_names,
    picture_numbers,
    values_in_file,
)

from ..support.refusals import complaint, complaint_with
from .cases import written_file

POINTS = "x [mm];y [mm];dx [mm];dy [mm];dz [mm]"


def test_value_is_read_from_a_column_or_a_line_above(tmp_path):
    for text in (
        f"{POINTS};p [kPa]\n0;0;0;0;1;35,5\n1;0;0;0;1;35,5\n",
        f"{POINTS};p\nmm;mm;mm;mm;mm;bar\n0;0;0;0;1;0.355\n1;0;0;0;1;0.355\n",
        f"# p [kPa] = 35.5\n{POINTS}\n0;0;0;0;1\n", f"Title\np;35,5;kPa\n{POINTS}\n0;0;0;0;1\n",
        f"# test 1 p_bar=0.355000; x,y in mm\n# p = 0.355 bar\n{POINTS}\n0;0;0;0;1\n",
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;nan;nan;nan;\n",
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;0;0;1;n/a\n2;0;0;0;1;35.5\n",
        f"{POINTS};p\n;;;;;[kPa]\n0;0;0;0;1;35.5\n", f"{POINTS}\n0;0;0;0;1\np = 3.55e1 kPa\n",
        "p [kPa],q,r\n35.5,a,1\n35.5,b,2\n", "x p_kPa\n1 35.5\n", "# p_kPa = 35.5\nx;y\n1;2\n",
        "p [kPa]: 35,5\nx;y\n1;2\n", "p 35.5 kPa, and p 35.5 kPa again\n", "p (kPa) 355e-1\n",
    ):  # fmt: skip
        value = values_in_file(written_file(tmp_path, text), Channel("p"), PRESSURE_UNITS)
        assert value == pytest.approx(0.0355), text


NEITHER = ["neither a column 'p' nor a line"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{POINTS};p [kPa]\n0;0;0;0;1;35\n1;0;0;0;1;36\n", ["line 3, column 'p [kPa]'", "line 2"]),
        (f"{POINTS};p [kPa]\n0;0;0;0;1;3\n1;0;0;0;1;3\n1;0;0;0;1;4\n", ["line 4, column 'p ["]),
        (f"{POINTS};p\n0;0;0;0;1;35\n", ["line 1, column 'p'", "say the unit"]),
        (f"{POINTS};p [V]\n0;0;0;0;1;35\n", ["'V' is not one of"]),
        (f"{POINTS};p [V]\n0;0;0;0;1;high\n0;0;0;0;1;3\n0;0;0;0;1;low\n", ["line 4", "'low'"]),
        (f"{POINTS};p\n0;0;0;0;1;\n0;0;0;0;1;n/a\n", ["line 1, column 'p': holds no number"]),
        (f"{POINTS}\n0;0;0;0;1\n", NEITHER), ("xp = 3 kPa\np2 = 4 kPa\n", NEITHER),
        ("p = 1,013.5 hPa\n", NEITHER),
        # A column of words is none, and a row with too few cells is none of the table.
        ("p [kPa],q,r,s\n3,a,b,c\n3,a,b,c\n", NEITHER), ("p,q,r [kPa]\n3\n3\n", NEITHER),
        (f"p = 3 kPa\np = 4 kPa\n{POINTS}\n0;0;0;0;1\n", ["line 2", "another 'p' than line 1"]),
        ("a\np = 3 kPa\n\np = 4 kPa\n", ["line 4", "another 'p' than line 2"]),
        (f"t\n{POINTS};p;p [bar]\n0;0;0;0;1;3;4\n", ["line 2", "2 columns are called 'p'"]),
    ],
)  # fmt: skip
def test_ambiguous_values_in_files_are_refused(tmp_path, text, words):
    path = written_file(tmp_path, text)
    complaint_with([str(path), *words], values_in_file, path, Channel("p"), PRESSURE_UNITS)


@pytest.mark.parametrize(
    ("names", "numbers", "words"),
    [
        ("B0001 B0002 B0003", [0, 1, 2], []), ("a b c", [0, 1, 2], []),
        ("i1 i2 i4 i5", [0, 1, 3, 4], ["leave out 1 (3)"]),
        ("i1 i4 i5 i6", [0, 3, 4, 5], ["leave out 2 (2, 3)"]),
        ("i1 i2 i2b i3", [0, 1, 1, 2], ["come again (2)"]),
        ("s1_12kPa s2_35.5kPa s3_60kPa", [0, 1, 2], []),
        ("c2_00010 c2_00020 c2_00030 c2_00050", [0, 10, 20, 40], ["up by 10", "1 (40)"]),
        ("1_140201 2_140203 3_140301", [0, 1, 2], []), ("i3 i1 i2", [0, 1, 2], []),
        # Minutes that do not rise at every frame are no counter.
        ("12_40_1_100 12_40_2_200 12_41_3_300", [0, 1, 2], []),
    ],
)  # fmt: skip
def test_picture_numbers_are_read_from_names(names, numbers, words):
    files = [Path("run_7") / f"{name}.csv" for name in names.split()]
    found, said = picture_numbers(files, [None] * len(files))
    assert found.tolist() == numbers and len(said) == len(words)
    assert all(word in text for word, text in zip(words, said, strict=True))
    own, said = picture_numbers(files[:1], [2.0, 3.0, 7.0, 8.0])
    assert own.tolist() == [0, 1, 5, 6] and "leave out 3 (4, 5, 6)" in said[0]
    assert "times from the first" in picture_numbers([], [2.0, 3.0], True)[1][0]
    assert not picture_numbers([], [1.0, 2.0], True)[1]


def test_frames_without_picture_numbers(tmp_path):
    path = tmp_path / "all.csv"
    path.write_text("x;frame;p [bar]\n1;1;0.2\n2;two;0.3\n")
    words = "line 3, column 'frame': expected a number, found 'two'"
    complaint_with([words], values_in_file, path, Channel("p"), PRESSURE_UNITS)
    # Of one frame, or of frames that are all called alike, no picture is missing.
    assert picture_numbers([path], [5.0]) == (np.zeros(1), [])
    assert len(picture_numbers([path], [5.0, 5.0])[1]) == 1


def test_ambiguous_number_in_a_name_is_refused():
    for name in ("12p5kPa.csv", "1E2 kPa.csv"):
        words = "kPa stands behind a letter that may be a decimal mark or a power; a pattern"
        complaint_with([name, words], number_in_name, Path(name), PRESSURE_UNITS)


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        ("p_0_5bar p_1_0bar p_1_5bar", None), ("p_0_5bar p_1bar p_1_5bar", None),
        ("1-5bar 2-0bar", None), ("p_1_50_bar", None), ("p_0_10bar p_0_20bar", None),
        # As counters or as decimals, each could be meant.
        ("s1_12kPa s2_24kPa s3_36kPa", None), ("p1_2bar p2_4bar p3_6bar p4_8bar p5_9bar", None),
        ("1_12bar 2_15bar 3_11bar 4_18bar 5_20bar", None),
        ("s1_12kPa s2_35.5kPa s3_60kPa", [12, 35.5, 60]), ("01_5kPa 02_7kPa", [5, 7]),
        ("s09_5kPa s10_7kPa", [5, 7]),
        ("s1_50kPa s2_100kPa", [50, 100]), ("12_355_mbar", [35.5]), ("100_5kPa 120_5kPa", None),
        ("bubble_2_5kPa bubble_2_10kPa", [5, 10]),
        ("p1_0kPa p2_0kPa p3_5kPa p4_10kPa p5_10kPa", [0, 0, 5, 10, 10]),
        ("1_2kPa 2_4kPa 3_8kPa 4_4kPa 5_2kPa 6_0kPa 7_9kPa 8_19kPa 9_9kPa 10_1kPa",
         [2, 4, 8, 4, 2, 0, 9, 19, 9, 1]),
        ("1,5bar 2,0bar", [150, 200]), ("150mbar 1200mbar", [15, 120]),
    ],
)  # fmt: skip
def test_whole_number_that_may_be_decimals_of_another_is_refused(names, numbers):
    files = [Path(f"{name}.csv") for name in names.split()]
    if numbers is not None:
        values = 1e3 * numbers_in_names(files, PRESSURE_UNITS)
        assert values == pytest.approx(np.array(numbers))
        return
    message = complaint(numbers_in_names, files, PRESSURE_UNITS, None, None, "from_name")
    assert message.startswith(f"{files[0].name}: from_name: "), message
    pattern = re.search(r"is meant: '(.+?)' or", message)[1]
    assert re.search(pattern, files[0].name), pattern


def test_pattern_reads_two_whole_numbers_as_one_with_decimals():
    files = [Path(f"p_{name}bar.csv") for name in ("0_5", "1_50", "12p5", "3-25")]
    values = numbers_in_names(files, PRESSURE_UNITS, r"_(\d+[_p-]\d+)bar", "bar")
    assert values == pytest.approx([0.05, 0.15, 1.25, 0.325])
    words = "bar stands behind the number, which '_(.+)bar' reads in kPa"
    complaint_with([words], numbers_in_names, files, PRESSURE_UNITS, "_(.+)bar", "kPa")


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
        ("step3p12.5kPa.csv", PRESSURE_UNITS, r"p([\d.]+)kPa", 12.5e-3),
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


def test_pattern_of_a_name_needs_one_group():
    assert check_pattern(r"_p(\d+)_") is None
    for bad, words in (("(", "no regular expression"), ("(a)(b)", "has 2"), ("a", "has 0")):
        assert words in check_pattern(bad)
