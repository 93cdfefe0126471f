"""readers/cells.py: lines split into cells, summary rows, rows of a wrong length."""

from pathlib import Path

import pytest
from bubblefit.readers.cells import (
    MAX_MISSING_CELLS,
    Row,
    check_name,
    check_row,
    check_width,
    has_statistic,
    is_numeric,
    padded,
    row_of,
    split_cells,
)
from hypothesis import given
from hypothesis import strategies as st

from ..support.refusals import complaint

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
