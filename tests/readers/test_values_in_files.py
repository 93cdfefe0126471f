"""readers/values_in_files.py: a value in a file of points."""

from pathlib import Path

import pytest
from bubblefit.readers.machine_tables import Channel
from bubblefit.readers.units import PRESSURE_UNITS
from bubblefit.readers.values_in_files import picture_numbers, values_in_file

from ..support.refusals import complaint_with
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
        ("i1 i2 i2b i3", [0, 1, 1, 2], ["come again (2)"]),
        ("s1_12kPa s2_35.5kPa s3_60kPa", [0, 1, 2], []),
        ("c2_00010 c2_00020 c2_00030 c2_00050", [0, 10, 20, 40], ["up by 10", "1 (40)"]),
        ("1_140201 2_140203 3_140301", [0, 1, 2], []), ("i3 i1 i2", [0, 1, 2], []),
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
