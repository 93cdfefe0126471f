"""Write what is made from the sections of the project file, for editors and type checkers.

project/keys.pyi has the types of the keyword arguments of tests, laws and fits in Python, and
templates/project/project.schema.json is the schema of the project file.

python docs/make_keys.py
"""

from __future__ import annotations

import subprocess
import types
import typing
from pathlib import Path
from typing import Any

from bubblefit.cli.start import SHIPPED
from bubblefit.experiments.registry import kind_named
from bubblefit.materials.forms.base import form_names, form_settings
from bubblefit.project import objects
from bubblefit.project.schema import FitSection, LawSection, schema_text
from bubblefit.readers.sections import model_of
from pydantic import BaseModel

KEYS = Path(__file__).resolve().parents[1] / "project" / "keys.pyi"
HEAD = '''"""Keyword arguments in Python, made of the sections of a project (docs/make_keys.py)."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict

from numpy.typing import ArrayLike
'''
TESTS = (objects.Bubble, objects.Strips, objects.Biaxial, objects.Cylinder, objects.Deck)
#: Arguments that a constructor has by their names.
NAMED: dict[type, set[str]] = {
    objects.Bubble: {"pressures", "radius", "ellipse", "sheet", "registration", "name"},
    objects.Strips: {"width", "name"},
    objects.Biaxial: {"name"},
    objects.Cylinder: {"diameter", "pressure", "name"},
    objects.Deck: {"template", "parameters", "compare", "program", "name"},
}
#: Arguments of `fit` by their names, and keys of [fit] that `fit` does not take.
NAMED_IN_FIT = {"starts", "seed", "starts_from", "method", "jobs", "trust"}
#: Texts that name files, which may also be paths.
PATHS = {"folder", "reference", "pattern", "polynomials", "cache"}


def type_text(annotation: Any) -> str:
    """Return the type of what a user gives for a field of a section."""
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return type_text(parts[0])
    if origin in (typing.Union, types.UnionType):
        return " | ".join(dict.fromkeys(type_text(part) for part in parts))
    if origin is typing.Literal:
        return f"Literal[{', '.join(map(repr, parts))}]".replace("'", '"')
    if origin is list:
        item = type_text(parts[0])
        return "ArrayLike" if item in ("float", "int") else f"Sequence[{item}]"
    if origin is dict or (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
        return "Mapping[str, Any]"
    names = {type(None): "None", str: "str", float: "float", int: "int", bool: "bool"}
    return names.get(annotation, "Any")


def fields(model: type[BaseModel]) -> dict[str, str]:
    """Return the types of the fields of a section by name."""
    return {name: field_text(name, field.annotation) for name, field in model.model_fields.items()}


def field_text(name: str, annotation: Any) -> str:
    """Return the type of a field, where objects of Python may stand for it, too."""
    text = type_text(annotation)
    if name in PATHS:
        return text.replace("str", "str | Path")
    if name in ("sheet", "registration") and "Mapping" in text:
        return f"objects.{name.capitalize()} | Mapping[str, Any] | None"
    return "str | Callable[..., Any]" if name == "objective" else text


def typed_dict(name: str, doc: str, keys: dict[str, str], base: str = "TypedDict") -> str:
    """Return the class of keyword arguments, none of which is required."""
    lines = [f"class {name}({base}, total=False):", f'    """{doc}"""', ""]
    lines += [f"    {key}: {kind}" for key, kind in keys.items()]
    return "\n".join(lines) + "\n"


def without(keys: dict[str, str], names: set[str]) -> dict[str, str]:
    """Return the keys that are not among some names."""
    return {key: kind for key, kind in keys.items() if key not in names}


def keys_of_test(test: type[objects.Definition]) -> list[str]:
    """Return the classes of the arguments of a test and of its `read`."""
    section = kind_named(test.of_kind).section
    keys = fields(section)
    data = without(fields(model_of(section, objects.data_table(test.of_kind))), set(keys))
    named = NAMED[test]
    with_arrays = {key: data[key] for key in test.keys_of_arrays if key in data}
    arrays = without(keys | with_arrays, named)
    read_named = {"pressures"} if test is objects.Bubble else set()
    reading = without(keys | data, {*arrays, *read_named, "files"})
    name = test.__name__
    return [
        typed_dict(f"{name}Keys", f"Further arguments of `{name}`.", arrays),
        typed_dict(
            f"{name}FileKeys", f"Further arguments of `{name}.read`.", reading, f"{name}Keys"
        ),
    ]


def text() -> str:
    """Return the text of project/keys.pyi."""
    blocks = [block for test in TESTS for block in keys_of_test(test)]
    for keys in (objects.Sheet, objects.Registration):
        name = keys.__name__
        blocks.append(typed_dict(f"{name}Keys", f"Arguments of `{name}`.", fields(keys.section)))
    law = without(fields(LawSection), {"form"})
    settings = {key: "Any" for form in form_names() for key in form_settings(form)}
    law |= without(settings, set(law))
    blocks.append(typed_dict("LawKeys", "Further arguments of `Law`.", law))
    fit = without(fields(FitSection), NAMED_IN_FIT)
    blocks.append(typed_dict("FitKeys", "Further keys of [fit] in `fit`.", fit))
    return "\n\n".join([HEAD + "\nfrom . import objects\n", *blocks])


if __name__ == "__main__":
    KEYS.write_text(text(), encoding="utf-8")
    SHIPPED.write_text(schema_text(with_plug_ins=False), encoding="utf-8")
    subprocess.run(["ruff", "format", "--quiet", str(KEYS)], check=True)
