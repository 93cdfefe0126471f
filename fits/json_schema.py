"""The JSON Schema of the project file, by which editors complete and check it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..experiments.registry import kinds
from ..plugins import plug_ins
from ..solvers.registry import solver_sections
from .file import project_file

#: As it is shipped: of the kinds of test and solvers that come with bubblefit.
SHIPPED = Path(__file__).resolve().parent.parent / "templates" / "project" / "project.schema.json"
DRAFT = "https://json-schema.org/draft/2020-12/schema"
#: Where a table of one solver's settings is listed by its name.
SOLVER = "Settings of solvers, by name: [solver.membrane] and so on."
REFERENCE = "#/$defs/"


def project_schema(with_plug_ins: bool = True) -> dict[str, Any]:
    """The schema of a whole file, as plain data.

    A test may have its keys from [defaults.KIND], so that none is required here; bubblefit itself
    says which are missing.

    Parameters
    ----------
    with_plug_ins : whether kinds of test that other distributions add are in it.
    """
    schema = project_file().model_json_schema()
    definitions, properties = schema["$defs"], schema["properties"]
    theirs = {plug_in.name for plug_in in plug_ins("bubblefit.tests")}
    own = [name for name in kinds() if with_plug_ins or name not in theirs]
    for name in kinds():
        if name not in own:
            del properties[name]
    for name in own:
        for used in _used(properties[name], definitions):
            definitions[used].pop("required", None)
    properties["defaults"] = {
        "description": "Keys that every test of a kind has unless it says them itself.",
        "type": "object",
        "additionalProperties": False,
        "properties": {name: properties[name]["items"] for name in own},
    }
    sections = {name: s.model_json_schema() for name, s in solver_sections().items()}
    for section in sections.values():
        definitions.update(section.pop("$defs", {}))
    properties["solver"] = {
        "description": SOLVER,
        "type": "object",
        "properties": sections,
        # Those of plug-ins check their own settings.
        "additionalProperties": {"type": "object"},
    }
    needed = _used(properties, definitions)
    schema["$defs"] = {name: definitions[name] for name in sorted(needed)}
    plain: dict[str, Any] = _plain(schema)
    return plain | {"$schema": DRAFT, "title": "bubblefit project"}


def schema_text(with_plug_ins: bool = True) -> str:
    """The schema as a file."""
    return json.dumps(project_schema(with_plug_ins), indent=1, sort_keys=True) + "\n"


def _plain(part: Any) -> Any:
    """Without null, which TOML does not have, and without the titles that only repeat the keys."""
    if isinstance(part, list):
        return [_plain(one) for one in part]
    if not isinstance(part, dict):
        return part
    choices = [one for one in part.get("anyOf", []) if one != {"type": "null"}]
    rest = {
        key: _plain(value)
        for key, value in part.items()
        if key != "anyOf"
        and not (key == "title" and isinstance(value, str))
        and not (key == "default" and value is None)
    }
    if len(choices) == 1:
        return {**_plain(choices[0]), **rest}
    return {**rest, "anyOf": [_plain(one) for one in choices]} if choices else rest


def _used(part: Any, definitions: dict[str, Any]) -> set[str]:
    """Names of the definitions that a part of the schema leads to."""
    used: set[str] = set()
    waiting = [part]
    while waiting:
        one = waiting.pop()
        if isinstance(one, dict):
            target = one.get("$ref")
            if isinstance(target, str):
                name = target.removeprefix(REFERENCE)
                if name not in used:
                    used.add(name)
                    waiting.append(definitions[name])
            waiting += one.values()
        elif isinstance(one, Sequence) and not isinstance(one, str):
            waiting += one
    return used
