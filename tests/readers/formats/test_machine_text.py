"""readers/formats/machine_text.py: the separator and the row of names of a text export."""

import pytest
from bubblefit.readers.formats.machine_text import (
    describe_missing_header,
    find_names_above_numbers,
    read,
    split_into_cells,
)
from bubblefit.readers.machine_tables import TableOptions

from ...support.refusals import complaint

OPTIONS = TableOptions(quantities=("elongation", "load"))


def lines_of(text):
    return list(enumerate(text.splitlines(), start=1))


@pytest.mark.parametrize("separator", ["\t", ";", ",", None])
def test_separator_is_that_which_gives_most_names(separator):
    mark = separator or "  "
    text = f"Test 3\nExtension_mm{mark}Load_N\n0{mark}0\n1{mark}10\n"
    found = split_into_cells(lines_of(text), OPTIONS)
    assert (found.separator, found.width, found.header_index) == (separator, 2, 1)
    assert found.rows[3].cells == ["1", "10"]


def test_blanks_separate_only_if_no_other_separator_does():
    found = split_into_cells(lines_of("Extension (mm);Load (N)\n0;1\n"), OPTIONS)
    assert found.separator == ";" and found.width == 2
    assert split_into_cells(lines_of("a b\n1 2\n"), OPTIONS) is None


def test_table_of_an_export_is_read_in_its_units(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Sample 7\nExtension (mm),Load (kN)\n0,0\n1,0.2\n")
    table = read(path, OPTIONS)
    assert table.names == ["Extension (mm)", "Load (kN)"]
    assert table.units == {"Extension (mm)": "mm", "Load (kN)": "kN"} and table.header == 2
    assert table.table.text("Load (kN)") == ["0", "0.2"]


def test_export_without_names_lists_the_row_above_its_numbers(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Sample 7\na,b\n1,2\n3,4\n")
    message = complaint(read, path, OPTIONS)
    assert "no header row" in message and "line 2, above the first numbers, has: a, b" in message
    path.write_text("only words\n")
    assert "no line with two numbers" in complaint(read, path, OPTIONS)


def test_names_stand_above_the_row_of_units():
    names = find_names_above_numbers(lines_of("t\na;b\nmm;kN\n1;2\n"))
    assert (names.line, names.cells) == (2, ["a", "b"])
    assert find_names_above_numbers(lines_of("a;b\nx;y\n")) is None
    assert "has: a, b" in describe_missing_header(lines_of("a;b\n1;2\n"), OPTIONS)
