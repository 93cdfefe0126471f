"""Pydantic's findings as one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from bubblefit.readers.sections import Section, dotted, first_error
from pydantic import Field, ValidationError


class Inner(Section):
    length: float
    pair: list[float] = Field(default=[1.0, 2.0], min_length=2, max_length=2)


class Outer(Section):
    name: str = "a"
    inner: Inner | None = None
    many: list[Inner] = Field(default=[])
    needed: Inner


RIGHT = {"length": 1.0}


def said(content: dict[str, Any], at: str = "") -> str:
    with pytest.raises(ValidationError) as found:
        Outer.model_validate(content)
    return str(first_error(Path("p.toml"), found.value, Outer, at))


def test_keys_of_tables_and_lists() -> None:
    assert dotted(("law", "bounds", "lower", 3)) == "law.bounds.lower[3]"
    assert dotted(("many", 1, "length")) == "many[1].length"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({}, "needed: this section is missing; add it"),
        ({"needed": {}}, "needed.length: this key is missing; add it"),
        ({"needed": RIGHT, "nam": "x"}, "nam: unknown key; did you mean 'name'? allowed here: "),
        ({"needed": {**RIGHT, "zzz": 1}}, "needed.zzz: unknown key; allowed here: length, pair"),
        ({"needed": RIGHT, "many": [RIGHT, {"lenght": 1}]}, "many[1].lenght: unknown key; did"),
        ({"needed": {"length": float("inf")}}, "expected a finite number, got inf"),
        ({"needed": {**RIGHT, "pair": [1]}}, "needed.pair: expected at least 2 items, got 1"),
        ({"needed": {**RIGHT, "pair": [1, 2, 3]}}, "needed.pair: expected at most 2 items, got 3"),
        ({"needed": RIGHT, "name": 3}, "name: expected a valid string, got 3"),
    ],
)
def test_what_is_said(content: dict[str, Any], words: str) -> None:
    text = said(content)
    assert text.startswith("p.toml") and words in text and "\n" not in text


def test_only_the_first_is_told_and_the_rest_counted() -> None:
    one = said({"needed": {"length": "x"}})
    assert "more)" not in one
    three = said({"needed": {"length": "x"}, "name": 3, "nam": 1})
    assert "nam: unknown key" in three and three.endswith("(2 more)")


def test_long_values_are_cut_and_the_table_named() -> None:
    text = said({"needed": {"length": "y" * 100}}, "strips")
    assert "strips.needed.length" in text
    assert text.endswith("got '" + "y" * 56 + "...")
    assert said({"needed": {"length": "y" * 58}}).endswith("got '" + "y" * 58 + "'")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({}, "needed: this section is missing; add it"),
        ({"needed": {}}, "needed.length: this key is missing; add it"),
        ({"needed": RIGHT, "nam": "x"}, "nam: unknown key; did you mean 'name'? allowed here: "
         "name, inner, many, needed"),
        ({"needed": RIGHT, "inner": {"lngth": 1.0, "length": 1.0}}, "inner.lngth: unknown key; did "
         "you mean 'length'? allowed here: length, pair"),
        ({"needed": RIGHT, "many": [RIGHT, {"length": 1.0, "pairs": 1}]}, "many[1].pairs: unknown "
         "key; did you mean 'pair'? allowed here: length, pair"),
        # Half of the letters in their order are near, fewer are not.
        ({"needed": {**RIGHT, "pxyz": 1}}, "needed.pxyz: unknown key; allowed here: length, pair"),
        ({"needed": {**RIGHT, "paxy": 1}}, "needed.paxy: unknown key; did you mean 'pair'? allowed "
         "here: length, pair"),
        ({"needed": {**RIGHT, "pair": []}}, "needed.pair: expected at least 2 items, got 0"),
        ({"needed": {**RIGHT, "pair": "x" * 58}}, "needed.pair: expected a valid list, got '"
         + "x" * 58 + "'"),
        ({"needed": {**RIGHT, "pair": "x" * 59}}, "needed.pair: expected a valid list, got '"
         + "x" * 56 + "..."),
        ({"needed": {"length": "x"}, "name": 3}, "name: expected a valid string, got 3 (1 more)"),
    ],
)  # fmt: skip
def test_the_whole_line(content: dict[str, Any], words: str) -> None:
    assert said(content) == f"p.toml: {words}"
    field, rest = words.split(": ", 1)
    assert said(content, "a.b") == f"p.toml: a.b.{field}: {rest}"
