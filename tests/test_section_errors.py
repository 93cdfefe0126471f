"""Pydantic's findings as one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from bubblefit.section_errors import dotted, first_error
from bubblefit.sections import Section
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
