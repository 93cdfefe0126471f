"""The project file as one pydantic model, made of the common sections and every kind's own."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import BaseModel, Field, ValidationError, create_model

from ..errors import InputError
from ..experiments.registry import kind_named, kinds
from ..plugins import plug_in_named
from ..reading import toml_of
from ..section_errors import first_error
from .cards import CardSection
from .schema import CommonSections

#: Most tables of one sort: more is a mistake in whatever wrote the file.
MANY = 1000
OLD = (
    "is of version 0.1, which had a file for each kind of test; `bubblefit docs project-file`, "
    '"From version 0.1", says how to write it now (or start from `bubblefit init`)'
)


class ProjectFile(CommonSections):
    """A whole project file; its subclass from `project_file` has a list of tests a kind."""

    card: Annotated[list[CardSection], Field(max_length=MANY, default_factory=list)]
    solver: Annotated[dict[str, dict[str, Any]], Field(default_factory=dict)]

    def tests(self, kind: str) -> Sequence[Any]:
        """The sections of a kind, in the file's order."""
        return cast(Sequence[Any], getattr(self, kind))


@functools.cache
def project_file() -> type[ProjectFile]:
    """The model with the sections of all kinds that are there."""
    tests: dict[str, Any] = {
        name: (Annotated[_list_of(kind.section), Field(max_length=MANY)], [])
        for name, kind in kinds().items()
    }
    tables: dict[str, Any] = {name: (dict[str, Any], {}) for name in kinds()}
    defaults = create_model("Defaults", **tables)
    return create_model("Project", __base__=ProjectFile, defaults=(defaults, defaults()), **tests)


def _list_of(section: type[BaseModel]) -> Any:
    return list[section]  # type: ignore[valid-type]


def parse(path: Path) -> ProjectFile:
    """Parse a project file; tests have the keys of [defaults.KIND] that they do not say.

    Raises
    ------
    InputError : one line naming the file and the dotted key: TOML syntax, a file of version 0.1,
        missing or unknown keys, values that cannot be meant. PlugInFailure : a kind of test that
        a plug-in offers, and that does not work.
    """
    content = _content(path)
    if isinstance(content.get("project"), dict) and "kind" in content["project"]:
        raise InputError(path, "project.kind", OLD)
    model = project_file()
    for name in content.keys() - model.model_fields.keys():
        if plug_in_named("bubblefit.tests", name) is not None:
            kind_named(name)  # says why it is not among the model's
    try:
        return model.model_validate(_with_defaults(content))
    except ValidationError as errors:
        raise first_error(path, errors, cast(type[BaseModel], model)) from None


def _content(path: Path) -> dict[str, Any]:
    try:
        return toml_of(path)
    except FileNotFoundError:
        problem = "no such file; `bubblefit init DIR` writes an example to start from"
        raise InputError(path, "", problem) from None
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(path, "", "is not a text file in UTF-8") from None
    except (ValueError, RecursionError) as error:  # beside its own, tomllib lets these through
        raise InputError(path, "TOML syntax", str(error)) from None


def _with_defaults(content: Mapping[str, Any]) -> dict[str, Any]:
    whole, defaults = dict(content), content.get("defaults")
    if not isinstance(defaults, dict):
        return whole
    for kind, common in defaults.items():
        tests = whole.get(kind)
        if isinstance(common, dict) and isinstance(tests, list):
            whole[kind] = [_merged(common, t) if isinstance(t, dict) else t for t in tests]
    return whole


def _merged(common: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """What is said in `own`, and in `common` where it is not; tables key by key."""
    merged = {**common, **own}
    for key in common.keys() & own.keys():
        if isinstance(common[key], dict) and isinstance(own[key], dict):
            merged[key] = _merged(common[key], own[key])
    return merged
