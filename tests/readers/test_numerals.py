"""readers/numerals.py: decimal marks."""

from pathlib import Path

import pytest
from bubblefit.readers.numerals import decimal_mark, is_number

from ..support.refusals import complaint


@pytest.mark.parametrize(
    ("cells", "mark"),
    [
        (["1", "2.5"], "."), (["1,5", "2"], ","), (["1,5", "2.5"], "."), (["1,234", "0,5"], ","),
        (["0,234"], ","), (["1,2345"], ","), (["12", "x.y"], "."), ([",5"], ","),
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
