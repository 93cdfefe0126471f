"""readers/tables.py: tables of text: lines, cells, summary rows, decimal marks."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.tables import (
    MAX_MISSING_CELLS,
    Row,
    check_name,
    check_row,
    check_width,
    decimal_mark,
    has_statistic,
    is_number,
    is_numeric,
    padded,
    read_table,
    row_of,
    seconds_of_stamps,
    split_cells,
)
from hypothesis import given
from hypothesis import strategies as st

from ..support.refusals import complaint, complaint_with


def written_table(folder: Path, text: str) -> Path:
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
def test_file_that_is_no_table_is_refused(tmp_path, text, words):
    complaint_with(["a.csv", words], read_table, written_table(tmp_path, text))


def test_cells_that_are_no_numbers_are_refused(tmp_path):
    read = read_table(written_table(tmp_path, "# c\na,b,c\n1,,7\n2,x,7\n\n3,nan,8\n"))
    np.testing.assert_array_equal(read.numbers("a"), [1, 2, 3])
    said = complaint(read.numbers, "b")
    assert "line 3, column 'b': expected a number, found nothing; so in 2 more rows" in said
    said = complaint(read.numbers, "b", holes=True)
    assert "line 4, column 'b': expected a number, found 'x'" in said and "more" not in said
    long = read_table(written_table(tmp_path, f"a\n{'y' * 60}\n5\nz\n"))
    assert complaint(long.numbers, "a").endswith(f"found '{'y' * 40}'; so in 1 more row")
    read = read_table(written_table(tmp_path, "name,load\nNA,1\nnull,2\n,3\n nan ,4\n5\n"))
    assert read.text("name") == ["NA", "null", "", " nan ", "5"]
    assert read.lines.tolist() == [2, 3, 4, 5, 6]
    assert read.numbers("load", holes=True)[:4].tolist() == [1, 2, 3, 4]
    assert "line 2, column 'name': expected a number, found 'NA'" in complaint(read.numbers, "name")
    # Python reads the first two.
    for cell in ("1_000", "\N{ARABIC-INDIC DIGIT ONE}2", "0x1A", "1,5"):
        said = complaint(read_table(written_table(tmp_path, f'a\n2\n"{cell}"\n')).numbers, "a")
        assert f"line 3, column 'a': expected a number, found {cell!r}" in said


PATH = Path("a.csv")


@pytest.mark.parametrize(
    ("text", "separator", "cells"),
    [
        ("1, 2 ,3", ",", ["1", "2", "3"]),
        ("1  2\t3", None, ["1", "2", "3"]),
        ("1;;3", ";", ["1", "", "3"]),
        ('"1,5","a b"', ",", ["1,5", "a b"]),
        ('x ["];y', ";", ["x [in]", "y"]),
        ('"a b"  c', None, ["a b", "c"]),
    ],
)
def test_line_is_split_at_its_separator(text, separator, cells):
    assert split_cells(text, separator) == cells


def test_open_quotation_mark_gives_no_cells():
    assert split_cells('"a,b', ",") is None
    assert row_of(3, '"a,b', ",") == Row(3, [])


@given(st.lists(st.text("abc 1.5", min_size=1).map(str.strip), min_size=1, max_size=6))
def test_cells_joined_by_semicolons_come_back(cells):
    assert split_cells(";".join(cells), ";") == cells


def test_row_is_numeric_if_half_of_its_cells_are_numbers():
    assert is_numeric(["1", "x"]) and is_numeric(["1", "2", ""])
    assert not is_numeric(["1", "x", "y"]) and not is_numeric([])


@pytest.mark.parametrize(
    ("cell", "is_label"),
    [
        ("Mean", True), ("std. dev.", True), ("Coefficient of variation", True),
        ("Mittelwert", True), ("max 3", True), ("mean stress", False), ("of", False), ("", False),
    ],
)  # fmt: skip
def test_labels_of_summary_rows_are_recognised(cell, is_label):
    assert has_statistic(["1", cell]) == is_label


def test_short_row_is_padded_and_long_row_cut():
    assert padded(["1"], 3) == ["1", "", ""] and padded(["1", "2", "3"], 2) == ["1", "2"]


def test_missing_or_repeated_name_is_refused():
    check_name(PATH, ["x", "y"], "x")
    assert "is missing; the file has: x, y" in complaint(check_name, PATH, ["x", "y"], "z")
    assert "appears twice" in complaint(check_name, PATH, ["x", "x"], "x")


@pytest.mark.parametrize(
    ("cells", "separator", "words"),
    [
        (["1", "2", "3"], ";", "line 4: expected 2 cells as in the header, found 3"),
        (["1", "2", "3"], ",", "decimal commas need another separator"),
        (["1"], None, "expected 2 cells as in the header, found 1"),
    ],
)
def test_row_of_another_length_is_refused(cells, separator, words):
    assert words in complaint(check_row, PATH, Row(4, cells), 2, separator, "the header")


def test_row_may_lack_cells_where_a_separator_shows_them():
    check_row(PATH, Row(4, ["1"]), 2, ";", "the header")
    check_row(PATH, Row(4, ["1", "2", ""]), 2, ";", "the header")


def test_table_of_mostly_missing_cells_is_refused():
    check_width(PATH, 1, 3, 10, 60)
    rows = MAX_MISSING_CELLS // 1000
    assert "is it a table?" in complaint(check_width, PATH, 1, 1001, rows, 10)


@pytest.mark.parametrize(
    ("cells", "mark"),
    [
        (["1", "2.5"], "."), (["1,5", "2"], ","), (["1,5", "2.5"], "."), (["1,234", "0,5"], ","),
        (["0,234"], ","), (["1,2345"], ","), (["12", "x.y"], "."), ([",5"], ","),
        (["5.000", "7,60"], ","), (["5.000", "7,600"], "."),
        (["12", "1,234", "12,345"], "line 5, column 'x': '1,234': is the"),
    ],
)  # fmt: skip
def test_decimal_mark_is_found(cells, mark):
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
    ("stamps", "seconds"),
    [
        (["00:00:00", "01:00:00", "23:59:59,5"], [0.0, 3600.0, 86399.5]),
        (["12:00:00 AM", "1:01:01 a.m.", "12:30:00 PM", "1:00:00 p.m."], [0, 3661, 45000, 46800]),
        (["23:00:00", "01:00:00", "23:30:00", "00:30:00"], [82800, 90000, 171000, 174600]),
        (["2021-03-31T23:00:00Z", "2021-04-02T01:00:00Z"], [82800, 176400]),
    ],
)
def test_stamps_are_seconds_since_midnight_of_the_first_day(stamps, seconds):
    assert seconds_of_stamps(stamps).tolist() == seconds


def test_stamps_of_which_some_have_dates_are_refused():
    with pytest.raises(ValueError, match="dates before some of the times only"):
        seconds_of_stamps(["2021-03-31 23:00:00", "23:00:01"])
