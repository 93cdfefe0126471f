"""Tables of numbers in text files."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.headings import columns_of, heading_of
from bubblefit.readers.numerals import decimal_mark, is_number
from bubblefit.readers.tables import read_table
from bubblefit.readers.text_frames import find_layout, quantity_columns, read_numbers

from ..support.refusals import complaint, complaint_with

WANTED = ("x", "y", "dx", "dy", "dz")
PLAIN = FrameOptions(WANTED)


def layout(folder: Path, text: str, comment: str = "#", **named: str):
    path = folder / "a.txt"
    path.write_text(text)
    return find_layout(path, WANTED, named, comment)


@pytest.mark.parametrize(
    ("cells", "mark"),
    [
        (["1", "2.5"], "."), (["1,5", "2"], ","), (["1,5", "2.5"], "."), (["1,234", "0,5"], ","),
        (["0,234"], ","), (["1,2345"], ","), (["12", "x.y"], "."), ([",5"], ","),
        (["12", "1,234", "12,345"], "line 5, column 'x': '1,234': is the"),
    ],
)  # fmt: skip
def test_the_decimal_mark(cells, mark):
    numbered = [(line, "x", cell) for line, cell in enumerate(cells, 4)]
    if len(mark) > 1:
        assert mark in complaint(decimal_mark, Path("a"), numbered)
    else:
        assert decimal_mark(Path("a"), numbered) == mark
    for cell in ("1", "-1.5", "+.5", ",5", "1,", "1e5", "1.5E-07"):
        assert is_number(cell), cell
    for cell in ("", ".", "1.2.3", "1e", "e5", "1 2", "nan", "--1"):
        assert not is_number(cell), cell


@pytest.mark.parametrize(
    ("text", "separator", "header", "lines", "decimal"),
    [
        ("x,y,dx,dy,dz\n1,2,3,4,5\n", ",", 1, [2], "."),
        ("title\n\nx;y;dx;dy;dz\n1,5;2;3;4;5\n6;7;8;9;1\n", ";", 3, [4, 5], ","),
        ("x\ty\tdx\tdy\tdz\n1\t2\t3\t4\t5\n", "\t", 1, [2], "."),
        ("x y dx dy dz\n1 2 3 4 5\n", None, 1, [2], "."),
        ("# m\n# x,y,dx,dy,dz\n1,2,3,4,5\n", ",", 2, [3], "."),
        # A comment is asked only where no row is.
        ("# x,y,dx,dy,dz\nx,y,dx,dy,dz\n1,2,3,4,5\n", ",", 2, [3], "."),
        # The row that tells most, and the one above numbers, is the row of names.
        ("x,y,1\nx,y,dx,dy,dz\n1,2,3,4,5\n", ",", 2, [3], "."),
        ("x,y,dx,dy,dz\nw\nw\nx,y,dx,dy,dz\n1,2,3,4,5\n", ",", 4, [5], "."),
        ("X first,x,y,dx,dy,dz\n0,1,2,3,4,5\n", ",", 1, [2], "."),
        # Names with blanks make no cells; they stand within the first 300 lines.
        ("x mm;y mm;dx mm;dy mm;dz mm\n1;2;3;4;5\n", ";", 1, [2], "."),
        ("word\n" * 299 + "x,y,dx,dy,dz\n1,2,3,4,5\n", ",", 300, [301], "."),
    ],
)
def test_where_the_numbers_stand(tmp_path, text, separator, header, lines, decimal):
    found = layout(tmp_path, text)
    assert (found.separator, found.header, found.decimal) == (separator, header, decimal)
    assert [line for line, _ in found.body] == lines


def test_a_row_of_units(tmp_path):
    text = "x,y,dx,dy,dz,v\n[mm],mm,(µm),um,,m/s\n1,2,3,4,5,6\n"
    found = layout(tmp_path, text)
    assert [h.unit for h in found.headings] == ["mm", "mm", "µm", "um", "", "m/s"]
    assert [line for line, _ in found.body] == [3]
    assert dict(found.columns) == {name: [i] for i, name in enumerate(WANTED)}
    # Texts without a length are no units, and a row with a number in it is a row.
    for row in ("a,b,c,d,e,f", "mm,1,mm,mm,mm,mm"):
        assert len(layout(tmp_path, text.replace("[mm],mm,(µm),um,,m/s", row)).body) == 2


def test_no_row_of_names(tmp_path):
    for text, words in (
        ("# a\n\n", "expected a header line and rows of numbers,"),
        ("x,y,dx,dy,dz,b,c\n", "line 1: expected a header line and"),
        ("some words\n", "expected a header line and rows of"),
        ("word\n" * 300 + "x,y,dx,dy,dz\n1,2,3,4,5\n", "no row of names"),
        # One quantity is no table of points; two are.
        ("# m\na,b\n1,2\n", "Line 2 is: a,b"), ("# m\na,x\n1,2\n", "Line 2 is: a,x"),
    ):  # fmt: skip
        assert words in complaint(layout, tmp_path, text)
    assert layout(tmp_path, "a,x,y\n1,2,3\n").header == 1
    # A project may call columns 1, 2, ...: the first row of numbers is not their header.
    named = dict(zip(WANTED, "12345", strict=True))
    text = "1 2 3 4 5\n7 8 9 10 11\n"
    assert "no row of names" in complaint(layout, tmp_path, text, **named)


@pytest.mark.parametrize(
    ("name", "unit", "quantity", "state"),
    [
        ("X", "", "x", ""), ("dx", "", "dx", ""), ("u", "", "dx", ""), ("uz", "", "dz", ""),
        ("x deformed", "", "x", "deformed"), ("x undeformed", "", "x", "reference"),
        ("Vx", "mm", "dx", ""), ("Vx", "", "", ""), ("Vx", "m/s", "", ""),
        ("displacement x", "", "dx", ""), ("Koordinate Y", "mm", "y", ""), ("x px", "", "x", ""),
        ("x", "kPa", "", ""), ("xy", "", "", ""), ("x y", "", "", ""), ("strain x", "", "", ""),
        ("sigma", "pixel", "sigma", ""), ("sigma x", "", "", ""), ("is valid", "", "valid", ""),
        ("rejected", "", "invalid", ""), ("X_inch", "", "x", ""),
    ],
)  # fmt: skip
def test_what_a_heading_means(name, unit, quantity, state):
    found = heading_of(name, unit)
    assert (found.name, found.quantity, found.state) == (name, quantity, state)


def test_units_of_headings():
    scales = {"mm": 1.0, "cm": 10.0, "m": 1e3, "µm": 1e-3, "um": 1e-3, "in": 25.4, "INCH": 25.4}
    scales |= {'"': 25.4, "mil": 0.0254}
    for unit, scale in scales.items():
        assert heading_of("x", unit).scale == scale
        assert heading_of(f"x [{unit}]", "mm").scale == scale  # the name's own comes first
    assert heading_of("x_inch").unit == "inch" and heading_of("x um").unit == "um"
    assert heading_of("x", "px").scale is heading_of("x").scale is None

    def best(*names: str, upper: bool = False, **named: str) -> dict[str, list[int]]:
        return columns_of([heading_of(name) for name in names], named, upper)

    assert best("X [px]", "X", "X [mm]") == {"x": [2]}
    assert best("X [px]", "X", "U") == {"x": [1], "dx": [2]}
    assert best("X [mm]", "x") == {"x": [1]}
    assert best("x", "X", upper=True) == {"x": [1]} and best("x", upper=True) == {"x": [0]}
    assert best("X", "Y1 mm", "X") == {"x": [0, 2]}
    assert best("a", "X", "a [mm]", x="a") == {"x": [0]}
    assert best("b [mm]", "X", x="b") == {"x": [0]} and best("X", x="q") == {"x": []}
    assert best("x deformed", "x undeformed") == {"x deformed": [0], "x": [1]}


def test_columns_that_cannot_be_told(tmp_path):
    def asked(text: str, options: FrameOptions = PLAIN, **named: str):
        return quantity_columns(Path("a.csv"), layout(tmp_path, text, **named), named, options)

    rest, planar = ",dx,dy,dz\n1,2,3,4,5,6\n", FrameOptions(planar=True)
    after = "x deformed,y,dx,dy,dz\n1,2,3,4,5\n"
    for text, named, words in (
        (f"X,X pos,y{rest}", {}, "line 1: the column of x"), (f"X,X,y{rest}", {}, "'X': this col"),
        (f"X,X,y{rest}", {"x": "q"}, "column 'q': this column is missing"),
        ("x,dx,dy,dz\n1,2,3,4\n", {}, "column 'y': this column is missing"),
        (after.replace("dx", "q"), {}, "is missing"),
        (after.replace("x deformed", "y deformed"), {}, "is missing"),
    ):  # fmt: skip
        assert words in complaint(asked, text, **named)
    for one in ("z", "dz", "z deformed"):
        assert "is missing" in complaint(asked, f"x,y,dx,dy,{one}\n1,2,3,4,5\n", planar)
    assert asked(after)["x deformed"] == 0
    assert set(asked("x,y,dx,dy\n1,2,3,4\n", planar)) == {"x", "y", "dx", "dy"}


ROWS = "x{0}y{0}dx{0}dy{0}dz{0}ok\n1{0}2{0}3{0}4{0}5{0}1\n6{0}7{0}{1}{0}9{0}10{0}0\n"
COLUMNS = {"x": 0, "dx": 2}


def test_rows_of_another_length_name_their_line(tmp_path):
    def read(text: str, flags=()):
        return read_numbers(Path("a.csv"), layout(tmp_path, text), COLUMNS, flags)

    maybe = ROWS.format(";", "8").replace("10;0", "10;maybe")
    for text, words in (
        (ROWS.format(",", "8,5"), "line 3: expected 6 cells as in the header, found 7"),
        (ROWS.format(";", "8;5"), "line 3: expected 6 cells as in the header, found 7"),
        (ROWS.format(" ", ""), "line 3: expected 6 cells as in the header, found 5"),
        (ROWS.format(";", '"8'), "line 3: a quotation mark"),
        (maybe, "line 3, column 'ok': expected a number, found 'maybe'"),
    ):
        assert words in complaint(read, text, [(5, None)])
    # Empty cells at the end are none, and missing ones are empty, where there is a separator.
    text = ROWS.format(";", "8").replace("5;1\n", '"5";1;;\n').replace(";10;0\n", "\n")
    values, good = read(text)
    assert values["dx"].tolist() == [3.0, 8.0] and good.tolist() == [True, True]


def test_columns_whose_meaning_is_unclear_are_named(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x,y,z,dx,dy,dz,Mask,state\n1,2,3,4,5,6,0,1\n")
    (frame,) = read_frames([path], FrameOptions(flag_column="Mask"))
    (note,) = frame.source.notes
    assert "column 'state' is not used" in note
    (frame,) = read_frames([path], FrameOptions(valid_column="state", flag_column="Mask"))
    assert frame.source.notes == () and len(frame.points) == 1


def table(folder: Path, text: str) -> Path:
    path = folder / "a.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n\n# x\n3,4,5\n6,7\n8,9\n", "line 5: expected 2 cells as in the header"),
        ('a,b\n1,2\n3,"4\n5,6\n', "a quotation mark"), ("# only\na,b\n", "found only a header"),
        ("\n", "found nothing"), ("a,b\n1,2\n\x00,3\n", "is not a text file"),
    ],
)  # fmt: skip
def test_what_is_no_table(tmp_path, text, words):
    complaint_with(["a.csv", words], read_table, table(tmp_path, text))


def test_numbers_that_are_none(tmp_path):
    read = read_table(table(tmp_path, "# c\na,b,c\n1,,7\n2,x,7\n\n3,nan,8\n"))
    np.testing.assert_array_equal(read.numbers("a"), [1, 2, 3])
    said = complaint(read.numbers, "b")
    assert "line 3, column 'b': expected a number, found nothing; so in 2 more rows" in said
    said = complaint(read.numbers, "b", holes=True)
    assert "line 4, column 'b': expected a number, found 'x'" in said and "more" not in said
    long = read_table(table(tmp_path, f"a\n{'y' * 60}\n5\nz\n"))
    assert complaint(long.numbers, "a").endswith(f"found '{'y' * 40}'; so in 1 more row")
    read = read_table(table(tmp_path, "name,load\nNA,1\nnull,2\n,3\n nan ,4\n5\n"))
    assert read.text("name").tolist() == ["NA", "null", "", " nan ", "5"]
    assert read.lines.tolist() == [2, 3, 4, 5, 6]
    assert read.numbers("load", holes=True)[:4].tolist() == [1, 2, 3, 4]
    assert "line 2, column 'name': expected a number, found 'NA'" in complaint(read.numbers, "name")
