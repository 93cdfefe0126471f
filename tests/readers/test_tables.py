"""readers/tables.py: tables of text."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.tables import read_table

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
    assert read.text("name").tolist() == ["NA", "null", "", " nan ", "5"]
    assert read.lines.tolist() == [2, 3, 4, 5, 6]
    assert read.numbers("load", holes=True)[:4].tolist() == [1, 2, 3, 4]
    assert "line 2, column 'name': expected a number, found 'NA'" in complaint(read.numbers, "name")
