"""page.json: the whole data of a page, from which report.html is made, now or later."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from ..errors import InputError
from ..files import write_text
from .content import Report

PAGE_DATA = "page.json"
#: Of the file's layout; a page of another one is not made again.
LAYOUT = 1


@cache
def _adapter() -> TypeAdapter[Report]:
    return TypeAdapter(Report)


def write_page_data(folder: Path, report: Report) -> Path:
    """Write page.json.

    Raises
    ------
    OutputError : it cannot be written.
    """
    content = {"layout": LAYOUT, **plain(report)}
    path = folder / PAGE_DATA
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def read_page_data(folder: Path) -> Report:
    """The page of a folder's page.json.

    Raises
    ------
    InputError : it is not there, damaged, or of another version's layout.
    """
    path = folder / PAGE_DATA
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        layout = content.pop("layout")
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, AttributeError, TypeError):
        raise InputError(path, "", "is damaged: expected the data of a page") from None
    if layout != LAYOUT:
        problem = f"is of another version's layout: expected {LAYOUT}, got {layout!r}"
        raise InputError(path, "layout", problem)
    try:
        return _adapter().validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(path, ".".join(map(str, first["loc"])), first["msg"]) from None


def as_written(report: Report) -> Report:
    """The report as page.json gives it back: what a page is made of, whenever it is made."""
    return _adapter().validate_python(plain(report))


def plain(value: object) -> Any:
    """Plain values of dataclasses, arrays and numbers; None for what is no finite number."""
    if is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, bool | int | None):
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(own) for key, own in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(own) for own in value]
    return str(value)
