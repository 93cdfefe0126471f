"""readers/text_frames.py: layout and columns of text tables of frames."""

import math
from pathlib import Path

import pytest
from bubblefit.readers import text_frames
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.text_frames import (
    find_layout,
    is_summary,
    quantity_columns,
    read_numbers,
)

from ..support.refusals import complaint

WANTED = ("x", "y", "dx", "dy", "dz")
PLAIN = FrameOptions(WANTED)


def layout_of(folder: Path, text: str, comment: str = "#", **named: str):
    path = folder / "a.txt"
    path.write_text(text)
    return find_layout(path, WANTED, named, comment)


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
def test_layout_finds_header_separator_and_numbers(
    tmp_path, text, separator, header, lines, decimal
):
    found = layout_of(tmp_path, text)
    assert (found.separator, found.header, found.decimal) == (separator, header, decimal)
    assert [line for line, _ in found.body] == lines


def test_row_of_units_is_found(tmp_path):
    text = "x,y,dx,dy,dz,v\n[mm],mm,(µm),um,,m/s\n1,2,3,4,5,6\n"
    found = layout_of(tmp_path, text)
    assert [h.unit for h in found.headings] == ["mm", "mm", "µm", "um", "", "m/s"]
    assert [line for line, _ in found.body] == [3]
    assert dict(found.columns) == {name: [i] for i, name in enumerate(WANTED)}
    # Texts without a length are no units, and a row with a number in it is a row.
    for row in ("a,b,c,d,e,f", "mm,1,mm,mm,mm,mm"):
        assert len(layout_of(tmp_path, text.replace("[mm],mm,(µm),um,,m/s", row)).body) == 2


def test_missing_row_of_names_is_refused(tmp_path):
    for text, words in (
        ("# a\n\n", "expected a header line and rows of numbers,"),
        ("x,y,dx,dy,dz,b,c\n", "line 1: expected a header line and"),
        ("some words\n", "expected a header line and rows of"),
        ("word\n" * 300 + "x,y,dx,dy,dz\n1,2,3,4,5\n", "no row of names"),
        # One quantity is no table of points; two are.
        ("# m\na,b\n1,2\n", "Line 2 is: a,b"), ("# m\na,x\n1,2\n", "Line 2 is: a,x"),
    ):  # fmt: skip
        assert words in complaint(layout_of, tmp_path, text)
    assert layout_of(tmp_path, "a,x,y\n1,2,3\n").header == 1
    # A project may call columns 1, 2, ...: the first row of numbers is not their header.
    named = dict(zip(WANTED, "12345", strict=True))
    text = "1 2 3 4 5\n7 8 9 10 11\n"
    assert "no row of names" in complaint(layout_of, tmp_path, text, **named)


@pytest.mark.parametrize(
    ("row", "first", "expected"),
    [
        ("remark,1,nan", "1,2,3", True),
        ("remark,1,2", "1,2,3", True),
        ("nan,1,remark", "1,2,3", False),
        ("remark,1,2", "point,2,3", False),
        ("mean,1,2", "point,2,3", True),
        ("1,2,3", "1,2,3", False),
    ],
)
def test_rows_that_begin_with_a_word_are_a_summary_below_numbers(row, first, expected):
    assert is_summary(row, first, ",") is expected


def test_ambiguous_columns_of_a_frame_are_refused(tmp_path):
    def asked(text: str, options: FrameOptions = PLAIN, **named: str):
        return quantity_columns(Path("a.csv"), layout_of(tmp_path, text, **named), named, options)

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


def test_row_of_another_length_is_named_with_its_line(tmp_path):
    def read(text: str, flags=()):
        return read_numbers(Path("a.csv"), layout_of(tmp_path, text), COLUMNS, flags)

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


def test_unclear_columns_are_named(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x,y,z,dx,dy,dz,Mask,state\n1,2,3,4,5,6,0,1\n")
    (frame,) = read_frames([path], FrameOptions(flag_column="Mask"))
    (note,) = frame.source.notes
    assert "column 'state' is not used" in note
    (frame,) = read_frames([path], FrameOptions(valid_column="state", flag_column="Mask"))
    assert frame.source.notes == () and len(frame.points) == 1


def test_rows_with_and_without_holes_have_the_same_numbers(tmp_path, monkeypatch):
    digits = "0.1234567890123456789"
    rows = "".join(f"{k},{k}.5,{digits},-{k}e-3,+{k}.25\n" for k in range(4))

    def read(extra: str):
        layout = layout_of(tmp_path, f"x,y,dx,dy,dz\n{rows}{extra}")
        columns = quantity_columns(Path("a.txt"), layout, {}, PLAIN)
        values, good = read_numbers(Path("a.txt"), layout, columns, ())
        assert good.all()
        return values

    with_hole = read("5,6,,8,9\n")
    # Without holes no cell is read by itself.
    monkeypatch.setattr(text_frames, "_CellTable", None)
    for name, values in read("").items():
        assert with_hole[name][:4].tolist() == pytest.approx(values.tolist(), rel=1e-15)
    assert math.isnan(with_hole["dx"][4]) and values.tolist() == [k + 0.25 for k in range(4)]


def test_first_six_of_the_columns_that_a_quantity_may_be_are_named(tmp_path):
    names = [f"{name} (mm)" for name in ("u", "U", "ux", "uX", "Ux", "UX", "dx")]
    cells = ",".join(map(str, range(len(names) + 4)))
    layout = layout_of(tmp_path, f"x,y,{','.join(names)},dy,dz\n{cells}\n")
    message = complaint(quantity_columns, tmp_path / "a.txt", layout, {}, PLAIN)
    listed = " or ".join(map(repr, names[:6]))
    assert f"line 1: the column of dx may be {listed}; name one with columns" in message
