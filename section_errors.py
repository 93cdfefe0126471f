"""From pydantic's findings to one line that names the file, the key and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from .errors import InputError


def dotted(location: Sequence[str | int]) -> str:
    """('bounds', 'lower', 3) -> 'bounds.lower[3]'."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def first_error(
    path: Path | None, found: ValidationError, file: type[BaseModel], at: str = ""
) -> InputError:
    """The first finding as an InputError; unknown keys first, as they explain missing ones.

    file : the sections and keys there are. at : dotted key of the table that was checked, "" for
    the whole file.
    """
    errors = sorted(found.errors(), key=lambda e: e["type"] != "extra_forbidden")
    problem = _problem(errors[0], file)
    if len(errors) > 1:
        problem += f" ({len(errors) - 1} more)"
    key = dotted(errors[0]["loc"])
    return InputError(path, f"{at}.{key}" if at and key else at or key, problem)


def _problem(error: Mapping[str, Any], file: type[BaseModel]) -> str:
    kind, location, given = error["type"], error["loc"], error.get("input")
    if kind == "missing":
        field = file.model_fields.get(str(location[0])) if len(location) == 1 else None
        table = field is not None and next(_sections(field.annotation), None) is not None
        return f"this {'section' if table else 'key'} is missing; add it"
    if kind == "extra_forbidden":
        return _unknown(location, file)
    if kind == "finite_number":
        return f"expected a finite number, got {given!r}"
    if kind in ("too_short", "too_long"):
        few = "at least" if kind == "too_short" else "at most"
        count = error["ctx"]["min_length" if kind == "too_short" else "max_length"]
        return f"expected {few} {count} items, got {len(given) if given is not None else 0}"
    expected = error["msg"].removeprefix("Input should be ").rstrip(".")
    return f"expected {expected}, got {_short(given)}"


def _unknown(location: Sequence[str | int], file: type[BaseModel]) -> str:
    known = _keys_beside(location, file)
    near = difflib.get_close_matches(str(location[-1]), known, n=1, cutoff=0.5)
    meant = f"did you mean {near[0]!r}? " if near else ""
    return f"unknown key; {meant}allowed here: {', '.join(known)}"


def _keys_beside(location: Sequence[str | int], file: type[BaseModel]) -> list[str]:
    """Allowed keys of the table that holds `location`."""
    table = file
    for part in location[:-1]:
        if isinstance(part, str):  # a number counts the tables of a list
            table = _table(table.model_fields[part].annotation)
    return list(table.model_fields)


def _table(annotation: Any) -> type[BaseModel]:
    """The section class of an annotation such as `PointsSection | None` or `list[CaseSection]`."""
    return next(_sections(annotation))


def _sections(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inside in getattr(annotation, "__args__", ()):
        yield from _sections(inside)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
