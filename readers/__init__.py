"""Readers of measured files, and what is made of their data.

    from bubblefit.data import read_fields, read_load_curves

Each finds the format of a file by its content, unless `format` names it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .bending import read_bending_curves
    from .curves import read_load_curves, read_published_polynomials
    from .fields import read_field, read_fields
    from .frames import read_frames
    from .machine_tables import read_machine_loads
    from .registry import format_names
    from .surfaces import read_surfaces

__all__ = [
    "format_names",
    "read_bending_curves",
    "read_field",
    "read_fields",
    "read_frames",
    "read_load_curves",
    "read_machine_loads",
    "read_published_polynomials",
    "read_surfaces",
]

#: Where they are: imported when they are asked for, so that one reader does not cost all others.
_PLACES = {
    "format_names": "registry",
    "read_bending_curves": "bending",
    "read_field": "fields",
    "read_fields": "fields",
    "read_frames": "frames",
    "read_load_curves": "curves",
    "read_machine_loads": "machine_tables",
    "read_published_polynomials": "polynomials",
    "read_surfaces": "surfaces",
}


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(import_module(f".{_PLACES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
