"""Tables: what is wrong with one is said with its file, line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.tables import read_table, write_table

from ..complaints import complaint


def table(folder: Path, text: str) -> Path:
    path = folder / "a.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "where", "what"),
    [
        (
            "a,b\n1,2\n\n# x\n3,4,5\n6,7\n8,9\n",
            "line 5:",
            "expected 2 cells as in the header, found 3",
        ),
        ('a,b\n1,2\n3,"4\n5,6\n', "", "a quotation mark that is opened and not closed"),
        ("# only\na,b\n", "", "found only a header line"),
        ("\n", "", "found nothing"),
        ("a,b\n1,2\n\x00,3\n", "", "is not a text file"),
    ],
)
def test_what_is_no_table(tmp_path: Path, text: str, where: str, what: str) -> None:
    said = complaint(read_table, table(tmp_path, text))
    assert "a.csv" in said and where in said and what in said


def test_numbers_that_are_none(tmp_path: Path) -> None:
    read = read_table(table(tmp_path, "# c\na,b,c\n1,,7\n2,x,7\n\n3,nan,8\n"))
    np.testing.assert_array_equal(read.numbers("a"), [1, 2, 3])
    said = complaint(read.numbers, "b")
    assert "line 3, column 'b': expected a number, found nothing; so in 2 more rows" in said
    said = complaint(read.numbers, "b", holes=True)
    assert "line 4, column 'b': expected a number, found 'x'" in said and "more" not in said
    assert "line 6, column 'c': expected the same number as in line 3" in complaint(
        read.constant, "c"
    )
    assert read.rows(np.array([True, True, False])).constant("c") == 7
    long = read_table(table(tmp_path, f"a\n{'y' * 60}\n5\nz\n"))
    assert f"found '{'y' * 40}'; so in 1 more row" in complaint(long.numbers, "a")
    assert not complaint(long.numbers, "a").endswith("rows")


def test_texts_stay_as_they_are(tmp_path: Path) -> None:
    """A specimen may be called NA."""
    read = read_table(table(tmp_path, "name,load\nNA,1\nnull,2\n,3\n nan ,4\n5\n"))
    assert read.text("name").tolist() == ["NA", "null", "", " nan ", "5"]
    assert read.lines.tolist() == [2, 3, 4, 5, 6]
    assert read.numbers("load", holes=True)[:4].tolist() == [1, 2, 3, 4]
    assert "line 2, column 'name': expected a number, found 'NA'" in complaint(read.numbers, "name")


def test_floats_read_back_exactly(tmp_path: Path) -> None:
    path, values = tmp_path / "b.csv", [0.1 + 0.2, 1e-300, -3.0]
    write_table(path, ["v", "n"], [[v, i] for i, v in enumerate(values)], comment="mm")
    assert path.read_text().startswith("# mm\nv,n\n0.30000000000000004,0\n")
    np.testing.assert_array_equal(read_table(path).numbers("v"), values)
