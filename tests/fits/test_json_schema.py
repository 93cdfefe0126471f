"""The schema of the project file: as it is shipped, and what it leaves out of pydantic's."""

from __future__ import annotations

import os

import pytest
from bubblefit.project.schema import SHIPPED, _plain, _used, schema_text
from bubblefit.runs.executor import cores


def test_the_shipped_schema_is_what_the_sections_say() -> None:
    """Every default, limit and unit of a key.

    Else: bubblefit schema --out templates/project/project.schema.json, without plug-ins.
    """
    assert SHIPPED.read_text() == schema_text(with_plug_ins=False)


def test_plain() -> None:
    """Without null and titles that repeat a key; a key of that name stays."""
    pydantics = {
        "title": "Width",
        "anyOf": [{"type": "number", "title": "A"}, {"type": "null"}],
        "default": None,
        "properties": {"title": {"title": "Title", "type": "string", "default": 0}},
        "list": [{"anyOf": [{"type": "string"}, {"type": "number"}]}],
    }
    assert _plain(pydantics) == {
        "type": "number",
        "properties": {"title": {"type": "string", "default": 0}},
        "list": [{"anyOf": [{"type": "string"}, {"type": "number"}]}],
    }


def test_used_definitions() -> None:
    definitions = {
        "A": {"items": [{"$ref": "#/$defs/B"}]},
        "B": {"$ref": "#/$defs/A"},
        "C": {"properties": {"$ref": {"type": "string"}}},
        "D": {},
    }
    assert _used({"x": {"$ref": "#/$defs/A"}}, definitions) == {"A", "B"}
    # A key that is called so is no reference.
    assert _used({"x": {"$ref": "#/$defs/C"}}, definitions) == {"C"}


@pytest.mark.parametrize(("count", "said"), [(6, 6), (None, 1)])
def test_cores_where_the_system_does_not_say_which(monkeypatch, count, said) -> None:
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: count)
    assert cores.__wrapped__() == said
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3, 5}, raising=False)
    assert cores.__wrapped__() == 3
