"""Rows of names, units and numbers in a test machine's text, and what is said where none is."""

from __future__ import annotations

from pathlib import Path

import pytest
from bubblefit.readers.formats.machine_text import cells_of, find_blocks, find_header, nothing_found

from ..complaints import complaint

NEEDED = ("elongation", "load")


def rows(*texts: str) -> list[tuple[int, list[str]]]:
    return [(line, cells_of(text, ",")) for line, text in enumerate(texts, start=11)]


@pytest.mark.parametrize(
    ("texts", "index"),
    [
        (("Load,Extension", "1,2"), 0),
        (("Load,Extension", "N,mm", "1,2"), 0),
        (("Load,Extension", "N,mm", "of steel", "1,2"), 0),  # names without numbers: the first
        (("Load,Extension", "a,b", "c,d", "Load,Extension", "1,2"), 3),
        (("Load,Extension", "x,2", "1,y"), 0),  # each in one of the two rows
        (("Load,Extension", "x,2", "y,3", "Load,Extension", "1,2"), 3),
        (("Load and extension: all", "1,2"), None),
        (("Load,Time", "1,2"), None),
        (("1,2", "3,4"), None),
    ],
)
def test_the_row_of_names(texts: tuple[str, ...], index: int | None) -> None:
    assert find_header(rows(*texts), {}, NEEDED) == index


def test_names_that_are_given() -> None:
    named = {"load": "F", "elongation": "u"}
    assert find_header(rows("Load,Extension", "1,2", "F,u", "3,4"), named, NEEDED) == 2


def test_cells_of_a_line() -> None:
    assert cells_of('"a,b", c', ",") == ["a,b", "c"] and cells_of(" a ;b", ";") == ["a", "b"]


def blocks(*texts: str):
    found = find_blocks(Path("a.csv"), rows(*texts), 0, {}, NEEDED)
    return {
        names: [(b.line, b.units, [line for line, _ in b.rows]) for b in each]
        for names, each in found.items()
    }


def test_tables_one_after_the_other() -> None:
    """What stands between two tables is the title of the second; blank rows are none."""
    names = ("Load (N)", "Extension")
    found = blocks(
        "Load (N),Extension", ",mm", "0,0", ",", "1,2", "Specimen 2,x", "Width,25",
        "Load (N),Extension", "3,4", "5,6", "end,",
    )  # fmt: skip
    assert found == {
        names: [
            (11, {"Load (N)": "N", "Extension": "mm"}, [13, 15]),
            (18, {"Load (N)": "N", "Extension": ""}, [19, 20, 21]),
        ]
    }
    other = blocks("Load,Extension", "1,2", "Extension,Load", "(mm),[N]", "3,4")
    assert other == {
        ("Load", "Extension"): [(11, {"Load": "", "Extension": ""}, [12])],
        ("Extension", "Load"): [(13, {"Extension": "mm", "Load": "N"}, [15])],
    }


def test_a_row_of_units_that_contradicts_the_names() -> None:
    assert complaint(blocks, "Load (N),Extension", "kN,mm", "1,2") == (
        "a.csv: line 12, column 'Load (N)': unit 'kN' here, but 'N' in the column's name; correct "
        "one"
    )
    # A row with a number in a column that is needed is none of units; signs alone are none.
    assert blocks("Load,Extension", "N,3", "1,2")[("Load", "Extension")][0][1]["Load"] == ""
    assert blocks("Load,Extension", "-,-", "1,2")[("Load", "Extension")][0][2] == [12, 13]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["a,b", "1,2"], "line 11, above the first numbers, has: a, b"),
        (["a,b", "(mm),s", "1,2"], "line 11, above the first numbers, has: a, b"),
        (["a,b", "x,y", "1,2"], "line 12, above the first numbers, has: x, y"),
        (["a,b,c", "mm,s", "1,2"], "line 12, above the first numbers, has: mm, s"),
        (["a,b", "1,x"], "no line with two numbers was found either"),
        (["a;b", "1;2"], "line 11, above the first numbers, has: a, b"),
    ],
)
def test_which_row_it_might_have_been(lines: list[str], words: str) -> None:
    said = nothing_found(list(enumerate(lines, start=11)), {"load": "F"}, NEEDED)
    assert said == (
        "no header row with the columns one of elongation and 'F'; name them with columns; " + words
    )
